// Where calls can be left: as often as the workload's spec says, and with the same bits whether
// somebody computes something else there or not.
#include "workloads/model/slices.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <memory>
#include <numeric>
#include <string>
#include <thread>
#include <vector>

#include "tests/workloads/catalog/workload_support.h"
#include "workloads/backends/cpu/cpu_backend.h"
#include "workloads/base/time.h"
#include "workloads/catalog/catalog.h"
#include "workloads/catalog/specs.h"
#include "workloads/dnn/dnn.h"

namespace pirt {
namespace {

class Listener final : public SliceListener {
 public:
  explicit Listener(std::function<void()> body = {}) : body_(std::move(body)) {}
  void slice_ended() override {
    ++ended_;
    if (body_) body_();
  }
  [[nodiscard]] int ended() const { return ended_; }

 private:
  std::function<void()> body_;
  int ended_ = 0;
};

TEST(Slices, AreHeardOfByTheInnermostListenerOfTheThread) {
  EXPECT_FALSE(are_slices_heard());
  between_slices();
  Listener outer;
  {
    const HearsSlices hears(&outer);
    EXPECT_TRUE(are_slices_heard());
    between_slices();
    Listener inner;
    {
      const HearsSlices nested(&inner);
      between_slices();
      const HearsSlices nobody(nullptr);
      EXPECT_FALSE(are_slices_heard());
      between_slices();
    }
    between_slices();
    EXPECT_EQ(inner.ended(), 1);
  }
  between_slices();
  EXPECT_EQ(outer.ended(), 2);
}

struct Prepared {
  std::unique_ptr<Kernel> kernel;
  Data data;
  std::vector<Tensor> outputs;

  Prepared(Device& device, const Workload& workload)
      : data(test::data_of_seed_1(workload)), outputs(make_tensors(workload.outputs)) {
    kernel = device.prepare(workload, data.parameters);
    kernel->bind(data.inputs, outputs);
    static_cast<void>(kernel->execute(1));
  }
};

class SlicedWorkload : public testing::TestWithParam<const char*> {};

/// On a thread of its own, since a device binds the thread that opens it.
std::string leave_everywhere(const std::string& name) {
  const auto device = make_cpu_backend()->open({"cpu", {0}, "", ""});
  const Workload& workload = find_workload(name);
  Prepared sliced(*device, workload);
  const auto whole = copy_tensors(sliced.outputs);
  Prepared other(*device, find_workload("conv2"));
  const auto shares = try_find_spec(name)->slices;
  EXPECT_NEAR(std::accumulate(shares.begin(), shares.end(), 0.0), 1, 1e-9);
  const MachineClock clock;
  std::vector<Nanos> slices;
  Nanos since = clock.now();
  Listener listener([&] {
    slices.push_back(clock.now() - since);
    const HearsSlices nobody(nullptr);
    static_cast<void>(other.kernel->execute(1));
    since = clock.now();
  });
  const HearsSlices hears(&listener);
  static_cast<void>(sliced.kernel->execute(1));
  slices.push_back(clock.now() - since);
  // How often a solver goes round depends a little on the machine.
  EXPECT_NEAR(static_cast<double>(slices.size()), static_cast<double>(shares.size()),
              name == "bundle_adjust" ? 4 : 0);
  for (std::size_t i = 0; i < whole.size(); ++i) {
    EXPECT_EQ(sliced.outputs[i].rows(), whole[i].rows());
    EXPECT_TRUE(std::ranges::equal(sliced.outputs[i].used_bytes(), whole[i].used_bytes()));
  }
  const Nanos sum = std::accumulate(slices.begin(), slices.end(), Nanos(0));
  std::string text;
  for (std::size_t i = 0; i < slices.size(); ++i) {
    fmt::format_to(std::back_inserter(text), " {:.2f} ms ({:.3f})", to_ms(slices[i]),
                   to_s(slices[i]) / to_s(sum));
  }
  return text;
}

TEST_P(SlicedWorkload, IsLeftAsItsSpecSaysAndComputesTheSameBits) {
  std::string text;
  std::jthread([&] { text = leave_everywhere(GetParam()); }).join();
  RecordProperty("slices", text);
}

INSTANTIATE_TEST_SUITE_P(Catalog, SlicedWorkload,
                         testing::Values("alexnet", "bundle_adjust", "describe_scene"),
                         [](const auto& param) { return std::string(param.param); });

// conv1, its pool, conv2 by quarters, its pool, conv3 to conv5 by halves, their pool, fc6 by
// eighths, fc7 by quarters, fc8. None has more than its part of the operations or bytes.
TEST(Slices, OfAlexNetArePartsOfItsLayers) {
  const Workload& alexnet = find_workload("alexnet");
  std::vector<int> parts;
  for (const Workload& layer : operation_as<dnn::Sequence>(alexnet).layers) {
    parts.push_back(dnn::parts_of(layer, 1));
    EXPECT_EQ(dnn::parts_of(layer, 8), 1) << layer.name;
  }
  EXPECT_EQ(parts, (std::vector<int>{1, 1, 4, 1, 2, 2, 2, 1, 8, 4, 1}));
  const auto shares = dnn::slices_of(alexnet);
  EXPECT_EQ(shares.size(), 27U);
  EXPECT_LT(std::ranges::max(shares), 0.075);
  EXPECT_EQ(dnn::slices_of(find_workload("alexnet@batch8")).size(), 11U);
  EXPECT_TRUE(dnn::slices_of(find_workload("conv2")).empty()) << "no chain";
  EXPECT_TRUE(try_find_spec("plan_path")->slices.empty());
}

}  // namespace
}  // namespace pirt
