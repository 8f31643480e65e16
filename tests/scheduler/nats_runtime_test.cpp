// The library's units elsewhere: what is out of reach is known before the first task.
#include "scheduler/runtime/runtime.h"
#include "tests/scheduler/support.h"
#include "workloads/catalog/catalog.h"
#include "workloads/inputs/pictures/images.h"

namespace pirt::test {
namespace {

// Each try there would hold a task up until a call has waited for the way.
TEST(RuntimeElsewhere, GivesNothingToWhatIsOutOfReachFromTheBeginning) {
  RuntimeOptions options;
  options.platform = parse_platform("test.yaml", R"(
platform: test
units:
  cpu: {backend: cpu, cores: all, slots: 1, active_w: 1}
  cloud: {role: cloud, backend: nats, server: "nats://127.0.0.1:1", active_w: 1}
)",
                                    {}, 2);
  options.workloads = {"pool5"};
  options.mode = "advanced";
  Runtime runtime(std::move(options));
  const auto images = generated_images(1);
  const Data data = find_workload("pool5").make_data({.seed = 1, .images = images.get()});
  std::vector<TaskInput> inputs(data.inputs.begin(), data.inputs.end());
  const auto task = runtime.submit("pool5", std::move(inputs));
  EXPECT_EQ(task.wait(), TaskEnd::kCompleted);
  const RuntimeStatistics statistics = runtime.statistics();
  EXPECT_EQ(statistics.completed, 1);
  EXPECT_EQ(statistics.returned, 0) << "it was tried in the cloud first";
}

}  // namespace
}  // namespace pirt::test
