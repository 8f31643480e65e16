// What a device may be asked to compute: the same answer before a run and at the call itself.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "workloads/backends/registry.h"
#include "workloads/catalog/catalog.h"

namespace pirt {
namespace {

std::vector<const Workload*> all_workloads() {
  std::vector<const Workload*> all;
  for (const Workload& workload : catalog()) all.push_back(&workload);
  for (const Variant& variant : variants()) {
    const auto workloads = workloads_in_variant(variant.name);
    all.insert(all.end(), workloads.begin(), workloads.end());
  }
  for (const Workload& workload : workloads_in_batch(8)) all.push_back(&workload);
  return all;
}

/// An open device of each backend.
class Supported : public testing::TestWithParam<std::string> {
 protected:
  Supported() : backend_(find_backend(GetParam())) {
    request_.unit = "unit";
    if (GetParam() == "fake") request_.script = "unsupported: [sobel, fc6@int8]";
    if (backend_.probe().available) device_ = backend_.open(request_);
  }
  void SetUp() override {
    if (!device_) GTEST_SKIP() << "skipped: " << backend_.probe().reason;
  }

  const Backend& backend_;
  UnitRequest request_;
  std::unique_ptr<Device> device_;
};

TEST_P(Supported, OfAnOpenDeviceIsWhatTheBackendSaidOfItsUnit) {
  for (const Workload* workload : all_workloads()) {
    const auto planned = backend_.supports_on(request_, *workload);
    const auto open = device_->supports(*workload);
    EXPECT_EQ(open.ok, planned.ok) << workload->name;
    EXPECT_EQ(open.reason, planned.reason) << workload->name;
  }
}

TEST_P(Supported, IsAskedByWhoeverPreparesAKernel) {
  int refused = 0;
  for (const Workload* workload : all_workloads()) {
    const auto support = device_->supports(*workload);
    if (support.ok) continue;
    ++refused;
    try {
      static_cast<void>(device_->prepare(*workload, {}));
      ADD_FAILURE() << workload->name << " is prepared all the same";
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::kEnvironment);
      EXPECT_THAT(error.what(), testing::HasSubstr("'" + workload->name + "' cannot run on"));
      EXPECT_THAT(error.what(), testing::HasSubstr(support.reason));
    }
  }
  EXPECT_GT(refused, 0);
}

TEST_P(Supported, RefusesAKernelThatIsInNoTable) {
  if (GetParam() == "fake") GTEST_SKIP() << "computes nothing";
  Workload unknown = find_workload("sobel");
  unknown.kernel = "trace_rays";
  EXPECT_THROW(static_cast<void>(device_->prepare(unknown, {})), Error);
}

// A kernel reads as much of its parameters as its workload says.
TEST_P(Supported, RefusesParametersThatAreAnothersWorkloads) {
  const Workload& conv3 = find_workload("conv3");
  for (const char* const other : {"conv5", "fc8", "gaussian_blur"}) {
    const auto parameters = make_tensors(find_workload(other).parameters);
    try {
      static_cast<void>(device_->prepare(conv3, parameters));
      ADD_FAILURE() << "prepared with those of " << other;
    } catch (const Error& error) {
      EXPECT_STREQ(error.what(), "'conv3' was given parameters that are not its own");
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Backends, Supported, testing::Values("cpu", "opencl", "fake"),
                         [](const auto& test) { return test.param; });

TEST(OperationAs, RefusesAnotherTypeInEveryBuild) {
  struct Other : Operation {};
  EXPECT_THROW(static_cast<void>(operation_as<Other>(find_workload("sobel"))), std::logic_error);
}

}  // namespace
}  // namespace pirt
