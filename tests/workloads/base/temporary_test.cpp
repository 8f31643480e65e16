// What an output is until it is complete, and what is removed of processes that are gone.
#include "workloads/base/system/temporary.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <fstream>

#include "tests/support/errors.h"
#include "workloads/base/text/text.h"

namespace pirt::test {
namespace {

namespace fs = std::filesystem;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;

class Temporary : public testing::TestWithParam<TemporaryFile::Name> {
 protected:
  Temporary() {
    std::string name = (fs::temp_directory_path() / "pirt-temporary-XXXXXX").string();
    if (::mkdtemp(name.data()) == nullptr) std::abort();
    folder_ = name;
  }
  ~Temporary() override { fs::remove_all(folder_); }

  [[nodiscard]] std::vector<std::string> names() const {
    std::vector<std::string> found;
    for (const auto& entry : fs::directory_iterator(folder_)) {
      found.push_back(entry.path().filename());
    }
    std::ranges::sort(found);
    return found;
  }
  [[nodiscard]] fs::path target() const { return folder_ / "out"; }

  /// Runs @p work in a process that is then killed.
  template <typename Work>
  static void killed(const Work& work) {
    const pid_t child = ::fork();
    if (child == 0) {
      work();
      ::kill(::getpid(), SIGKILL);
    }
    int status = 0;
    ::waitpid(child, &status, 0);
    ASSERT_TRUE(WIFSIGNALED(status));
  }

  fs::path folder_;
};

TEST_P(Temporary, AppearsWhenItIsCompleteAndNotBefore) {
  write_file(target(), "old");
  {
    TemporaryFile file(target(), GetParam());
    file.write("half");
  }
  EXPECT_EQ(read_file(target()), "old");
  TemporaryFile file(target(), GetParam());
  TemporaryFile second(target(), GetParam());
  file.write("new");
  second.write(std::string(300'000, 'x'));
  file.append(second);
  EXPECT_EQ(read_file(target()), "old");
  file.publish();
  EXPECT_EQ(read_file(target()), "new" + std::string(300'000, 'x'));
}

TEST_P(Temporary, LeavesNothingBeside) {
  { TemporaryFile(target(), GetParam()).write("x"); }
  EXPECT_THAT(names(), IsEmpty());
  { TemporaryFile(target(), GetParam()).publish(); }
  { TemporaryFile(target(), GetParam()).publish(); }
  EXPECT_THAT(names(), ElementsAre("out"));
}

TEST_P(Temporary, LetsAnotherFileStayIfItIsToBeNew) {
  TemporaryFile first(target(), GetParam());
  first.write("first");
  first.publish_if_new();
  {
    TemporaryFile second(target(), GetParam());
    second.write("second");
    second.publish_if_new();
  }
  EXPECT_EQ(read_file(target()), "first");
}

TEST_P(Temporary, OfAKilledProcessGoesWithTheNext) {
  killed([&] { TemporaryFile(target(), GetParam()).write("x"), ::kill(::getpid(), SIGKILL); });
  EXPECT_THAT(names(), SizeIs(GetParam() == TemporaryFile::Name::kAlways ? 1 : 0));
  remove_left_beside(target());
  EXPECT_THAT(names(), IsEmpty());
}

TEST_P(Temporary, OfALivingProcessStays) {
  TemporaryFile file(target(), GetParam());
  file.write("x");
  killed([&] { remove_left_beside(target()); });
  file.publish();
  EXPECT_EQ(read_file(target()), "x");
}

TEST_P(Temporary, SaysWhereNothingCanBeWritten) {
  EXPECT_THAT(bad_input([&] { TemporaryFile(folder_ / "no" / "x", GetParam()); }),
              HasSubstr("no/x': No such file"));
}

INSTANTIATE_TEST_SUITE_P(Files, Temporary,
                         testing::Values(TemporaryFile::Name::kNoneIfPossible,
                                         TemporaryFile::Name::kAlways));

using TemporaryFolders = Temporary;

TEST_F(TemporaryFolders, TakeTheTargetsNameOrGo) {
  { const TemporaryFolder dropped(target()); }
  EXPECT_THAT(names(), IsEmpty());
  fs::create_directory(target());
  {
    TemporaryFolder made(target());
    write_file(made.path() / "a", "x");
    made.publish();
  }
  EXPECT_THAT(names(), ElementsAre("out"));
  EXPECT_EQ(read_file(target() / "a"), "x");
  TemporaryFolder second(target());
  EXPECT_THAT(bad_input([&] { second.publish(); }), HasSubstr("not empty"));
}

TEST_F(TemporaryFolders, OfAKilledProcessGoWithTheNextAndNoOther) {
  killed([&] {
    const TemporaryFolder left(target());
    write_file(left.path() / "a", "x");
    ::kill(::getpid(), SIGKILL);
  });
  EXPECT_THAT(names(), SizeIs(1));
  const TemporaryFolder living(target());
  const TemporaryFolder others(folder_ / "out2");
  killed([&] { remove_left_beside(target()); });
  EXPECT_TRUE(fs::exists(living.path()));
  EXPECT_TRUE(fs::exists(others.path()));
  EXPECT_THAT(names(), SizeIs(2));
}

TEST_F(TemporaryFolders, OfUsersStay) {
  for (const auto* name : {"out.tmp12", "out.partial", "out.pirt-tmp-", "out.pirt-tmp-a"}) {
    write_file(folder_ / name, "mine");
  }
  remove_left_beside(target());
  EXPECT_THAT(names(), SizeIs(4));
}

}  // namespace
}  // namespace pirt::test
