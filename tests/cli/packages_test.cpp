// cli/packages.sh, as the demo and the tests source it.
#include <filesystem>

#include "tests/cli/program.h"

namespace pirt::test {
namespace {

namespace fs = std::filesystem;

/// What @p commands print, which have the script's functions; $1 is @p argument.
std::string said(const std::string& commands, const std::string& argument = "") {
  const auto outcome =
      run("bash -euo pipefail -c '. \"$0\"; " + commands + "' " +
          quoted(std::string(kSourceFolder) + "/cli/packages.sh") + " " + quoted(argument));
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  return outcome.out;
}

TEST(Packages, CountTheMemoryThatControlGroupsLeave) {
  const Scratch scratch;
  const auto write = [&](const std::string& name, const std::string& text) {
    fs::create_directories(fs::path(scratch.file(name)).parent_path());
    scratch.write(name, text + "\n");
  };
  const auto free_kb = [&] { return said("free_memory \"$1\"", scratch.file("")); };
  write("proc/meminfo", "MemTotal:       9000000 kB\nMemAvailable:   8000000 kB");
  EXPECT_EQ(free_kb(), "8000000\n") << "a machine without control groups";
  // A container's, in which that of the build has no limit: 4,096,000 B - 2,048,000 B = 2000 kB.
  write("proc/self/cgroup", "0::/container/build");
  write("sys/fs/cgroup/container/memory.max", "4096000");
  write("sys/fs/cgroup/container/memory.current", "2048000");
  write("sys/fs/cgroup/container/build/memory.max", "max");
  write("sys/fs/cgroup/container/build/memory.current", "1024");
  EXPECT_EQ(free_kb(), "2000\n");
  write("sys/fs/cgroup/container/memory.stat", "anon 5\ninactive_file 1024000");
  EXPECT_EQ(free_kb(), "3000\n") << "with 1000 kB of files that can be read again";
  // The first version, whose folder in the container is the root.
  write("proc/self/cgroup", "5:cpu:/a\n4:memory:/docker/b");
  write("sys/fs/cgroup/memory/memory.limit_in_bytes", "2048000");
  write("sys/fs/cgroup/memory/memory.usage_in_bytes", "1024000");
  EXPECT_EQ(free_kb(), "1000\n");
}

TEST(Packages, AreTriedInTheReleaseOfDebianThatTheyAreBuiltOn) {
  const Scratch scratch;
  fs::create_directories(scratch.file("etc"));
  const auto release = [&](const std::string& text) {
    scratch.write("etc/os-release", text);
    return said("debian_release \"$1\" 2>&1 || echo $?", scratch.file(""));
  };
  EXPECT_EQ(release("VERSION_CODENAME=trixie\nID=debian\n"), "trixie\n");
  EXPECT_EQ(release("VERSION_CODENAME=noble\nID=ubuntu\n"), "skipped: this is not Debian\n77\n");
}

TEST(Packages, AreInstalledIfThoseOfThisArchitectureAre) {
  const auto answer = [](const std::string& states) {
    return said(
        "states=$1; dpkg() { echo arm64; }; dpkg-query() { printf %s \"$states\"; }; "
        "apt-get() { :; }; env() { :; }; sudo() { :; }; install_packages one",
        states);
  };
  EXPECT_EQ(answer("amd64 installed\narm64 installed\n"), "== packages: all 1 installed\n");
  EXPECT_EQ(answer("all installed\n"), "== packages: all 1 installed\n");
  EXPECT_EQ(answer("amd64 installed\narm64 config-files\n"), "== packages: installing one\n");
}

// As where a mirror fails, or a release has not what one of them needs.
TEST(Packages, OfAStageThatAreNotThereLeaveTheOtherStages) {
  const Scratch scratch;
  for (const char* const folder : {"bin", "cli", "tests"}) {
    fs::create_directory(scratch.file(folder));
  }
  for (const char* const script : {"cli/packages.sh", "tests/run.sh"}) {
    fs::copy_file(fs::path(kSourceFolder) / script, scratch.file(script));
  }
  scratch.write("tests/stages.sh",
                "debian_release() { echo trixie; }\n"
                "stage first . nosuch 'a stage' true\n"
                "stage second . 'there clang-14' 'a stage' true\n"
                "stage third . there 'a stage' true\n");
  for (const auto& [name, script] :
       {std::pair("apt-get", "exit 100"),
        {"sudo", "exec \"$@\""},
        {"dpkg-query", "case $* in *there) echo all installed ;; *) exit 1 ;; esac"}}) {
    const auto stub =
        scratch.write(std::string("bin/") + name, "#!/bin/sh\n" + std::string(script));
    fs::permissions(stub, fs::perms::owner_all);
  }
  const auto outcome = run("GIT_DIR=/nowhere PATH=" + quoted(scratch.file("bin")) + ":$PATH bash " +
                           quoted(scratch.file("tests/run.sh")) + " --long");
  EXPECT_EQ(outcome.exit_code, 1) << outcome.err;
  EXPECT_THAT(outcome.out, testing::HasSubstr("first: FAILED, its packages"));
  EXPECT_THAT(outcome.out, testing::HasSubstr("second: SKIPPED, clang 14"));
  EXPECT_THAT(outcome.out, testing::HasSubstr("third: passed"));
  EXPECT_THAT(outcome.out, testing::EndsWith("tests: FAILED: first\n"));
}

TEST(Packages, BuildAllTargetsThatAreNamed) {
  EXPECT_THAT(said("cmake() { printf \"<%s>\" \"$@\"; }; "
                   "PIRT_TARGET=\"pirt pirt_manual\" build_pirt folder"),
              testing::HasSubstr("<--target><pirt><pirt_manual>"));
}

}  // namespace
}  // namespace pirt::test
