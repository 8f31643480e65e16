// pirt sample: a figure is of what its cell is called, or there is none.
#include <array>

#include "tests/cli/program.h"

namespace pirt::test {
namespace {

TEST(Sample, OfWhatTheUnitCannotComputeIsAnErrorAndNoFigure) {
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

}  // namespace
}  // namespace pirt::test
