#include "workloads/base/system/program_path.h"

#include <gtest/gtest.h>
#include <stdlib.h>

#include <fstream>

namespace pirt::test {
namespace {

namespace fs = std::filesystem;

TEST(ProgramPath, IsOfAFileThatMayBeRunAndOfNoFolder) {
  std::string name = (fs::temp_directory_path() / "pirt-path-XXXXXX").string();
  ASSERT_NE(::mkdtemp(name.data()), nullptr);
  const fs::path folder = name;
  fs::create_directories(folder / "a" / "tool");
  fs::create_directory(folder / "b");
  const fs::path tool = folder / "b" / "tool";
  std::ofstream(tool) << "#!/bin/sh\n";
  const std::string path = ::getenv("PATH");
  ::setenv("PATH", (name + "/a:" + name + "/b").c_str(), 1);
  EXPECT_EQ(try_find_program("tool"), std::nullopt) << "nobody may run it";
  fs::permissions(tool, fs::perms::owner_all);
  EXPECT_EQ(try_find_program("tool"), tool);
  EXPECT_EQ(try_find_program(tool), tool);
  EXPECT_EQ(try_find_program(folder / "a" / "tool"), std::nullopt);
  ::setenv("PATH", path.c_str(), 1);
  fs::remove_all(folder);
}

}  // namespace
}  // namespace pirt::test
