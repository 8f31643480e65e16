// The outbox: what is in it survives, and no more is in it than it may hold.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>

#include "workloads/backends/nats/robot/caller.h"
#include "workloads/base/error.h"

namespace pirt::cloud {
namespace {

using ::testing::HasSubstr;
constexpr std::uint64_t kLimit = 1000;

template <typename Call>
std::string error_of(const Call& call) {
  try {
    call();
  } catch (const Error& error) {
    return error.what();
  }
  return "no error";
}

class CloudOutbox : public ::testing::Test {
 protected:
  void SetUp() override {
    std::string folder = (std::filesystem::temp_directory_path() / "pirt-outbox-XXXXXX").string();
    ASSERT_NE(::mkdtemp(folder.data()), nullptr);
    folder_ = folder;
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }
  [[nodiscard]] std::unique_ptr<Outbox> open(const std::string& robot = "r") const {
    return open_outbox(folder_ / "outbox.db", robot, kLimit);
  }
  static Bytes bytes(std::size_t size, int value = 1) {
    return Bytes(size, static_cast<std::byte>(value));
  }
  std::filesystem::path folder_;
};

TEST_F(CloudOutbox, HasWhatItHadWhenItIsOpenedAgain) {
  {
    const auto outbox = open();
    EXPECT_TRUE(outbox->put({1, 1}, "", 1, bytes(10)));
    EXPECT_TRUE(outbox->put({1, 2}, "cellar", 1, bytes(20, 2)));
    EXPECT_TRUE(outbox->put({~0ULL, ~0ULL}, "", 1, bytes(0)));
    outbox->note({1, 2}, 4, 2);
    outbox->answer({1, 2}, bytes(5, 3));
    outbox->erase({1, 1});
  }
  const auto outbox = open();
  const auto all = outbox->all();
  ASSERT_EQ(all.size(), 2U);
  EXPECT_EQ(all[0].key, "cellar");
  EXPECT_EQ(all[0].sends, 4U);
  EXPECT_EQ(all[0].tries, 2U);
  EXPECT_TRUE(all[0].answered);
  EXPECT_EQ(outbox->body({1, 2}), bytes(20, 2));
  EXPECT_EQ(outbox->reply({1, 2}), bytes(5, 3));
  EXPECT_EQ(outbox->size_bytes(), 25U);
  EXPECT_EQ(all[1].task, (TaskId{~0ULL, ~0ULL}));
}

TEST_F(CloudOutbox, HoldsNoMoreThanItsLimitAndLosesNothingThatIsInIt) {
  const auto outbox = open();
  EXPECT_TRUE(outbox->put({1, 1}, "", 1, bytes(600)));
  EXPECT_FALSE(outbox->put({1, 2}, "", 1, bytes(401)));
  EXPECT_TRUE(outbox->put({1, 3}, "", 1, bytes(400)));
  EXPECT_EQ(outbox->size_bytes(), kLimit);
  EXPECT_EQ(outbox->all().size(), 2U);
  outbox->erase({1, 1});
  EXPECT_TRUE(outbox->put({1, 2}, "", 1, bytes(401)));
}

TEST_F(CloudOutbox, HasEveryTaskThatAProgramPutBeforeItWasKilled) {
  int ready[2];
  ASSERT_EQ(::pipe(ready), 0);
  const pid_t child = ::fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    const auto outbox = open();
    for (std::uint64_t i = 0; i < 20; ++i) {
      if (!outbox->put({1, i}, "", 1, bytes(8))) ::_exit(1);
    }
    static_cast<void>(::write(ready[1], "x", 1));
    ::pause();
    ::_exit(0);
  }
  char x = 0;
  ASSERT_EQ(::read(ready[0], &x, 1), 1);
  ::kill(child, SIGKILL);
  ::waitpid(child, nullptr, 0);
  EXPECT_EQ(open()->all().size(), 20U);
}

TEST_F(CloudOutbox, IsOneRobotsAndOneProgramsAtATime) {
  const auto outbox = open();
  EXPECT_THAT(error_of([&] { static_cast<void>(open()); }),
              HasSubstr("belongs to another program"));
}

TEST_F(CloudOutbox, SaysWhatIsWrongWithAFile) {
  open().reset();
  EXPECT_THAT(error_of([&] { static_cast<void>(open("other")); }),
              HasSubstr("is robot 'r''s, not 'other''s"));
  std::ofstream(folder_ / "text.db") << std::string(4096, 'x');
  EXPECT_THAT(error_of([&] { static_cast<void>(open_outbox(folder_ / "text.db", "r", kLimit)); }),
              HasSubstr("is no outbox, or damaged"));
  EXPECT_THAT(
      error_of([&] { static_cast<void>(open_outbox(folder_ / "no" / "o.db", "r", kLimit)); }),
      HasSubstr("cannot be written"));
}

// 10 min without a link at 10 tasks of 64 KiB a second are 393 MB: six times what it may hold.
TEST(CloudOutage, KeepsTheBoundAndSendsAllThatItTookWhenTheLinkIsBack) {
  constexpr std::uint64_t kBound = 64'000'000;
  const auto outbox = make_memory_outbox(kBound);
  CallerActions out;
  Caller caller(*outbox, {}, Nanos(0), out);
  const Bytes body(64 * 1024);
  std::int64_t taken = 0;
  for (std::uint64_t i = 0; i < 6000; ++i) {
    const Nanos now = std::chrono::milliseconds(100 * i);
    taken += caller.submit({1, i}, "", body, {}, {}, now, out) == Caller::Submission::kTaken;
    ASSERT_LE(outbox->size_bytes(), kBound);
  }
  EXPECT_EQ(taken, static_cast<std::int64_t>(kBound / body.size()));
  EXPECT_EQ(caller.counts().outbox_full, 6000 - taken);
  out.clear();
  caller.link_up(std::chrono::minutes(10), out);
  std::vector<TaskId> published;
  for (const CallerAction& action : out) {
    if (const auto* each = std::get_if<Publish>(&action)) published.push_back(each->task);
  }
  EXPECT_EQ(published.size(), static_cast<std::size_t>(taken));
  for (const TaskId& task : published) {
    caller.replied({.task = task, .worker = "w"}, std::chrono::minutes(11), out);
  }
  EXPECT_EQ(caller.counts().done, taken);
  EXPECT_EQ(outbox->size_bytes(), 0U);
}

}  // namespace
}  // namespace pirt::cloud
