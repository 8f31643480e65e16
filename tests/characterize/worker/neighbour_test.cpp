// A busy neighbour: begins, ends, and says why it cannot.
#include "characterize/worker/neighbour.h"

#include <gtest/gtest.h>

#include "characterize/platform/platform.h"
#include "workloads/base/error.h"

namespace pirt {
namespace {

TEST(Neighbour, IsAtItUntilItGoes) {
  const std::vector<int> core = {usable_cores().back()};
  for (const auto work : {Neighbour::Work::kStreams, Neighbour::Work::kComputes}) {
    const Neighbour neighbour(core, work);
  }
}

TEST(Neighbour, SaysThatACoreIsNotThere) {
  EXPECT_THROW(Neighbour({usable_cores().front(), 4095}, Neighbour::Work::kComputes), Error);
}

TEST(Platform, NeighboursAreThoseOfTheSameMemory) {
  const Platform platform = parse_platform("p.yaml", R"(
platform: p
units:
  cpu: {backend: cpu, memory: dram}
  gpu: {backend: opencl, memory: dram}
  card: {backend: opencl, memory: vram}
  cloud: {}
)",
                                           {}, 2);
  const auto of = platform.neighbours(platform.unit("cpu"));
  ASSERT_EQ(of.size(), 1U);
  EXPECT_EQ(of[0]->name, "gpu");
  EXPECT_TRUE(platform.neighbours(platform.unit("card")).empty());
  EXPECT_TRUE(platform.neighbours(platform.unit("cloud")).empty());
}

}  // namespace
}  // namespace pirt
