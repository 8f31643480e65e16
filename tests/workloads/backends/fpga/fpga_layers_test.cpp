// Layers on mac_array: the core's sums to the last bit, whoever waits; how well its multipliers are
// used, and where the memory is the limit.
#include <gtest/gtest.h>

#include <array>

#include "tests/workloads/backends/fpga/fpga_support.h"
#include "workloads/base/math/random.h"
#include "workloads/catalog/catalog.h"
#include "workloads/dnn/dnn.h"

namespace pirt {
namespace {

constexpr std::int64_t kSide = 14;

struct Setting {
  std::int64_t channels, filter, rows, row_words, out_rows, tiles, groups, above, input_words,
      group_words, plane_words, filter_words;
};

Setting setting_of(const fpga::Call& call) {
  std::array<std::int64_t, 12> v{};
  for (std::size_t i = 0; i < v.size(); ++i) {
    v[i] = call.parameters[2 * i] + 256 * call.parameters[2 * i + 1];
  }
  return {v[0], v[1], v[2], v[3], v[4], v[5], v[6], v[7], v[8], v[9], v[10], v[11]};
}

/// The sums in the order in which the core gives them, of what lies in its lane, by plain loops.
std::vector<std::int32_t> sums_of(const fpga::Call& call) {
  const Setting s = setting_of(call);
  const auto& memory = call.in[0].memory;
  const auto byte_at = [&](std::int64_t at) {
    return std::to_integer<std::int8_t>(memory[static_cast<std::size_t>(at)]);
  };
  std::vector<std::int32_t> sums;
  for (std::int64_t group = 0; group < s.groups; ++group) {
    for (std::int64_t y = 0; y < s.out_rows; ++y) {
      for (std::int64_t tile = 0; tile < s.tiles; ++tile) {
        for (std::int64_t m = 0; m < kSide; ++m) {
          for (std::int64_t n = 0; n < kSide; ++n) {
            std::int32_t sum = 0;
            for (std::int64_t c = 0; c < s.channels; ++c) {
              for (std::int64_t ky = 0; ky < s.filter; ++ky) {
                const std::int64_t row = y + ky - s.above;
                if (row < 0 || row >= s.rows) continue;
                for (std::int64_t kx = 0; kx < s.filter; ++kx) {
                  const std::int64_t word = c * s.plane_words + row * s.row_words;
                  const std::int64_t weight = s.input_words + group * s.group_words +
                                              c * s.filter_words + ky * s.filter + kx;
                  sum +=
                      byte_at(word * kSide + tile * kSide + n + kx) * byte_at(weight * kSide + m);
                }
              }
            }
            sums.push_back(sum);
          }
        }
      }
    }
  }
  return sums;
}

std::vector<Workload> small_layers() {
  const std::vector<dnn::ConvShape> shapes = {
      {.in_c = 1, .in_h = 1, .in_w = 1, .out_c = 1, .k_h = 1, .k_w = 1, .stride = 1, .pad = 0},
      {.in_c = 3, .in_h = 5, .in_w = 5, .out_c = 2, .k_h = 3, .k_w = 3, .stride = 1, .pad = 1},
      {.in_c = 2, .in_h = 7, .in_w = 30, .out_c = 15, .k_h = 5, .k_w = 5, .stride = 1, .pad = 2},
      {.in_c = 4, .in_h = 6, .in_w = 29, .out_c = 14, .k_h = 2, .k_w = 2, .stride = 1, .pad = 0},
      {.in_c = 3, .in_h = 23, .in_w = 19, .out_c = 5, .k_h = 11, .k_w = 11, .stride = 4, .pad = 0}};
  std::vector<Workload> layers;
  for (const auto& shape : shapes) layers.push_back(dnn::make_conv2d_relu("layer", shape));
  layers.push_back(dnn::make_fully_connected("layer", 37, 20, dnn::Activation::kDropout));
  layers.push_back(dnn::make_fully_connected("layer", 9000, 3, dnn::Activation::kSoftmax));
  for (Workload& layer : layers) layer = dnn::in_precision(layer, Precision::kInt8).value();
  return layers;
}

/// What the core makes of what lies in the call's lane.
/// @param seed  Of when its neighbours wait; 0 = never.
std::vector<std::int32_t> run_core(fpga::Core& core, const fpga::Call& call, std::uint64_t seed) {
  Random random(seed);
  const auto stops = [&] { return seed != 0 && random.below(3) == 0; };
  const auto& memory = call.in[0].memory;
  const auto count = call.out[0].size_bytes / sizeof(std::int32_t);
  core.start(0, 0, call.parameters);
  std::vector<std::int32_t> sums;
  std::size_t at = 0;
  for (int cycle = 0; sums.size() < count && cycle < 3'000'000; ++cycle) {
    fpga::Driven driven{.in_valid = at < memory.size() && !stops(), .out_ready = !stops()};
    if (driven.in_valid) std::memcpy(&driven.in_data, &memory[at], 7);
    const fpga::Shown shown = core.show(driven);
    if (driven.in_valid && shown.in_ready) at += 7;
    if (shown.out_valid && driven.out_ready) {
      sums.push_back(static_cast<std::int32_t>(shown.out_data & 0xffffffff));
      sums.push_back(static_cast<std::int32_t>(shown.out_data >> 32));
    }
    core.clock();
  }
  return sums;
}

TEST(FpgaLayers, GiveExactSumsWhoeverWaits) {
  for (const Workload& layer : small_layers()) {
    const Data data = test::data_of_seed_1(layer);
    auto call = fpga::find_kernel(layer.kernel)->make(layer, data.parameters);
    call.fill(data.inputs, call.in);
    const auto expected = sums_of(call);
    const auto core = fpga::find_core("mac_array").make();
    for (std::uint64_t seed = 0; seed <= 10; ++seed) {
      ASSERT_EQ(run_core(*core, call, seed), expected) << layer.description << ", seed " << seed;
    }
  }
}

fpga::Call fully_connected_call(int in) {
  const Workload layer =
      dnn::in_precision(dnn::make_fully_connected("layer", in, 1, dnn::Activation::kDropout),
                        Precision::kInt8)
          .value();
  return fpga::find_kernel(layer.kernel)->make(layer, test::data_of_seed_1(layer).parameters);
}

// fc6: 9,216 * 127 * 127. The most inputs that are supported, of the largest and the smallest bytes
// that a lane holds: 16,382 * 128 * 128 is within 2^28, which no sum of 28 bits with a sign holds.
TEST(FpgaLayers, GiveExactSumsOfAllThatIsSupportedAtItsLargest) {
  const auto core = fpga::find_core("mac_array").make();
  struct Extreme {
    int in;
    std::int8_t input, weight;
    std::int32_t sum;
  };
  for (const auto& [in, input, weight, sum] :
       {Extreme{9216, 127, 127, 148'644'864}, Extreme{9216, -127, 127, -148'644'864},
        Extreme{16'382, 127, -127, -264'225'278}, Extreme{16'382, -128, -128, 268'402'688},
        Extreme{16'382, 127, -128, -266'305'792}}) {
    auto call = fully_connected_call(in);
    auto& memory = call.in[0].memory;
    const auto inputs = static_cast<std::ptrdiff_t>(call.in[0].call_bytes);
    std::fill(memory.begin(), memory.begin() + inputs, static_cast<std::byte>(input));
    std::fill(memory.begin() + inputs, memory.end(), static_cast<std::byte>(weight));
    EXPECT_EQ(run_core(*core, call, 0).front(), sum) << in << " of " << +input << " by " << +weight;
  }
}

// Of rows, tiles and words there are as many as the core's settings have bits for.
TEST(FpgaLayers, RefuseConvolutionsBeyondTheSettings) {
  const auto supported = [](const dnn::ConvShape& shape) {
    const Workload layer =
        dnn::in_precision(dnn::make_conv2d_relu("layer", shape), Precision::kInt8).value();
    return test::open_fpga()->supports(layer).ok;
  };
  dnn::ConvShape shape{
      .in_c = 1, .in_h = 127, .in_w = 3, .out_c = 1, .k_h = 3, .k_w = 3, .stride = 1, .pad = 1};
  EXPECT_TRUE(supported(shape));
  shape.pad = 2;  // 129 rows out
  EXPECT_FALSE(supported(shape));
  shape.in_h = 125;
  EXPECT_TRUE(supported(shape));
  shape = {
      .in_c = 1, .in_h = 1, .in_w = 210, .out_c = 1, .k_h = 1, .k_w = 1, .stride = 1, .pad = 0};
  EXPECT_TRUE(supported(shape));
  shape.in_w = 211;
  EXPECT_FALSE(supported(shape));
}

TEST(FpgaLayers, RefuseMoreProductsThanASumHolds) {
  for (const auto& [in, supported] : {std::pair{16'382, true}, std::pair{16'383, false}}) {
    const Workload layer =
        dnn::in_precision(dnn::make_fully_connected("layer", in, 1, dnn::Activation::kDropout),
                          Precision::kInt8)
            .value();
    EXPECT_EQ(test::open_fpga()->supports(layer).ok, supported) << in;
  }
}

TEST(FpgaLayers, ComputeWhatTheReferenceComputes) {
  const auto device = test::open_fpga();
  for (const Workload& layer : small_layers()) {
    const Verdict verdict = test::run_and_verify(*device, layer);
    EXPECT_TRUE(verdict.ok) << layer.description << ": " << verdict.detail;
  }
}

Nanos execute_of(const std::string& name) {
  const auto device = test::open_fpga({{"launch_us", 0}});
  const Workload& layer = find_workload(name);
  const Data data = test::data_of_seed_1(layer);
  auto outputs = make_tensors(layer.outputs);
  const auto kernel = device->prepare(layer, data.parameters);
  kernel->bind(data.inputs, outputs);
  kernel->upload();
  const Nanos before = device->own_clock()->now();
  kernel->execute(1);
  return device->own_clock()->now() - before;
}

// 196 multipliers of 100 MHz; products with the zeros around a picture are of no use.
TEST(FpgaLayers, UseFourFifthsOfTheMultipliers) {
  for (const char* name : {"conv2@int8", "conv3@int8", "conv4@int8", "conv5@int8"}) {
    const auto products = static_cast<double>(find_workload(name).needed_ops().value()) / 2;
    EXPECT_GE(products / (196 * 100e6 * to_s(execute_of(name))), 0.8) << name;
  }
}

// A weight is used once: the memory's 286 MB/s are the limit.
TEST(FpgaLayers, ReadWeightsOfFullyConnectedLayersAtTheMemorysRate) {
  const double bytes = 4096.0 * 1000;
  EXPECT_LE(to_s(execute_of("fc8@int8")), 1.15 * bytes / 286e6);
}

}  // namespace
}  // namespace pirt
