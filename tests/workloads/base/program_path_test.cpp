#include "workloads/base/system/program_path.h"

#include <gtest/gtest.h>
#include <stdlib.h>

#include <fstream>
#include <string>
#include <vector>

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

TEST(FilesNamedByWords, AreFoundWhereverAWordHasThem) {
  std::string made = (fs::temp_directory_path() / "pirt-path-XXXXXX").string();
  ASSERT_NE(::mkdtemp(made.data()), nullptr);
  const fs::path folder = made;
  for (const char* name : {"net.onnx", "icp", "x.yaml", "icp.log"}) {
    std::ofstream(folder / name) << name;
  }
  fs::permissions(folder / "icp", fs::perms::owner_all);
  std::vector<std::string> named;
  const std::vector<std::string> words = {
      "sh",     "-c",       "exec ./icp --model=net.onnx <x.yaml 2>>icp.log",
      "x.yaml", "none.txt", "--net=net.onnx"};
  for (const CommandFile& each : files_named_by(words, folder)) {
    EXPECT_TRUE(fs::is_regular_file(each.file)) << each.file;
    EXPECT_EQ(each.is_program, each.name == "sh" || each.name == "./icp") << each.name;
    named.push_back(each.name);
  }
  EXPECT_EQ(named, (std::vector<std::string>{"sh", "./icp", "net.onnx", "x.yaml"}));
  fs::remove_all(folder);
}

TEST(FilesNamedByWords, AreThoseOfTheFoldersThatTheCommandChangesTo) {
  std::string made = (fs::temp_directory_path() / "pirt-path-XXXXXX").string();
  ASSERT_NE(::mkdtemp(made.data()), nullptr);
  const fs::path folder = made;
  for (const char* each : {"a", "b"}) {
    fs::create_directory(folder / each);
    for (const char* name : {"icp", "x.yaml", "icp.log"}) std::ofstream(folder / each / name) << 1;
    fs::permissions(folder / each / "icp", fs::perms::owner_all);
  }
  const auto named = [&](const std::vector<std::string>& words) {
    std::vector<std::string> names;
    for (const CommandFile& each : files_named_by(words, folder)) {
      if (each.name.find('/') == std::string::npos) continue;  // Some have a program "cd".
      EXPECT_TRUE(fs::equivalent(each.file, folder / each.name)) << each.file;
      EXPECT_EQ(each.is_program, each.name.ends_with("icp")) << each.name;
      names.push_back(each.name);
    }
    return names;
  };
  EXPECT_EQ(named({"-c", "cd a && ./icp <x.yaml >icp.log"}),
            (std::vector<std::string>{"a/./icp", "a/x.yaml"}));
  EXPECT_EQ(named({"-c", "(cd a && ./icp); cd b; cd .; exec ./icp"}),
            (std::vector<std::string>{"a/./icp", "b/./icp"}));
  EXPECT_EQ(named({"-C", "b", "./icp"}), (std::vector<std::string>{"b/./icp"}));
  EXPECT_TRUE(named({"-c", "cd none && ./icp"}).empty());
  fs::remove_all(folder);
}

}  // namespace
}  // namespace pirt::test
