// The layouts of detectors' outputs, each with a row or two whose meaning is known.
#include "workloads/recognition/detector_outputs.h"

#include <gmock/gmock.h>

#include <array>
#include <limits>
#include <vector>

#include "tests/support/errors.h"
#include "workloads/recognition/model.h"

namespace pirt::recognition {
namespace {

using test::bad_input;
using testing::AllOf;
using testing::HasSubstr;
using testing::IsEmpty;

DetectorFacts detector(std::size_t names = 0) {
  return {.file = "m.onnx", .width = 64, .height = 32, .names = names};
}

/// All zeros but the first row's.
NetworkOutput output(std::vector<std::int64_t> shape, std::vector<float> first_row) {
  NetworkOutput output{.shape = std::move(shape), .values = std::move(first_row)};
  std::size_t count = 1;
  for (const auto extent : output.shape) count *= static_cast<std::size_t>(extent);
  output.values.resize(count);
  return output;
}

/// The one box of @p found: left, top, right, bottom.
std::array<double, 4> edges(const std::vector<Candidate>& found) {
  if (found.size() != 1) return {};
  return {found[0].left, found[0].top, found[0].right, found[0].bottom};
}

constexpr std::array<double, 4> kBox = {0.25, 0.5, 0.75, 1.0};

TEST(DetectorOutputs, OfYoloWithObjectnessAreRowsInPixels) {
  // A box around (32, 24) of 32x16 pixels; class 1 of 2 with 0.5 * 0.9. 64x32 pixels have
  // 8*4 + 4*2 + 2*1 = 42 cells, and 126 boxes.
  const auto found =
      candidates_of(detector(), output({1, 126, 7}, {32, 24, 32, 16, 0.9F, 0.2F, 0.5F}), 0.4);
  EXPECT_EQ(edges(found), kBox);
  EXPECT_EQ(found.at(0).index, 1U);
  EXPECT_NEAR(found.at(0).score, 0.45, 1e-6);
}

TEST(DetectorOutputs, OfOneClassWithObjectnessAreToldFromEndToEndByTheirRows) {
  const auto found =
      candidates_of(detector(), output({1, 126, 6}, {32, 24, 32, 16, 0.9F, 0.5F}), 0.4);
  EXPECT_EQ(edges(found), kBox);
  EXPECT_NEAR(found.at(0).score, 0.45, 1e-6);
}

TEST(DetectorOutputs, EndToEndHaveEdgesAScoreAndAClass) {
  const auto found =
      candidates_of(detector(), output({1, 300, 6}, {16, 16, 48, 32, 0.9F, 17}), 0.4);
  EXPECT_EQ(edges(found), kBox);
  EXPECT_EQ(found.at(0).index, 17U);
  EXPECT_NEAR(found.at(0).score, 0.9, 1e-6);
  // With names too few for its class it is another model's file of names.
  EXPECT_THAT(bad_input([] {
                static_cast<void>(candidates_of(
                    detector(17), output({1, 300, 6}, {16, 16, 48, 32, 0.9F, 17}), 0.4));
              }),
              AllOf(HasSubstr("18 classes"), HasSubstr("17 names")));
}

TEST(DetectorOutputs, OfYoloWithoutObjectnessHaveTheirBoxesAcross) {
  NetworkOutput across = output({1, 6, 42}, {});
  const std::array<float, 6> box = {32, 24, 32, 16, 0.2F, 0.7F};
  for (std::size_t i = 0; i < box.size(); ++i) across.values[i * 42] = box[i];
  const auto found = candidates_of(detector(), across, 0.4);
  EXPECT_EQ(edges(found), kBox);
  EXPECT_EQ(found.at(0).index, 1U);
  // Of 100 classes there are more numbers a box than boxes; names say which are which.
  NetworkOutput many = output({1, 104, 42}, {});
  for (std::size_t i = 0; i < 4; ++i) many.values[i * 42] = box[i];
  many.values[(4 + 99) * 42] = 0.7F;
  EXPECT_EQ(candidates_of(detector(100), many, 0.4).at(0).index, 99U);
}

TEST(DetectorOutputs, OfSsdAreInPartsOfTheInput) {
  auto ssd = output({1, 1, 2, 7}, {0, 5, 0.8F, 0.25F, 0.5F, 0.75F, 1.0F});
  ssd.values[7 + 1] = -1;  // Room that is not used.
  const auto found = candidates_of(detector(), ssd, 0.4);
  EXPECT_EQ(edges(found), kBox);
  EXPECT_EQ(found.at(0).index, 5U);
}

TEST(DetectorOutputs, WithScoresThatAreNoneAreRefused) {
  const auto refused = [](const NetworkOutput& given) {
    return bad_input([&] { static_cast<void>(candidates_of(detector(), given, 0.4)); });
  };
  EXPECT_THAT(refused(output({1, 126, 6}, {16, 16, 48, 32, 3234, 0.5F})),
              AllOf(HasSubstr("m.onnx"), HasSubstr("[1, 126, 6]"), HasSubstr("3234")));
  EXPECT_THAT(refused(output({1, 300, 6}, {16, 16, 48, 32, -3, 0})), HasSubstr("a score of -3"));
  EXPECT_THAT(refused(output({1, 300, 6}, {16, 16, 48, 32, 0.9F, 0.5F})),
              HasSubstr("a class of 0.5"));
  EXPECT_THAT(refused(output({1, 1, 1, 7}, {0, 5, std::numeric_limits<float>::quiet_NaN()})),
              HasSubstr("a score of nan"));
  EXPECT_THAT(refused(output({1, 3}, {})), HasSubstr("[1, 3]"));
  EXPECT_THAT(candidates_of(detector(), output({1, 126, 7}, {}), 0.4), IsEmpty());
}

TEST(Letterbox, HasThePictureInTheMiddleInItsAspect) {
  // 640x480 into 320x320: halved, 240 rows, 40 above and below.
  const Placement inner = letterbox(640, 480, 320, 320);
  EXPECT_THAT((std::vector{inner.x, inner.y, inner.width, inner.height}),
              testing::ElementsAre(0, 40, 320, 240));
  // White of 2x1 pixels in 4x4: rows 1 and 2 are white, the others Ultralytics' grey, 114.
  Tensor white({"image", Element::kU8, {3, 1, 2}});
  for (auto& pixel : white.as<std::uint8_t>()) pixel = 255;
  const auto input = network_input(white, 4, 4, Fit::kLetterbox, Preprocess::kUnit);
  EXPECT_NEAR(input.at(0), 114 / 255.0, 1e-6);
  EXPECT_NEAR(input.at(4), 1, 1e-6);
  EXPECT_NEAR(input.at(11), 1, 1e-6);
  EXPECT_NEAR(input.at(15), 114 / 255.0, 1e-6);
}

}  // namespace
}  // namespace pirt::recognition
