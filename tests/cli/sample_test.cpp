// pirt sample: a figure is of what its cell is called, or there is none.
#include <array>

#include "tests/cli/program.h"
#include "tests/support/optional_backend.h"

namespace pirt::test {
namespace {

TEST(Sample, OfWhatTheUnitCannotComputeIsAnErrorAndNoFigure) {
  PIRT_BACKEND_OR_SKIP("opencl")
  const std::vector<std::array<std::string, 3>> cells = {
      {"fc6@int8", "opencl", "computes AlexNet's layers in f32"},
      {"conv2@map", "opencl", "border around the input"},
      {"sobel@map", "cpu", "nothing to map"}};
  for (const auto& [workload, unit, reason] : cells) {
    const auto outcome = pirt({"sample", "--workload", workload, "--unit", unit, "--work", "1ms"});
    EXPECT_EQ(outcome.exit_code, 4) << outcome.out;
    EXPECT_EQ(outcome.out, "");
    EXPECT_THAT(outcome.err, testing::HasSubstr("'" + workload + "' cannot run on"));
    EXPECT_THAT(outcome.err, testing::HasSubstr(reason));
  }
}

// PoCL without a folder for its compiled kernels has no devices (the folder cannot be made), or
// builds nothing (it is a file).
TEST(Sample, SaysThatPoclCannotWriteItsKernelCache) {
  if (pirt({"list", "backends"}).out.find("pthread") == std::string::npos)
    GTEST_SKIP() << "no PoCL";
  const Scratch scratch;
  for (const std::string& folder : {std::string("/proc/nope"), scratch.write("file", "")}) {
    const auto outcome = pirt({"sample", "--workload", "sobel", "--unit", "opencl"},
                              "POCL_CACHE_DIR=" + quoted(folder));
    EXPECT_EQ(outcome.exit_code, 4);
    EXPECT_THAT(outcome.err, testing::HasSubstr("cannot write its kernel cache '" + folder + "'"));
    EXPECT_THAT(outcome.err, testing::HasSubstr("set POCL_CACHE_DIR"));
  }
  EXPECT_THAT(pirt({"list", "backends"}, "POCL_CACHE_DIR=/proc/nope").out,
              testing::HasSubstr("set POCL_CACHE_DIR"));
}

}  // namespace
}  // namespace pirt::test
