// A busy neighbour: begins, ends, and says why it cannot.
#include "characterize/worker/neighbour.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <thread>

#include "characterize/platform/platform.h"
#include "characterize/worker/worker.h"
#include "workloads/base/error.h"
#include "workloads/catalog/own_list.h"
#include "workloads/model/function_kernel.h"
#include "workloads/own/definition.h"

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

// Beside two neighbours ten calls each of 2 ms take no quarter of 10 s, and half of 80 ms.
TEST(Neighbour, IsNotThereForCallsThatTakeTooLong) {
  own::Definition definition;
  definition.name = "my.slow";
  definition.outputs = {own::tensor_from("out", "u8[4]")};
  definition.backends = {"cpu"};
  definition.functions = [](own::Size) {
    return own::Functions{.cpu = [](std::span<const Tensor>, int) {
      return std::make_unique<FunctionKernel>([](std::span<const Tensor>, std::span<Tensor>) {
        std::this_thread::sleep_for(std::chrono::milliseconds(2));
      });
    }};
  };
  std::vector<Workload> one;
  one.push_back(own::to_workload(definition));
  make_known(std::move(one));
  Job job;
  job.kind = JobKind::kSample;
  job.backend = "cpu";
  job.workload = "my.slow";
  job.sampling.warm_up = job.sampling.slice = Nanos(0);
  job.sampling.condition_samples = 10;
  job.neighbours.assign(2, {usable_cores().back()});
  for (const bool too_long : {false, true}) {
    job.sampling.limit = std::chrono::milliseconds(too_long ? 80 : 10'000);
    const JobResult result = do_job(job);
    EXPECT_FALSE(result.phases.empty());
    EXPECT_EQ(std::ranges::count(result.conditions, Condition::kBesideMemory,
                                 &ConditionSamples::condition),
              too_long ? 0 : 1);
  }
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
