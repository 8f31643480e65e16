// Where a program looks for modules.
#include "workloads/base/system/module.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "tests/support/paths.h"

namespace pirt::test {
namespace {

namespace fs = std::filesystem;

TEST(ModuleFolders, HaveTheBuildForProgramsThatLieInIt) {
  const fs::path build = fs::path(kProgram).parent_path();
  const auto within = module_folders(fs::canonical(build) / "below" / "robot");
  EXPECT_EQ(std::ranges::count(within, build), 1);
  const auto installed = module_folders("/opt/robot/bin/robot");
  EXPECT_EQ(std::ranges::count(installed, build), 0) << "it may be somebody else's by then";
  EXPECT_EQ(installed.front(), "/opt/robot/bin");
}

TEST(ModuleFolders, AreNotOfTheCurrentFolderWhereTheProgramIsNotKnown) {
  const auto folders = module_folders(fs::path());
  EXPECT_FALSE(folders.empty());
  for (const fs::path& folder : folders) EXPECT_TRUE(folder.is_absolute()) << folder;
}

TEST(ProgramFiles, HaveTheFileThatTheCodeIsInOnce) {
  const fs::path self = "/proc/self/exe";
  const auto is_self = [&](const fs::path& file) { return fs::equivalent(file, self); };
  const auto own = program_files(self);
  EXPECT_EQ(own.front(), self);
  EXPECT_EQ(std::ranges::count_if(own, is_self), 1);
  // Of another program this code is a library's.
  const auto others = program_files("/bin/sh");
  EXPECT_EQ(others.front(), "/bin/sh");
  EXPECT_EQ(std::ranges::count_if(others, is_self), 1);
}

}  // namespace
}  // namespace pirt::test
