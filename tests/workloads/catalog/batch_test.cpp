// Several images a call: names, sizes, and both backends against the plain reference of each image.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <thread>

#include "tests/support/few_threads.h"
#include "tests/workloads/backends/opencl/opencl_device_support.h"
#include "tests/workloads/catalog/workload_support.h"
#include "workloads/backends/cpu/cpu_backend.h"
#include "workloads/base/error.h"
#include "workloads/catalog/catalog.h"
#include "workloads/dnn/dnn.h"
#include "workloads/inputs/pictures/images.h"

namespace pirt {
namespace {

std::vector<Workload> small_batches(int batch) {
  const dnn::ConvShape odd{
      .in_c = 5, .in_h = 7, .in_w = 6, .out_c = 17, .k_h = 3, .k_w = 3, .pad = 1};
  const dnn::ConvShape pixel{.in_c = 3, .in_h = 1, .in_w = 1, .out_c = 3, .k_h = 1, .k_w = 1};
  using dnn::Activation;
  return {dnn::batched(dnn::make_conv2d_relu("odd", odd), batch),
          dnn::batched(dnn::make_conv2d_relu("pixel", pixel), batch),
          dnn::batched(dnn::make_max_pool("pool", 3, 7, 5, 3, 2), batch),
          dnn::batched(dnn::make_fully_connected("fc", 301, 19, Activation::kDropout), batch),
          dnn::batched(dnn::make_fully_connected("soft", 37, 33, Activation::kSoftmax), batch)};
}

TEST(Batch, CountsOperationsOfAllImagesAndWeightsOnce) {
  const Workload& one = find_workload("fc6");
  const Workload& eight = find_workload("fc6@batch8");
  EXPECT_EQ(eight.batch, 8);
  EXPECT_EQ(eight.ops, 8 * *one.ops);
  EXPECT_EQ(eight.inputs[0].shape, (std::vector<std::int64_t>{8, 9216}));
  EXPECT_EQ(eight.bytes(), one.bytes() + 7 * 4 * (9216 + 4096));
  EXPECT_EQ(&eight, &find_workload("fc6@batch8")) << "whoever asks may keep the pointer";
  for (const char* name :
       {"fc6@batch1", "fc6@batch257", "fc6@batch", "fc6@batch8x", "sobel@batch2"})
    EXPECT_EQ(try_find_workload(name), nullptr) << name;
  EXPECT_THROW(static_cast<void>(workloads_in_batch(1)), Error);
}

TEST(Batch, BothBackendsComputeEachImageAsThePlainReference) {
  const auto cpu =
      make_cpu_backend()->open({.unit = "cpu", .cores = {}, .device = "", .script = ""});
  const auto opencl = test::open_first_device();
  for (const int batch : {2, 3, 7}) {
    for (const Workload& workload : small_batches(batch)) {
      const Verdict on_cpu = test::run_and_verify(*cpu, workload, 2);
      EXPECT_TRUE(on_cpu.ok) << workload.description << ": " << on_cpu.detail;
      if (!opencl) continue;
      const Verdict on_opencl = test::run_and_verify(*opencl, workload, 2);
      EXPECT_TRUE(on_opencl.ok) << workload.description << ": " << on_opencl.detail;
    }
  }
}

TEST(Batch, SaysThatAThreadCannotStart) {
  if (std::thread::hardware_concurrency() < 2) GTEST_SKIP() << "needs no threads on one core";
  const Workload workload = small_batches(3)[3];
  const auto images = generated_images(1);
  const auto data = workload.make_data({.seed = 1, .images = images.get()});
  EXPECT_EQ(test::with_threads(0, [&] { static_cast<void>(workload.reference(data)); }),
            "cannot start a thread");
}

TEST(Batch, AnExchangedImageIsRefused) {
  const Workload workload = small_batches(2)[3];
  const auto images = generated_images(1);
  const auto expected = workload.reference(workload.make_data({.seed = 1, .images = images.get()}));
  const auto other = workload.reference(workload.make_data({.seed = 2, .images = images.get()}));
  std::vector<Tensor> outputs = make_tensors(workload.outputs);
  std::ranges::copy(other[0].as<double>(), outputs[0].as<float>().begin());
  EXPECT_FALSE(workload.verify(outputs, expected).ok);
}

}  // namespace
}  // namespace pirt
