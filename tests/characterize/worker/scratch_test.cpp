#include "characterize/worker/scratch.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include "tests/characterize/profile/database_support.h"
#include "tests/characterize/support.h"

namespace pirt {
namespace {

using test::error_of;
using test::in_child;
using test::write_bytes;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

class Scratch : public testing::Test {
 protected:
  Scratch() { ::setenv("TMPDIR", folder_.path().c_str(), 1); }
  ~Scratch() override { ::unsetenv("TMPDIR"); }

  /// What a run leaves that is killed.
  static void be_killed() {
    const int status = in_child([] {
      const ScratchFolder scratch;
      std::filesystem::create_directory(scratch.path() / "kernels");
      write_bytes(scratch.path() / "kernels/a", "much");
      ::raise(SIGKILL);
    });
    ASSERT_TRUE(WIFSIGNALED(status));
  }

  const test::TemporaryFolder folder_;
};

TEST_F(Scratch, IsGoneWithItsOwner) {
  {
    const ScratchFolder scratch;
    write_bytes(scratch.path() / "a", "something");
    EXPECT_THAT(folder_.entries(), SizeIs(1));
  }
  EXPECT_THAT(folder_.entries(), IsEmpty());
}

TEST_F(Scratch, RemovesWhatAKilledRunLeft) {
  be_killed();
  EXPECT_THAT(folder_.entries(), SizeIs(1));
  const ScratchFolder scratch;
  EXPECT_THAT(folder_.entries(), ElementsAre(scratch.path().filename()));
}

TEST_F(Scratch, LeavesAloneWhatIsInUseOrSomebodyElses) {
  const ScratchFolder first;
  write_bytes(first.path() / "a", "something");
  std::filesystem::create_directory(folder_ / "pirt-scratch-notes2024");
  write_bytes(folder_ / "pirt-scratch-notes2024/lock", "");
  std::filesystem::create_directory(folder_ / "pirt-scratch-abcdef");
  write_bytes(folder_ / "pirt-scratch-abcdef/no-lock", "");
  write_bytes(folder_ / "pirt-scratch-ghijkl", "a file");
  std::filesystem::create_directory_symlink(first.path(), folder_ / "pirt-scratch-mnopqr");
  const auto before = folder_.entries();
  { const ScratchFolder second; }
  EXPECT_EQ(folder_.entries(), before);
  EXPECT_EQ(test::read_bytes(first.path() / "a"), "something");
}

TEST_F(Scratch, NobodyTakesAFolderFromWhoMakesIt) {
  std::vector<pid_t> children;
  for (int i = 0; i < 4; ++i) {
    children.push_back(::fork());
    if (children.back() != 0) continue;
    bool there = true;
    for (int round = 0; round < 100; ++round) {
      const ScratchFolder scratch;
      write_bytes(scratch.path() / "a", "mine");
      const ScratchFolder other;  // which cleans up
      there = there && test::read_bytes(scratch.path() / "a") == "mine";
    }
    ::_exit(there ? 0 : 1);
  }
  for (const pid_t child : children) {
    int status = 0;
    ::waitpid(child, &status, 0);
    EXPECT_EQ(status, 0);
  }
  EXPECT_THAT(folder_.entries(), IsEmpty());
}

TEST_F(Scratch, SaysWhatIsWrongWithItsPlace) {
  write_bytes(folder_ / "file", "");
  for (const auto* place : {"missing", "file"}) {
    ::setenv("TMPDIR", (folder_ / place).c_str(), 1);
    EXPECT_THAT(error_of(ErrorCode::kEnvironment, [] { return ScratchFolder().path(); }),
                AllOf(HasSubstr((folder_ / place).string()), HasSubstr("set TMPDIR")));
  }
}

}  // namespace
}  // namespace pirt
