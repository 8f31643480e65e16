// What the digest of a workload file is of where it has a program.
#include <gtest/gtest.h>
#include <stdlib.h>

#include <filesystem>
#include <fstream>
#include <string>

#include "workloads/base/system/program_path.h"
#include "workloads/own/own.h"

namespace pirt::own {
namespace {

namespace fs = std::filesystem;

class DigestOfAProgram : public testing::Test {
 protected:
  DigestOfAProgram() {
    std::string name = (fs::temp_directory_path() / "pirt-digest-XXXXXX").string();
    folder_ = ::mkdtemp(name.data());
  }
  ~DigestOfAProgram() override { fs::remove_all(folder_); }
  fs::path write(const std::string& name, const std::string& text) const {
    std::ofstream(folder_ / name) << text;
    return folder_ / name;
  }
  /// @param command  And what follows it in the file.
  [[nodiscard]] std::string with(const std::string& command) const {
    return digest_of(write(
        "w.yaml",
        "workloads:\n  - name: my.k\n    outputs: {a: \"u8[4]\"}\n    command: " + command + "\n"));
  }
  fs::path folder_;
};

TEST_F(DigestOfAProgram, IsNotOfWhatPathFinds) {
  fs::create_directory(folder_ / "bin");
  fs::permissions(write("bin/tool", "1"), fs::perms::owner_all);
  write("p.py", "1");
  const std::string path = ::getenv("PATH");
  ::setenv("PATH", (folder_ / "bin").c_str(), 1);
  const std::string by_path = with("[tool, p.py]"), by_its_name = with("[bin/tool, p.py]");
  write("bin/tool", "2");
  EXPECT_EQ(with("[tool, p.py]"), by_path) << "it is another one on each machine";
  EXPECT_NE(with("[bin/tool, p.py]"), by_its_name);
  write("p.py", "2");
  EXPECT_NE(with("[tool, p.py]"), by_path);
  ::setenv("PATH", path.c_str(), 1);
}

TEST_F(DigestOfAProgram, IsNotOfWhatItWrites) {
  const std::string logs = "[sh, -c, \"exec ./icp <in.yaml 2>>icp.log\"]";
  const std::string map = "[./slam, --map=map.bin]";
  const std::string writes_map = map + "\n    writes: [./map.bin]";
  for (const char* name : {"in.yaml", "icp.log", "map.bin"}) write(name, "1");
  const std::string of_logs = with(logs), of_map = with(map), without_map = with(writes_map);
  EXPECT_EQ(load(folder_ / "w.yaml").front().digest, without_map);
  for (const char* name : {"icp.log", "map.bin"}) write(name, "2");
  EXPECT_EQ(with(logs), of_logs);
  EXPECT_EQ(with(writes_map), without_map);
  EXPECT_NE(with(map), of_map) << "nobody says that it is written";
  write("in.yaml", "2");
  EXPECT_NE(with(logs), of_logs);
}

TEST_F(DigestOfAProgram, IsOfWhatTheCommandChangesTo) {
  fs::create_directory(folder_ / "build");
  fs::permissions(write("build/icp", "1"), fs::perms::owner_all);
  const std::string command = "[sh, -c, \"cd build && ./icp >icp.log\"]";
  const std::string before = with(command);
  write("build/icp.log", "1");
  EXPECT_EQ(with(command), before);
  write("build/icp", "2");
  EXPECT_NE(with(command), before);
}

TEST_F(DigestOfAProgram, IsOfTheSizeOfALargeFile) {
  const fs::path bag = write("run.bag", "");
  fs::resize_file(bag, kMostHashedBytes + 1);
  const std::string command = "[./slam, --bag=run.bag]";
  const std::string before = with(command);
  std::fstream(bag, std::ios::in | std::ios::out | std::ios::binary) << "x";
  EXPECT_EQ(with(command), before) << "it is not read";
  fs::resize_file(bag, kMostHashedBytes + 2);
  EXPECT_NE(with(command), before);
}

}  // namespace
}  // namespace pirt::own
