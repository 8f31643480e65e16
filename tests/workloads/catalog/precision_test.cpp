// Layers in bf16 and int8: their error bounds hold for rounded factors and for nothing worse, and
// the cpu backend keeps them or says why it cannot.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <bit>
#include <cmath>

#include "tests/support/optional_backend.h"
#include "tests/workloads/catalog/workload_support.h"
#include "workloads/backends/cpu/cpu_backend.h"
#include "workloads/backends/opencl/opencl_backend.h"
#include "workloads/catalog/catalog.h"
#include "workloads/dnn/dnn.h"
#include "workloads/inputs/pictures/images.h"

namespace pirt {
namespace {

using testing::HasSubstr;

/// To the nearest of 8 bits of mantissa, ties to even.
float to_bf16(float value) {
  const auto bits = std::bit_cast<std::uint32_t>(value);
  return std::bit_cast<float>((bits + 0x7FFFU + ((bits >> 16) & 1U)) & 0xFFFF0000U);
}

float quantized(float value, float scale) { return std::nearbyint(value * scale) / scale; }

void round_weights(Tensor& weights, Precision precision) {
  auto values = weights.as<float>();
  const auto channels = static_cast<std::size_t>(weights.dim(0));
  const std::size_t length = values.size() / channels;
  for (std::size_t c = 0; c < channels; ++c) {
    const auto channel = values.subspan(c * length, length);
    float peak = 0;
    for (const float value : channel) peak = std::max(peak, std::abs(value));
    for (float& value : channel) {
      value = precision == Precision::kBf16 ? to_bf16(value) : quantized(value, 63.0F / peak);
    }
  }
}

/// What a backend without any other error would compute.
Data rounded(Data&& data, const Workload& workload, dnn::ValueRange range) {
  const float scale = (range.low < 0 ? 127.0F : 255.0F) / std::max(-range.low, range.high);
  for (float& value : data.inputs[0].as<float>()) {
    value = workload.precision == Precision::kBf16 ? to_bf16(value) : quantized(value, scale);
  }
  round_weights(data.parameters[0], workload.precision);
  return std::move(data);
}

dnn::ValueRange range_of(const Workload& workload) {
  if (const auto* conv = dynamic_cast<const dnn::Conv2dRelu*>(workload.operation.get())) {
    return conv->input;
  }
  return operation_as<dnn::FullyConnected>(workload).input;
}

std::vector<const Workload*> reduced_layers() {
  auto all = workloads_in_variant("bf16");
  for (const Workload* each : workloads_in_variant("int8")) all.push_back(each);
  return all;
}

TEST(Precision, ConvolutionsAndFullyConnectedLayersHaveBoth) {
  EXPECT_EQ(reduced_layers().size(), 16U);
  EXPECT_EQ(find_workload("conv2@bf16").precision, Precision::kBf16);
  EXPECT_EQ(find_workload("fc8@int8").precision, Precision::kInt8);
  EXPECT_EQ(find_workload("fc8").precision, Precision::kF32);
  EXPECT_EQ(try_find_workload("pool1@int8"), nullptr);
  EXPECT_EQ(try_find_workload("sobel@bf16"), nullptr);
}

TEST(Precision, WeightsCountAsTheyAreStoredAndTensorsStayF32) {
  const auto& plain = find_workload("fc7");
  const auto& bf16 = find_workload("fc7@bf16");
  const auto& int8 = find_workload("fc7@int8");
  constexpr std::int64_t kWeights = 4096 * 4096, kOthers = 3 * 4096 * 4;
  EXPECT_EQ(plain.bytes(), 4 * kWeights + kOthers);
  EXPECT_EQ(bf16.bytes(), 2 * kWeights + kOthers);
  EXPECT_EQ(int8.bytes(), kWeights + kOthers);
  EXPECT_EQ(int8.ops, plain.ops);
  EXPECT_EQ(int8.inputs[0].element, Element::kF32);
  EXPECT_EQ(int8.parameters[0].element, Element::kF32);
}

TEST(Precision, InputsLieInTheCalibratedRangeAndUseIt) {
  const auto images = generated_images(1);
  for (const Workload* workload : workloads_in_variant("int8")) {
    const auto range = range_of(*workload);
    const auto data = workload->make_data({.seed = 4, .images = images.get()});
    const auto [low, high] = std::ranges::minmax(data.inputs[0].as<float>());
    EXPECT_GE(low, range.low) << workload->name;
    EXPECT_LE(high, range.high) << workload->name;
    EXPECT_GT(high - low, (range.high - range.low) / 2) << workload->name;
  }
}

class ReducedLayer : public testing::TestWithParam<std::string> {};

std::vector<std::string> reduced_names() {
  std::vector<std::string> names;
  for (const Workload* each : reduced_layers()) names.push_back(each->name);
  return names;
}

TEST_P(ReducedLayer, BoundHoldsForRoundedFactorsAndForNothingWorse) {
  const Workload& workload = find_workload(GetParam());
  const auto images = generated_images(1);
  const Data data = workload.make_data({.seed = 1, .images = images.get()});
  const auto expected = workload.reference(data);
  const Data fewer_bits = rounded(workload.make_data({.seed = 1, .images = images.get()}), workload,
                                  range_of(workload));
  auto outputs = test::as_outputs(workload, workload.reference(fewer_bits));
  const auto verdict = workload.verify(outputs, expected);
  EXPECT_TRUE(verdict.ok) << verdict.detail;
  EXPECT_GT(verdict.worst_error, 0.0);
  RecordProperty("verdict", verdict.detail);

  const auto& plain = find_workload(GetParam().substr(0, GetParam().find('@')));
  EXPECT_FALSE(plain.verify(outputs, expected).ok) << "f32 has a bound of its own";
  for (float& value : outputs[0].as<float>()) value *= 1.2F;
  EXPECT_FALSE(workload.verify(outputs, expected).ok) << "scales that are wrong";
}

TEST_P(ReducedLayer, CpuBackendKeepsTheBoundOrSaysWhyItHasNone) {
  const Workload& workload = find_workload(GetParam());
  const auto backend = make_cpu_backend();
  const auto support = backend->supports(workload);
  if (!support.ok) {
    EXPECT_THAT(support.reason, HasSubstr("oneDNN"));
    EXPECT_THAT(support.reason, HasSubstr(to_string(workload.precision)));
    GTEST_SKIP() << support.reason;
  }
  const auto device = backend->open({"cpu", {}, "", ""});
  const auto images = generated_images(1);
  for (const std::uint64_t seed : {1U, 2U}) {
    const Data data = workload.make_data({.seed = seed, .images = images.get()});
    const auto kernel = device->prepare(workload, data.parameters);
    auto outputs = make_tensors(workload.outputs);
    kernel->bind(data.inputs, outputs);
    kernel->execute(2);
    const auto verdict = workload.verify(outputs, workload.reference(data));
    EXPECT_TRUE(verdict.ok) << verdict.detail;
    RecordProperty("verdict", verdict.detail);
  }
}

INSTANTIATE_TEST_SUITE_P(Catalog, ReducedLayer, testing::ValuesIn(reduced_names()),
                         [](const auto& test) {
                           std::string name = test.param;
                           std::ranges::replace(name, '@', '_');
                           return name;
                         });

TEST(Precision, CpuBackendKeepsTheBoundOnOddShapes) {
  const auto backend = make_cpu_backend();
  const auto device = backend->open({"cpu", {}, "", ""});
  const auto images = generated_images(1);
  int computed = 0;
  for (const auto& plain : {dnn::make_conv2d_relu("a", {3, 37, 29, 13, 5, 5, 2, 1}),
                            dnn::make_conv2d_relu("b", {16, 8, 8, 24, 1, 1, 1, 0}),
                            dnn::make_conv2d_relu("c", {17, 6, 31, 33, 3, 3, 1, 1}),
                            dnn::make_conv2d_relu("d", {12, 9, 11, 13, 3, 2, 2, 0}),
                            dnn::make_fully_connected("e", 130, 67, dnn::Activation::kDropout),
                            dnn::make_fully_connected("f", 100, 33, dnn::Activation::kSoftmax)}) {
    for (const Precision precision : {Precision::kBf16, Precision::kInt8}) {
      const auto workload = dnn::in_precision(plain, precision).value();
      if (!backend->supports(workload).ok) continue;
      ++computed;
      const Data data = workload.make_data({.seed = 1, .images = images.get()});
      const auto kernel = device->prepare(workload, data.parameters);
      auto outputs = make_tensors(workload.outputs);
      kernel->bind(data.inputs, outputs);
      kernel->execute(1);
      const auto verdict = workload.verify(outputs, workload.reference(data));
      EXPECT_TRUE(verdict.ok) << workload.description << ": " << verdict.detail;
    }
  }
  if (computed == 0) GTEST_SKIP() << "oneDNN has neither bf16 nor int8 for this CPU";
}

TEST(Precision, OpenClComputesInF32AndSaysSo) {
  PIRT_BACKEND_OR_SKIP("opencl")
  const auto backend = make_opencl_backend();
  for (const Workload* workload : reduced_layers()) {
    const auto support = backend->supports(*workload);
    EXPECT_FALSE(support.ok) << workload->name;
    EXPECT_THAT(support.reason, HasSubstr("f32"));
  }
}

}  // namespace
}  // namespace pirt
