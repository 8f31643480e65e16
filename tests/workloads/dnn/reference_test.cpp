// The AlexNet references: small cases by hand, and against OpenCV's filter2D; the data of the
// layers.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <opencv2/imgproc.hpp>

#include "tests/workloads/catalog/workload_support.h"
#include "workloads/base/error.h"
#include "workloads/catalog/catalog.h"
#include "workloads/dnn/dnn.h"
#include "workloads/dnn/layers.h"
#include "workloads/inputs/pictures/images.h"

namespace pirt::dnn {
namespace {

using test::tensor_of;
using Values = std::vector<double>;

// Input 1 2 3 / 4 5 6 / 7 8 9, filter 1 0 / 0 -1, bias 5: each output is x(y,x) - x(y+1,x+1) + 5
// = 1.
TEST(DnnReference, ConvolutionOfOneChannel) {
  const Values in = {1, 2, 3, 4, 5, 6, 7, 8, 9};
  const std::vector<float> weights = {1, 0, 0, -1};
  EXPECT_EQ(conv2d_relu({1, 3, 3, 1, 2, 2, 1, 0}, in, weights, std::vector{5.0F}),
            (Values{1, 1, 1, 1}));
  // Bias 3: -1 everywhere, which the ReLU cuts.
  EXPECT_EQ(conv2d_relu({1, 3, 3, 1, 2, 2, 1, 0}, in, weights, std::vector{3.0F}),
            (Values{0, 0, 0, 0}));
}

// 2x2 of ones twice (two channels, weights 1 and 10), 3x3 filters of ones, padding 1: every output
// sees all four pixels, 4*1 + 4*10 = 44.
TEST(DnnReference, ConvolutionPadsWithZeros) {
  std::vector<float> weights(9, 1.0F);
  weights.resize(18, 10.0F);
  EXPECT_EQ(conv2d_relu({2, 2, 2, 1, 3, 3, 1, 1}, Values(8, 1.0), weights, std::vector{0.0F}),
            (Values{44, 44, 44, 44}));
}

// A row 0..6, filter 1 1, stride 3: outputs at 0 and 3: 0+1, 3+4 (6 has no right neighbour). Two
// output channels with biases 0 and 100.
TEST(DnnReference, ConvolutionStridesAndAddsEachChannelsBias) {
  Values in(7);
  std::iota(in.begin(), in.end(), 0.0);
  EXPECT_EQ(conv2d_relu({1, 1, 7, 2, 1, 2, 3, 0}, in, std::vector{1.0F, 1.0F, 1.0F, 1.0F},
                        std::vector{0.0F, 100.0F}),
            (Values{1, 7, 101, 107}));
}

// filter2D in double precision, channel by channel, zero border. Sums of the same doubles in
// another order: observed 1.4e-14 apart.
TEST(DnnReference, ConvolutionIsTheSumOfOpenCvsFilters) {
  const auto layer = make_conv2d_relu("small", {5, 12, 9, 4, 3, 3, 1, 1});
  const auto images = generated_images(1);
  const auto data = layer.make_data({.seed = 3, .images = images.get()});
  const auto expected = layer.reference(data);
  const auto in = data.inputs[0].as<float>();
  const auto weights = data.parameters[0].as<float>();
  for (std::size_t oc = 0; oc < 4; ++oc) {
    cv::Mat sum(12, 9, CV_64F, cv::Scalar(data.parameters[1].as<float>()[oc]));
    for (std::size_t ic = 0; ic < 5; ++ic) {
      cv::Mat plane(12, 9, CV_32F, const_cast<float*>(&in[ic * 108]));
      cv::Mat kernel(3, 3, CV_32F, const_cast<float*>(&weights[(oc * 5 + ic) * 9]));
      cv::Mat wide, part;
      plane.convertTo(wide, CV_64F);
      cv::filter2D(wide, part, CV_64F, kernel, {-1, -1}, 0.0, cv::BORDER_CONSTANT);
      sum += part;
    }
    for (std::size_t i = 0; i < 108; ++i) {
      EXPECT_NEAR(expected[0].as<double>()[oc * 108 + i],
                  std::max(0.0, sum.at<double>(static_cast<int>(i) / 9, static_cast<int>(i) % 9)),
                  1e-12);
    }
  }
}

// 5x5 of 0 .. 24, 3x3 windows, stride 2: their bottom right elements 12, 14, 22, 24. Stride 2 on
// 4x4: one window only (floor).
TEST(DnnReference, PoolTakesTheLargestOfWholeWindows) {
  Values in(25);
  std::iota(in.begin(), in.end(), 0.0);
  const auto pool = make_max_pool("p", 1, 5, 5, 3, 2);
  EXPECT_EQ(run_layer(pool, in, {}), (Values{12, 14, 22, 24}));
  EXPECT_EQ(run_layer(make_max_pool("p", 1, 4, 4, 3, 2), Values(16, -2.0), {}), (Values{-2}));
}

std::vector<Tensor> fc_parameters() {
  std::vector<Tensor> parameters;
  parameters.push_back(tensor_of<float>({2, 3}, {1, 2, 3, -1, 0, 1}));
  parameters.push_back(tensor_of<float>({2}, {10, -20}));
  return parameters;
}

// [1 2 3; -1 0 1] [1 1 2] + [10 -20] = [9 + 10, 1 - 20].
TEST(DnnReference, FullyConnectedIsWithoutReluAsTableOneNamesNone) {
  const auto layer = make_fully_connected("f", 3, 2, Activation::kDropout);
  EXPECT_EQ(run_layer(layer, Values{1, 1, 2}, fc_parameters()), (Values{19, -19}));
}

// Logits 0 and ln 3: probabilities 1/4 and 3/4. Large ones do not overflow: 1000 and 1000 give
// halves.
TEST(DnnReference, SoftmaxSumsToOneAndDoesNotOverflow) {
  const auto probabilities = [](double a, double b) {
    FullyConnected op;
    op.in = 2;
    op.out = 2;
    op.activation = Activation::kSoftmax;
    return fully_connected(op, Values{a, b}, std::vector{1.0F, 0.0F, 0.0F, 1.0F},
                           std::vector{0.0F, 0.0F});
  };
  EXPECT_NEAR(probabilities(0.0, std::log(3.0))[0], 0.25, 1e-15);
  EXPECT_NEAR(probabilities(0.0, std::log(3.0))[1], 0.75, 1e-15);
  EXPECT_EQ(probabilities(1000.0, 1000.0), (Values{0.5, 0.5}));
}

TEST(DnnReference, SequenceFeedsEachLayerWithTheLast) {
  const auto images = generated_images(1);
  std::vector<Workload> layers;
  layers.push_back(make_conv2d_relu("a", {3, 19, 17, 8, 3, 3, 2, 1}));  // to 8x10x9
  layers.push_back(make_max_pool("b", 8, 10, 9, 3, 2));                 // to 8x4x4
  layers.push_back(make_fully_connected("c", 128, 10, Activation::kSoftmax));
  const auto chain = make_sequence("chain", "three layers", layers, 1e-4);
  const auto data = chain.make_data({.seed = 2, .images = images.get()});
  ASSERT_EQ(data.parameters.size(), 4U);
  EXPECT_EQ(data.parameters[0].spec().name, "a.weights");
  EXPECT_EQ(data.parameters[3].spec().name, "c.bias");
  EXPECT_EQ(chain.ops, *layers[0].ops + *layers[2].ops);

  Values values(data.inputs[0].as<float>().begin(), data.inputs[0].as<float>().end());
  const std::span<const Tensor> parameters = data.parameters;
  values = run_layer(layers[0], values, parameters.first(2));
  values = run_layer(layers[1], values, {});
  values = run_layer(layers[2], values, parameters.last(2));
  const auto reference = chain.reference(data);
  EXPECT_TRUE(std::ranges::equal(reference[0].as<double>(), values));
}

TEST(DnnReference, ImpossibleShapesAreRefused) {
  EXPECT_THROW(static_cast<void>(conv2d_ops({1, 2, 9, 1, 3, 3, 1, 0})), Error);
  EXPECT_NO_THROW(static_cast<void>(conv2d_ops({1, 2, 9, 1, 3, 3, 1, 1})));
  EXPECT_THROW(static_cast<void>(make_conv2d_relu("c", {1, 9, 2, 1, 3, 3, 1, 0})), Error);
  EXPECT_THROW(static_cast<void>(make_max_pool("p", 1, 2, 9, 3, 2)), Error);
}

// A 3x3 filter over 13x13 with a border of 1: of 13 * 3 taps a line, the first and the last lie
// outside, 37 within. 5x5 over 27x27 with 2: 135 less 3 on each side. Stride 2 over 4 with 1: at -1
// 1, of which 2 and 3 taps are within.
TEST(DnnReference, CountsOperationsOnPadding) {
  EXPECT_EQ(conv2d_padding_ops({384, 13, 13, 384, 3, 3, 1, 1}),
            2LL * 384 * 384 * (39 * 39 - 37 * 37));
  EXPECT_EQ(conv2d_padding_ops({96, 27, 27, 256, 5, 5, 1, 2}),
            2LL * 96 * 256 * (135 * 135 - 129 * 129));
  EXPECT_EQ(conv2d_padding_ops({1, 4, 4, 1, 3, 3, 2, 1}), 2LL * (6 * 6 - 5 * 5));
  EXPECT_EQ(conv2d_padding_ops({3, 227, 227, 96, 11, 11, 4, 0}), 0);
  std::int64_t all = 0;
  for (const char* name : {"conv2", "conv3", "conv4", "conv5"}) {
    all += find_workload(name).padding_ops;
  }
  const Workload& alexnet = find_workload("alexnet");
  EXPECT_EQ(alexnet.padding_ops, all);
  EXPECT_EQ(alexnet.needed_ops(), *alexnet.ops - all);
  EXPECT_EQ(find_workload("pool5").needed_ops(), std::nullopt);
  EXPECT_EQ(find_workload("conv4@batch8").padding_ops, 8 * find_workload("conv4").padding_ops);
}

// Mean square of uniform [-l, l) is l^2 / 3. He: l = sqrt(6 / fan-in), so that fan-in * mean square
// = 2 before a ReLU; 1 where none follows. 884 736 and 16.8 million samples: relative spread of the
// mean below 0.001.
TEST(DnnReference, WeightsAreHeUniform) {
  const auto images = generated_images(1);
  for (const auto& [name, fan_in, gain] :
       {std::tuple("conv3", 2304.0, 2.0), std::tuple("fc7", 4096.0, 1.0)}) {
    const auto data = find_workload(name).make_data({.seed = 1, .images = images.get()});
    const auto weights = data.parameters[0].as<float>();
    double sum = 0.0, squares = 0.0, peak = 0.0;
    for (const double w : weights) {
      sum += w;
      squares += w * w;
      peak = std::max(peak, std::abs(w));
    }
    const auto count = static_cast<double>(weights.size());
    EXPECT_NEAR(fan_in * squares / count, gain, 0.01 * gain) << name;
    EXPECT_NEAR(sum / count, 0.0, 1e-4) << name;
    EXPECT_NEAR(peak, std::sqrt(3.0 * gain / fan_in), 1e-5) << name;
  }
}

TEST(DnnReference, InputsAreDenseAndPositive) {
  const auto images = generated_images(1);
  for (const std::string name : {"conv2", "fc6", "pool1"}) {
    const auto data = find_workload(name).make_data({.seed = 1, .images = images.get()});
    const auto [low, high] = std::ranges::minmax(data.inputs[0].as<float>());
    EXPECT_GT(low, 0.0F) << name;
    EXPECT_LE(high, 3.0F) << name;
  }
}

TEST(DnnReference, LayerHasTheSameWeightsAloneAndInTheChain) {
  const auto images = generated_images(1);
  const auto alone = find_workload("conv5").make_data({.seed = 4, .images = images.get()});
  const auto chain = find_workload("alexnet").make_data({.seed = 4, .images = images.get()});
  const auto it = std::ranges::find_if(
      chain.parameters, [](const Tensor& t) { return t.spec().name == "conv5.weights"; });
  ASSERT_NE(it, chain.parameters.end());
  EXPECT_TRUE(std::ranges::equal(it->bytes(), alone.parameters[0].bytes()));
}

TEST(DnnReference, DataAreAFunctionOfTheSeed) {
  const auto images = generated_images(1);
  const auto& fc8 = find_workload("fc8");
  const auto one = fc8.make_data({.seed = 1, .images = images.get()});
  const auto again = fc8.make_data({.seed = 1, .images = images.get()});
  const auto two = fc8.make_data({.seed = 2, .images = images.get()});
  EXPECT_TRUE(std::ranges::equal(one.parameters[0].bytes(), again.parameters[0].bytes()));
  EXPECT_FALSE(std::ranges::equal(one.parameters[0].bytes(), two.parameters[0].bytes()));
  EXPECT_FALSE(std::ranges::equal(one.inputs[0].bytes(), two.inputs[0].bytes()));
}

// Uniform over 1000 classes would be 0.001 each, one-hot 1. Observed largest over six seeds: 0.020
// to 0.035 (fc8 alone: 0.037 to 0.36).
TEST(DnnReference, ChainsProbabilitiesAreNeitherUniformNorOneHot) {
  const auto& alexnet = find_workload("alexnet");
  for (const auto seed : std::initializer_list<std::uint64_t>{1, 2}) {
    const auto images = generated_images(seed);
    const auto out = alexnet.reference(alexnet.make_data({.seed = seed, .images = images.get()}));
    const auto probabilities = out[0].as<double>();
    EXPECT_NEAR(std::accumulate(probabilities.begin(), probabilities.end(), 0.0), 1.0, 1e-12);
    EXPECT_LT(std::ranges::max(probabilities), 0.5) << "seed " << seed;
    EXPECT_GT(std::ranges::max(probabilities), 0.004) << "seed " << seed;
  }
}

}  // namespace
}  // namespace pirt::dnn
