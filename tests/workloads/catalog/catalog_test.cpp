// The catalog: names, operations, tensors, and that every verification accepts what is right and
// refuses what is not.
#include "workloads/catalog/catalog.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <optional>
#include <set>

#include "tests/workloads/catalog/workload_support.h"
#include "workloads/backends/backend_list.h"
#include "workloads/backends/registry.h"
#include "workloads/base/error.h"
#include "workloads/inputs/pictures/images.h"
#include "workloads/vision/vision.h"

namespace pirt {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

// Who computes nothing sees the same tensors, states and counts.
TEST(Specs, AreThoseOfTheCatalog) {
  std::vector<std::string> names = workload_names();
  EXPECT_EQ(names.size(), catalog().size());
  names.insert(names.end(), {"conv2@int8", "sobel@map", "fc6@batch8"});
  for (const std::string& name : names) {
    SCOPED_TRACE(name);
    const Workload& workload = find_workload(name);
    const WorkloadSpec spec = find_spec(name);
    EXPECT_EQ(spec.name, workload.name);
    EXPECT_EQ(spec.inputs, workload.inputs);
    EXPECT_EQ(spec.outputs, workload.outputs);
    EXPECT_EQ(spec.state, workload.state);
    EXPECT_EQ(spec.ops, workload.ops);
    EXPECT_EQ(spec.bytes, workload.bytes());
  }
  EXPECT_FALSE(try_find_spec("conv2@batch1"));
}

TEST(Backends, AreThoseThatPlatformFilesMayName) {
  std::vector<std::string> names;
  for (const auto& backend : backends()) names.emplace_back(backend->name());
  EXPECT_EQ(names, backend_names());
}

TEST(Catalog, HasTableOneInThePapersOrder) {
  std::vector<std::string> names;
  for (const Workload& workload : catalog()) {
    if (workload.has_tag("table1")) names.push_back(workload.name);
  }
  EXPECT_THAT(names, ElementsAre("gaussian_blur", "convolution", "sobel", "undistort",
                                 "feature_detect", "optical_flow", "conv1", "conv2", "conv3",
                                 "conv4", "conv5", "fc6", "fc7", "fc8"));
}

// The paper's Table I by its formulas, e.g. conv2: 2 * 5*5 * 96 * 256 * 27*27 = 895 795 200
// (printed as 895.5 M, a slip).
TEST(Catalog, CountsTheOperationsOfTableOneExactly) {
  const std::map<std::string, std::int64_t> expected = {{"gaussian_blur", 15'360'000},
                                                        {"convolution", 30'105'600},
                                                        {"sobel", 74'649'600},
                                                        {"conv1", 210'830'400},
                                                        {"conv2", 895'795'200},
                                                        {"conv3", 299'040'768},
                                                        {"conv4", 448'561'152},
                                                        {"conv5", 299'040'768},
                                                        {"fc6", 75'497'472},
                                                        {"fc7", 33'554'432},
                                                        {"fc8", 8'192'000},
                                                        // The sum of the eight layers above.
                                                        {"alexnet", 2'270'512'192}};
  for (const auto& workload : catalog()) {
    if (!workload.has_tag("table1") && !expected.contains(workload.name)) continue;
    const auto it = expected.find(workload.name);
    EXPECT_EQ(workload.ops, it == expected.end() ? std::nullopt : std::optional(it->second))
        << workload.name;
  }
}

// blur: two pictures of 307 200 bytes. conv1: 4 * (3*227*227 + 96*3*11*11 + 96 + 96*55*55) = 1 919
// 484. sobel: 2 073 600 in, 2 bytes each out twice.
TEST(Catalog, CountsEachTensorsBytesOnce) {
  EXPECT_EQ(find_workload("gaussian_blur").bytes(), 614'400);
  EXPECT_EQ(find_workload("sobel").bytes(), 2'073'600 * 5);
  EXPECT_EQ(find_workload("conv1").bytes(), 4 * (154'587 + 34'848 + 96 + 290'400));
  EXPECT_EQ(find_workload("pool5").bytes(), 4 * (256 * 13 * 13 + 256 * 6 * 6));
}

TEST(Catalog, LayersOfTheChainFitTogether) {
  for (const auto& [from, to] : {std::pair("conv1", "pool1"),
                                 {"pool1", "conv2"},
                                 {"conv2", "pool2"},
                                 {"pool2", "conv3"},
                                 {"conv3", "conv4"},
                                 {"conv4", "conv5"},
                                 {"conv5", "pool5"}}) {
    EXPECT_EQ(find_workload(from).outputs[0].shape, find_workload(to).inputs[0].shape) << from;
  }
  EXPECT_EQ(find_workload("pool5").outputs[0].count(), find_workload("fc6").inputs[0].count());
  EXPECT_EQ(find_workload("fc6").inputs[0].shape, (std::vector<std::int64_t>{9216}));
}

TEST(Catalog, UnknownNamesComeWithTheNearest) {
  EXPECT_EQ(try_find_workload("blur"), nullptr);
  EXPECT_EQ(try_find_workload("sobel@"), nullptr);
  EXPECT_EQ(try_find_workload("alexnet@map"), nullptr);
  EXPECT_EQ(find_workload("sobel@map").variant, "map");
  EXPECT_THROW(static_cast<void>(workloads_in_variant("mop")), Error);
  try {
    static_cast<void>(find_workload("gausian_blur"));
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kBadInput);
    EXPECT_THAT(error.what(), HasSubstr("did you mean gaussian_blur"));
  }
}

TEST(Registry, ListsTheBackendsAndNamesTheNearest) {
  std::vector<std::string> names;
  for (const auto& backend : backends()) names.emplace_back(backend->name());
  EXPECT_THAT(names, ElementsAre("cpu", "opencl", "dsp", "fpga", "nats", "fake"));
  EXPECT_EQ(find_backend("opencl").name(), "opencl");
  EXPECT_THROW(static_cast<void>(find_backend("openCL2")), Error);
}

// Which of the two a workload has says whether it has a state; what shares a state has all of it
// alike.
TEST(Catalog, AWorkloadHasAReferenceOrAStateWithItsStep) {
  std::map<std::string, StateSpec> states;
  for (const Workload& workload : catalog()) {
    EXPECT_NE(bool(workload.reference), bool(workload.step)) << workload.name;
    EXPECT_EQ(bool(workload.step), workload.state.has_value()) << workload.name;
    EXPECT_EQ(bool(workload.make_state), workload.state.has_value()) << workload.name;
    EXPECT_GE(workload.frames, 1) << workload.name;
    EXPECT_FALSE(workload.ops && workload.ops_of) << workload.name;
    if (!workload.state) continue;
    const auto& shared = states.emplace(workload.state->name, *workload.state).first->second;
    EXPECT_EQ(shared, *workload.state) << workload.name;
    const auto initial = workload.make_state();
    ASSERT_EQ(initial.size(), workload.state->tensors.size());
    for (std::size_t i = 0; i < initial.size(); ++i) {
      EXPECT_EQ(initial[i].spec(), workload.state->tensors[i]) << workload.name;
    }
  }
}

TEST(Verify, ExactNamesTheWorstElement) {
  std::vector<Tensor> expected, outputs;
  expected.push_back(test::tensor_of<std::int16_t>({2, 2}, {1, 2, 3, 4}));
  outputs.push_back(test::tensor_of<std::int16_t>({2, 2}, {1, 0, 9, 4}));
  const auto verdict = verify_exact(outputs, expected);
  EXPECT_FALSE(verdict.ok);
  EXPECT_EQ(verdict.worst_error, 6.0);
  EXPECT_THAT(verdict.detail, HasSubstr("2 of 4 differ"));
  EXPECT_THAT(verdict.detail, HasSubstr("at [1,0]: got 9, expected 3"));
}

// Peak 8, bound 0.125 * 8 = 1: an error of exactly 1 passes, the next larger one does not.
TEST(Verify, CloseIsRelativeToThePeakAndIncludesTheBound) {
  std::vector<Tensor> expected, outputs;
  expected.push_back(test::tensor_of<double>({3}, {1.0, -8.0, 0.0}));
  outputs.push_back(test::tensor_of<float>({3}, {1.0F, -8.0F, 1.0F}));
  const auto at_bound = verify_close(0.125)(outputs, expected);
  EXPECT_TRUE(at_bound.ok);
  EXPECT_EQ(at_bound.worst_error, 0.125);
  outputs[0].as<float>()[2] = std::nextafter(1.0F, 2.0F);
  EXPECT_FALSE(verify_close(0.125)(outputs, expected).ok);
}

TEST(Verify, WrongShapesTypesAndCountsAreRefused) {
  std::vector<Tensor> expected, outputs;
  expected.push_back(test::tensor_of<double>({2}, {1.0, 2.0}));
  EXPECT_FALSE(verify_close(0.1)(outputs, expected).ok);
  outputs.push_back(test::tensor_of<float>({1}, {1.0F}));
  EXPECT_FALSE(verify_close(0.1)(outputs, expected).ok);
  outputs[0] = test::tensor_of<std::int32_t>({2}, {1, 2});
  EXPECT_FALSE(verify_close(0.1)(outputs, expected).ok);
  EXPECT_FALSE(verify_exact(outputs, expected).ok);
  EXPECT_FALSE(verify_exact(expected, expected).ok) << "f64 is not of integers";
}

TEST(Verify, OutputsOf64BitsAreCompared) {
  std::vector<Tensor> expected, outputs;
  expected.push_back(test::tensor_of<double>({2}, {1.0, 8.0}));
  outputs.push_back(test::tensor_of<double>({2}, {1.0, 8.0 + 1e-12}));
  EXPECT_TRUE(verify_close(1e-12)(outputs, expected).ok);
  EXPECT_FALSE(verify_close(1e-14)(outputs, expected).ok);
  outputs[0].as<double>()[0] = std::nan("");
  EXPECT_FALSE(verify_close(1.0)(outputs, expected).ok);
}

// Of a list the rows that it has are compared, and how many they are; what lies behind means
// nothing.
TEST(Verify, ListsAreComparedAsFarAsTheyReach) {
  const auto list = [](Element element, std::int64_t rows) {
    Tensor tensor({"list", element, {4, 2}, true});
    tensor.set_rows(rows);
    std::vector<Tensor> all;
    all.push_back(std::move(tensor));
    return all;
  };
  auto expected = list(Element::kF64, 3);
  auto outputs = list(Element::kF32, 3);
  expected[0].as<double>()[0] = outputs[0].as<float>()[0] = 1;
  outputs[0].as<float>()[7] = std::nanf("");
  EXPECT_TRUE(verify_close(0.0)(outputs, expected).ok);
  outputs[0].as<float>()[5] = 1;
  EXPECT_FALSE(verify_close(0.0)(outputs, expected).ok);
  const auto shorter = verify_close(0.0)(list(Element::kF32, 2), expected);
  EXPECT_FALSE(shorter.ok);
  EXPECT_THAT(shorter.detail, HasSubstr("list f32[<=4,2] has 2 rows where 3 are expected"));
  EXPECT_TRUE(verify_close(0.0)(list(Element::kF32, 0), list(Element::kF64, 0)).ok);
  EXPECT_TRUE(verify_exact(list(Element::kI32, 0), list(Element::kI32, 0)).ok);
}

TEST(Verify, NotANumberInTheReferenceIsNeverRight) {
  std::vector<Tensor> expected, outputs;
  expected.push_back(test::tensor_of<double>({2}, {1.0, std::nan("")}));
  outputs.push_back(test::tensor_of<float>({2}, {1.0F, 1.0F}));
  EXPECT_FALSE(verify_close(0.1)(outputs, expected).ok);
}

/// Moves the content of a picture (or plane) by one column.
void shift(Tensor& tensor) {
  const auto unit = size_bytes(tensor.spec().element);
  const auto bytes = tensor.used_bytes().size();
  std::copy_backward(tensor.data(), tensor.data() + bytes - unit, tensor.data() + bytes);
}

/// What a wrong backend might return instead of @p right.
struct Wrong {
  std::string what;
  std::vector<Tensor> outputs;
};

std::vector<Wrong> wrong_outputs(const Workload& workload, const std::vector<Tensor>& expected) {
  std::vector<Wrong> wrong;
  wrong.push_back({"all zero", make_tensors(workload.outputs)});
  for (std::size_t i = 0; i < workload.outputs.size(); ++i) {
    const auto& spec = workload.outputs[i];
    if (spec.element == Element::kF32) {
      for (const float value :
           {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity()}) {
        wrong.push_back({"not finite in " + spec.name, test::as_outputs(workload, expected)});
        wrong.back().outputs[i].as<float>()[0] = value;
      }
      // 1 % of the peak at the peak; corner lists move by half a pixel there.
      wrong.push_back({"one element off in " + spec.name, test::as_outputs(workload, expected)});
      auto values = wrong.back().outputs[i].used<float>();
      auto& peak = *std::ranges::max_element(values, {}, [](float v) { return std::abs(v); });
      peak += std::max(0.01F * std::abs(peak), workload.kernel == "feature_detect" ? 0.5F : 0.0F);
    } else if (!expected[i].used_bytes().empty()) {
      wrong.push_back({"one element off in " + spec.name, test::as_outputs(workload, expected)});
      // The last byte of the little-endian element, so that 500 corners do not become 499 + 2 %.
      auto& output = wrong.back().outputs[i];
      auto* last = output.data() + output.used_bytes().size() - 1;
      *last ^= spec.element == Element::kF64 ? std::byte{0x40} : std::byte{1};  // 0 becomes 2
    }
    if (spec.varies) {
      wrong.push_back({"a row more in " + spec.name, test::as_outputs(workload, expected)});
      auto& list = wrong.back().outputs[i];
      list.set_rows(list.rows() < spec.shape[0] ? list.rows() + 1 : list.rows() / 2);
    }
    if (spec.count() > 1) {
      wrong.push_back({"content moved in " + spec.name, test::as_outputs(workload, expected)});
      auto& moved = wrong.back().outputs[i];
      const std::vector<std::byte> before(moved.bytes().begin(), moved.bytes().end());
      shift(moved);
      if (std::ranges::equal(before, moved.bytes())) wrong.pop_back();  // All alike.
    }
  }
  return wrong;
}

class EveryWorkload : public testing::TestWithParam<std::string> {};

TEST_P(EveryWorkload, AcceptsItsReferenceAndRefusesWhatIsWrong) {
  const Workload& workload = find_workload(GetParam());
  const auto images = generated_images(1);
  const auto sequence = test::sequence_of(workload);
  const Data& data = sequence.back();
  ASSERT_EQ(data.inputs.size(), workload.inputs.size());
  ASSERT_EQ(data.parameters.size(), workload.parameters.size());
  for (std::size_t i = 0; i < data.inputs.size(); ++i) {
    EXPECT_EQ(data.inputs[i].spec().element, workload.inputs[i].element);
    EXPECT_EQ(data.inputs[i].spec().shape, workload.inputs[i].shape);
  }
  for (std::size_t i = 0; i < data.parameters.size(); ++i) {
    EXPECT_EQ(data.parameters[i].spec(), workload.parameters[i]);
  }
  const auto references = reference_of(workload, sequence);
  const auto& expected = references.back();
  const auto right = workload.verify(test::as_outputs(workload, expected), expected);
  EXPECT_TRUE(right.ok) << right.detail;
  for (const auto& wrong : wrong_outputs(workload, expected)) {
    const auto verdict = workload.verify(wrong.outputs, expected);
    EXPECT_FALSE(verdict.ok) << wrong.what << ": " << verdict.detail;
    EXPECT_FALSE(verdict.detail.empty());
  }
  if (!workload.has_tag("image")) return;
  auto shifted = test::sequence_of(workload);
  // All pictures of a sequence alike would be another camera's, and as right.
  for (auto& input : shifted.back().inputs) {
    if (!input.spec().varies) shift(input);
  }
  const auto outputs = test::as_outputs(workload, reference_of(workload, shifted).back());
  EXPECT_FALSE(workload.verify(outputs, expected).ok) << "of a shifted picture";
}

INSTANTIATE_TEST_SUITE_P(Catalog, EveryWorkload, testing::ValuesIn(workload_names()),
                         [](const auto& test) { return test.param; });

TEST(Catalog, CornerListsThatCannotBeAreRefused) {
  const auto workload = vision::make_feature_detect(160, 120);
  const auto images = generated_images(1);
  const auto expected = workload.reference(workload.make_data({.seed = 1, .images = images.get()}));
  const auto count = expected[0].rows();
  ASSERT_GT(count, 5);
  ASSERT_LT(count, 400);
  const auto refused = [&](auto change) {
    auto outputs = test::as_outputs(workload, expected);
    change(outputs[0].template as<float>(), outputs[0]);
    return !workload.verify(outputs, expected).ok;
  };
  EXPECT_TRUE(refused([](auto, auto& list) { list.set_rows(0); }));
  EXPECT_TRUE(refused([](auto, auto& list) { list.set_rows(500); })) << "rows of 0";
  EXPECT_TRUE(refused([](auto xy, auto&) { xy[2] = xy[0], xy[3] = xy[1]; })) << "twice the same";
  EXPECT_TRUE(refused([](auto xy, auto&) { xy[0] = 0.0F; })) << "on the border";
  EXPECT_TRUE(refused([](auto xy, auto&) { xy[0] = 1e9F; })) << "outside";
  EXPECT_TRUE(refused([&](auto, auto& list) { list.set_rows(count - count / 20 - 1); }))
      << "5 % dropped from the end";
}

// The order may differ where strengths nearly tie: sets are compared.
TEST(Catalog, CornerListsMayComeInAnotherOrder) {
  const auto workload = vision::make_feature_detect(160, 120);
  const auto images = generated_images(1);
  const auto expected = workload.reference(workload.make_data({.seed = 1, .images = images.get()}));
  auto outputs = test::as_outputs(workload, expected);
  auto xy = outputs[0].as<float>();
  std::swap_ranges(xy.begin(), xy.begin() + 2, xy.begin() + 2);
  EXPECT_TRUE(workload.verify(outputs, expected).ok);
}

}  // namespace
}  // namespace pirt
