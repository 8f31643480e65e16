// tests/bench/gpu, with programs that stand in for pirt's.
#include <filesystem>

#include "tests/cli/program.h"

namespace pirt::test {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

class GpuScript : public testing::Test {
 protected:
  GpuScript() {
    fs::create_directories(scratch_.file("build/tests/bench"));
    program("pirt", "echo pirt icd=$OCL_ICD_VENDORS \"$@\" >>" + log() +
                        "\n[ $1 != doctor ] || echo 'gpu driver  note  a board of NVIDIA'\n" +
                        kBatches + "echo \"{\\\"device\\\": \\\"${DEVICE-a board}\\\"}\"");
    program("tests/workloads_test",
            "case $1 in --gtest_list_tests) echo '  OfAll' ;;\n"
            "*) echo tests tuning=${PIRT_TEST_TUNING-none} \"$@\" >>" +
                log() + " ;; esac");
    for (const char* bench : {"kernels", "device"})
      program(std::string("tests/bench/") + bench, ":");
  }
  void program(const std::string& name, const std::string& lines) const {
    const auto path = scratch_.write("build/" + name, "#!/bin/sh\n" + lines + "\n");
    fs::permissions(path, fs::perms::owner_all);
  }
  [[nodiscard]] std::string log() const { return quoted(scratch_.file("log")); }
  [[nodiscard]] std::string logged() const { return slurp(scratch_.file("log")); }
  /// @param environment  As env(1) takes it.
  [[nodiscard]] Outcome script(const std::string& environment, const std::string& arguments) const {
    return run("env -u OCL_ICD_VENDORS BUILD=" + quoted(scratch_.file("build")) + " " +
               environment + " " + quoted(std::string(kSourceFolder) + "/tests/bench/gpu") + " " +
               arguments);
  }
  /// The same: libraries of the caller's, and a Python that logs which it is given.
  [[nodiscard]] std::string with_python() const {
    fs::create_directories(scratch_.file("bin"));
    const auto path = scratch_.write(
        "bin/python3", "#!/bin/sh\necho python $LD_LIBRARY_PATH >>" + log() + "\nexit 1\n");
    fs::permissions(path, fs::perms::owner_all);
    return "LD_LIBRARY_PATH=/the/drivers PATH=" + quoted(scratch_.file("bin")) + ":\"$PATH\"";
  }
  /// Of a profile's table.
  static constexpr const char* kBatches =
      "[ $1 != characterize ] || printf '%s@batch64  opencl  1.23\\n' pool1 alexnet\n";

  const Scratch scratch_;
};

TEST_F(GpuScript, RunsWhereWhatItPackedIsUnpacked) {
  if (run("command -v xz && command -v ldd").exit_code != 0)
    GTEST_SKIP() << "skipped: no xz or ldd";
  // A library that is not the machine's own comes with it: the shell's, which edits lines.
  ASSERT_EQ(run("cp -L \"$(command -v bash)\" " + quoted(scratch_.file("build/libpirt_some.so")))
                .exit_code,
            0);
  const auto archive = quoted(scratch_.file("gpu.tar.xz"));
  const auto packed = script("", "pack " + archive);
  ASSERT_EQ(packed.exit_code, 0) << packed.err;
  const auto there = scratch_.file("there");
  const auto outcome =
      run("mkdir " + quoted(there) + " && tar -xJf " + archive + " -C " + quoted(there) +
          " && env -u BUILD " + with_python() + " " + quoted(there + "/pirt-gpu/tests/bench/gpu"));
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err << outcome.out;
  EXPECT_THAT(outcome.out, AllOf(HasSubstr("== device: a board"), HasSubstr("== done: ")));
  EXPECT_THAT(logged(), HasSubstr("python /the/drivers\n"));
}

TEST_F(GpuScript, VerifiesWhatItTimes) {
  const auto out = quoted(scratch_.file("out"));
  const auto outcome = script("PIRT_TUNING=/the/board.json", "0 " + out);
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err << outcome.out;
  EXPECT_THAT(logged(), AllOf(HasSubstr("tests tuning=/the/board.json"),
                              HasSubstr("meter=none --filter ^(pool1|alexnet)@batch64$"),
                              HasSubstr(" doctor --platform ")))
      << "the kernels of its parameters, and those of batches; and what would spoil it";
  // What it says of its batches.
  const auto says = [&](const std::string& table, const std::string& json) {
    program("pirt", table +
                        "while [ $# -gt 1 ] && [ $1 != --json ]; do shift; done\n"
                        "[ $1 != --json ] || [ $2 = - ] || echo '" +
                        json +
                        "' >$2\n"
                        "echo '{\"device\": \"a board\"}'");
    const auto wrong = script("", "0 " + out);
    EXPECT_EQ(wrong.exit_code, 1) << table << json;
    return wrong.out;
  };
  EXPECT_THAT(says(kBatches, "wrong_output"), HasSubstr("FAILED: a batch is wrong or did not run"));
  EXPECT_THAT(says(kBatches, "\"error: worker crashed\""),
              HasSubstr("FAILED: a batch is wrong or did not run"));
  EXPECT_THAT(says("echo 'pool1@batch64  opencl  1.23'\n", "\"workload\": \"alexnet@batch64\""),
              AllOf(HasSubstr("FAILED: alexnet@batch64 was not measured"),
                    Not(HasSubstr("FAILED: pool1@batch64"))))
      << "named among those that were not reached";
}

TEST_F(GpuScript, LetsEachProgramHaveItsLibraries) {
  static_cast<void>(script(with_python(), "0 " + quoted(scratch_.file("out"))));
  EXPECT_THAT(logged(), HasSubstr("python /the/drivers\n"));
}

TEST_F(GpuScript, HasTenMinutesAtMost) {
  const auto limits = run("awk '$1 == \"step\" && $2 != \"tune\" {all += $3} END {print all}' " +
                          quoted(std::string(kSourceFolder) + "/tests/bench/gpu"));
  EXPECT_LE(std::stoi(limits.out), 600) << limits.err;
}

TEST_F(GpuScript, NamesTheDriverOfABoardThatNoFileNames) {
  if (run("grep -qs nvidia-opencl /etc/OpenCL/vendors/*.icd").exit_code == 0) {
    GTEST_SKIP() << "skipped: this machine has such a file";
  }
  const auto out = scratch_.file("out");
  const auto refused =
      script("NVIDIA_BOARD=/dev/null DEVICE='unavailable: no board'", "0 " + quoted(out));
  EXPECT_EQ(refused.exit_code, 4);
  EXPECT_THAT(refused.err, AllOf(HasSubstr("gpu: unavailable: no board"),
                                 HasSubstr("gpu driver  note  a board of NVIDIA")));
  EXPECT_THAT(logged(), HasSubstr("icd=" + out + "/icd list units"));
  EXPECT_EQ(slurp(out + "/icd/nvidia.icd"), "libnvidia-opencl.so.1\n");
  fs::remove(scratch_.file("log"));
  static_cast<void>(script("NVIDIA_BOARD=/none", "0 " + quoted(out)));
  EXPECT_THAT(logged(), AllOf(HasSubstr("icd= list units"), Not(HasSubstr("/icd list"))));
}

}  // namespace
}  // namespace pirt::test
