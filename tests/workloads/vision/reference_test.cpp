// The vision references: small cases by hand, and against OpenCV, which is an independent
// implementation of the same functions.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>

#include "tests/workloads/catalog/workload_support.h"
#include "workloads/inputs/pictures/images.h"
#include "workloads/vision/vision.h"

namespace pirt::vision {
namespace {

using test::kOddSizes;
using test::noise_picture;
using test::tensor_of;

Data data_of(Tensor image) {
  Data data;
  data.inputs.push_back(std::move(image));
  return data;
}

cv::Mat mat(const Tensor& tensor, int type) {
  return {static_cast<int>(tensor.dim(0)), static_cast<int>(tensor.dim(1)), type,
          const_cast<std::byte*>(tensor.data())};
}

// An impulse of 255 gives 255 * [1 4 6 4 1]^2 / 256: 36 * 255 / 256 = 35.86 in the middle, 24
// -> 23.9, 16 -> 15.9, 6 -> 5.98, 4 -> 3.98, 1 -> 0.996.
TEST(VisionReference, BlurOfAnImpulseIsTheBinomialKernel) {
  Tensor image({"image", Element::kU8, {7, 7}});
  image.as<std::uint8_t>()[3 * 7 + 3] = 255;
  const auto out = make_gaussian_blur(7, 7).reference(data_of(std::move(image)));
  const auto* row = out[0].as<std::uint8_t>().data() + 21;
  EXPECT_EQ(std::vector<int>(row, row + 7), (std::vector<int>{0, 6, 24, 36, 24, 6, 0}));
  const auto* above = row - 14;
  EXPECT_EQ(std::vector<int>(above, above + 7), (std::vector<int>{0, 1, 4, 6, 4, 1, 0}));
}

// The row 0 128 255 is mirrored to 255 128 [0 128 255] 128 0. At column 0: 1*255 + 4*128 + 6*0 +
// 4*128 + 1*255 = 1534; all five rows are the same, which makes 16 * 1534 = 24544, and (24544 +
// 128) >> 8 = 96.
TEST(VisionReference, BlurMirrorsTheBorderWithoutRepeatingIt) {
  const auto out =
      make_gaussian_blur(3, 1).reference(data_of(tensor_of<std::uint8_t>({1, 3}, {0, 128, 255})));
  EXPECT_EQ(out[0].as<std::uint8_t>()[0], 96);
}

TEST(VisionReference, BlurIsOpenCvs) {
  for (const auto& [width, height] : kOddSizes) {
    const auto data = data_of(noise_picture(width, height, 1));
    cv::Mat expected;
    cv::GaussianBlur(mat(data.inputs[0], CV_8U), expected, {5, 5}, 0.0);
    const auto out = make_gaussian_blur(width, height).reference(data);
    EXPECT_EQ(cv::norm(mat(out[0], CV_8U), expected, cv::NORM_INF), 0.0) << width << "x" << height;
  }
}

// Only the middle weight w: out = round_half_even(w * p / 256) in 0 .. 255. With w = 128: 1 -> 0.5
// -> 0; 3 -> 1.5 -> 2; 5 -> 2.5 -> 2. With w = 512: 200 -> 400 -> 255. With w = -256: below 0 -> 0.
TEST(VisionReference, ConvolutionRoundsHalvesToEvenAndSaturates) {
  const auto filtered = [](int weight, int pixel) -> int {
    Data data = data_of(tensor_of<std::uint8_t>({1, 1}, {static_cast<std::uint8_t>(pixel)}));
    Tensor weights({"weights", Element::kI16, {7, 7}});
    weights.as<std::int16_t>()[24] = static_cast<std::int16_t>(weight);
    data.parameters.push_back(std::move(weights));
    return make_convolution(1, 1).reference(data)[0].as<std::uint8_t>()[0];
  };
  EXPECT_EQ(filtered(128, 1), 0);
  EXPECT_EQ(filtered(128, 3), 2);
  EXPECT_EQ(filtered(128, 5), 2);
  EXPECT_EQ(filtered(256, 77), 77);
  EXPECT_EQ(filtered(512, 200), 255);
  EXPECT_EQ(filtered(-256, 77), 0);
}

// A correlation, not a mirrored convolution: weight 256 at row 3, column 4 shows the right
// neighbour.
TEST(VisionReference, ConvolutionDoesNotFlipTheKernel) {
  Data data = data_of(tensor_of<std::uint8_t>({1, 3}, {10, 20, 30}));
  Tensor weights({"weights", Element::kI16, {7, 7}});
  weights.as<std::int16_t>()[3 * 7 + 4] = 256;
  data.parameters.push_back(std::move(weights));
  const auto out = make_convolution(3, 1).reference(data);
  EXPECT_EQ(out[0].as<std::uint8_t>()[0], 20);
  EXPECT_EQ(out[0].as<std::uint8_t>()[2], 20);  // reflected
}

TEST(VisionReference, ConvolutionIsOpenCvs) {
  const auto images = generated_images(1);
  for (const auto& [width, height] : kOddSizes) {
    const auto workload = make_convolution(width, height);
    Data data = workload.make_data({.seed = 5, .images = images.get()});
    data.inputs[0] = noise_picture(width, height, 2);
    cv::Mat kernel, expected;
    mat(data.parameters[0], CV_16S).convertTo(kernel, CV_64F, 1.0 / 256.0);
    cv::filter2D(mat(data.inputs[0], CV_8U), expected, CV_8U, kernel);
    EXPECT_EQ(cv::norm(mat(workload.reference(data)[0], CV_8U), expected, cv::NORM_INF), 0.0)
        << width << "x" << height;
  }
}

TEST(VisionReference, ConvolutionWeightsAreGeneralAndKeepTheBrightness) {
  const auto images = generated_images(1);
  for (std::uint64_t seed = 1; seed <= 50; ++seed) {
    const auto data = make_convolution(8, 8).make_data({.seed = seed, .images = images.get()});
    const cv::Mat kernel = mat(data.parameters[0], CV_16S);
    EXPECT_EQ(cv::sum(kernel)[0], 256.0);
    EXPECT_LE(cv::norm(kernel, cv::NORM_INF), 127.0);
    // A separable kernel has rank 1: its second singular value is 0.
    cv::Mat values, singular;
    kernel.convertTo(values, CV_64F);
    cv::SVD::compute(values, singular, cv::SVD::NO_UV);
    EXPECT_GT(singular.at<double>(1), 0.2 * singular.at<double>(0)) << "seed " << seed;
  }
}

// Columns 0 0 10: at the middle Gx = (1+2+1) * (10 - 0) = 40, at the border 0 by reflection; Gy =
// 0. Transposed: the other way round.
TEST(VisionReference, SobelOfAnEdge) {
  const auto upright = make_sobel(3, 3).reference(
      data_of(tensor_of<std::uint8_t>({3, 3}, {0, 0, 10, 0, 0, 10, 0, 0, 10})));
  for (std::size_t y = 0; y < 3; ++y) {
    EXPECT_EQ(upright[0].as<std::int16_t>()[3 * y], 0);
    EXPECT_EQ(upright[0].as<std::int16_t>()[3 * y + 1], 40);
    EXPECT_EQ(upright[0].as<std::int16_t>()[3 * y + 2], 0);
  }
  EXPECT_EQ(std::ranges::count(upright[1].as<std::int16_t>(), 0), 9);
  const auto level = make_sobel(3, 3).reference(
      data_of(tensor_of<std::uint8_t>({3, 3}, {0, 0, 0, 0, 0, 0, 10, 10, 10})));
  EXPECT_EQ(level[1].as<std::int16_t>()[4], 40);
  EXPECT_EQ(std::ranges::count(level[0].as<std::int16_t>(), 0), 9);
}

TEST(VisionReference, SobelIsOpenCvs) {
  for (const auto& [width, height] : kOddSizes) {
    const auto data = data_of(noise_picture(width, height, 3));
    const auto out = make_sobel(width, height).reference(data);
    cv::Mat gx, gy;
    cv::Sobel(mat(data.inputs[0], CV_8U), gx, CV_16S, 1, 0);
    cv::Sobel(mat(data.inputs[0], CV_8U), gy, CV_16S, 0, 1);
    EXPECT_EQ(cv::norm(mat(out[0], CV_16S), gx, cv::NORM_INF), 0.0) << width << "x" << height;
    EXPECT_EQ(cv::norm(mat(out[1], CV_16S), gy, cv::NORM_INF), 0.0) << width << "x" << height;
  }
}

// Without distortion each pixel comes from itself: 32 * x, 32 * y.
TEST(VisionReference, UndistortMapOfAPerfectLensIsTheIdentity) {
  Undistort op;
  op.width = 5;
  op.height = 3;
  op.camera = {.fx = 4, .fy = 4, .cx = 2, .cy = 1};
  const auto map = undistort_map(op);
  ASSERT_EQ(map.size(), 15U);
  EXPECT_EQ(map[0].x, 0);
  EXPECT_EQ(map[14].x, 32 * 4);
  EXPECT_EQ(map[14].y, 32 * 2);
}

// At column 3 of a camera with f = 1, c = 2 and k1 = 0.5: x = 1, y = 0, r2 = 1, x' = 1 * 1.5, u = 2
// + 1.5 = 3.5; p1 adds r2 to y': 0.25; p2 adds r2 + 2 x2 = 3 to x': u = 3.5 + 3 * 0.125 = 3.875 ->
// 124; v = 0 + 0.25 -> 8.
TEST(VisionReference, UndistortMapFollowsTheRadialTangentialModel) {
  Undistort op;
  op.width = 4;
  op.height = 1;
  op.camera = {.fx = 1, .fy = 1, .cx = 2, .cy = 0, .k1 = 0.5, .k2 = 0, .p1 = 0.25, .p2 = 0.125};
  const auto entry = undistort_map(op)[3];
  EXPECT_EQ(entry.x, 124);
  EXPECT_EQ(entry.y, 8);
}

// Observed: no entry differs in 56 million over 400 sizes. Both round 32 u to even; only their
// order of operations differs.
TEST(VisionReference, UndistortMapIsOpenCvs) {
  for (const auto& [width, height] : kOddSizes) {
    const auto workload = make_undistort(width, height);
    const auto& op = operation_as<Undistort>(workload);
    const auto& c = op.camera;
    const cv::Matx33d matrix(c.fx, 0, c.cx, 0, c.fy, c.cy, 0, 0, 1);
    cv::Mat positions, fractions;
    cv::initUndistortRectifyMap(matrix, cv::Vec4d(c.k1, c.k2, c.p1, c.p2), cv::noArray(), matrix,
                                {width, height}, CV_16SC2, positions, fractions);
    const auto map = undistort_map(op);
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) {
        const auto& entry = map[static_cast<std::size_t>(y) * static_cast<std::size_t>(width) +
                                static_cast<std::size_t>(x)];
        const auto position = positions.at<cv::Vec2s>(y, x);
        const int fraction = fractions.at<std::uint16_t>(y, x);
        ASSERT_EQ(entry.x, position[0] * 32 + fraction % 32) << x << "," << y;
        ASSERT_EQ(entry.y, position[1] * 32 + fraction / 32) << x << "," << y;
      }
    }
  }
}

TEST(VisionReference, UndistortIsOpenCvsRemap) {
  for (const auto& [width, height] : kOddSizes) {
    const auto workload = make_undistort(width, height);
    const auto data = data_of(noise_picture(width, height, 4));
    cv::Mat positions(height, width, CV_16SC2), fractions(height, width, CV_16U), expected;
    const auto map = undistort_map(operation_as<Undistort>(workload));
    for (int i = 0; i < width * height; ++i) {
      const auto& entry = map[static_cast<std::size_t>(i)];
      positions.at<cv::Vec2s>(i / width, i % width) = {static_cast<short>(entry.x >> 5),
                                                       static_cast<short>(entry.y >> 5)};
      fractions.at<std::uint16_t>(i / width, i % width) =
          static_cast<std::uint16_t>((entry.y & 31) * 32 + (entry.x & 31));
    }
    cv::remap(mat(data.inputs[0], CV_8U), expected, positions, fractions, cv::INTER_LINEAR);
    EXPECT_EQ(cv::norm(mat(workload.reference(data)[0], CV_8U), expected, cv::NORM_INF), 0.0)
        << width << "x" << height;
  }
}

// The lens moves the corner of a picture inwards: 640x480 takes its corner from outside, the middle
// from itself.
TEST(VisionReference, UndistortBendsThePictureVisibly) {
  const auto workload = make_undistort(640, 480);
  const auto map = undistort_map(operation_as<Undistort>(workload));
  EXPECT_GT(map[0].x, 32 * 20);
  EXPECT_GT(map[0].y, 32 * 20);
  EXPECT_NEAR(map[248 * 640 + 312].x, 32 * 312, 32);
  EXPECT_NEAR(map[248 * 640 + 312].y, 32 * 248, 32);
}

std::vector<std::pair<int, int>> corners_of(const std::vector<Tensor>& outputs) {
  std::vector<std::pair<int, int>> corners;
  const auto xy = outputs[0].used<double>();
  for (std::size_t i = 0; i < xy.size(); i += 2) {
    corners.emplace_back(static_cast<int>(xy[i]), static_cast<int>(xy[i + 1]));
  }
  return corners;
}

// A bright square of 12 pixels has four corners of equal strength: the later in memory comes first,
// so bottom right, bottom left, top right, top left. The 3x3 block around the square's corner pixel
// (or its outer diagonal neighbour, by symmetry of the sum) holds most gradient; whichever it is,
// it is the same for all four and within a pixel of the square's corner.
TEST(VisionReference, CornersOfASquareComeLastInMemoryFirst) {
  Tensor image({"image", Element::kU8, {40, 40}});
  for (std::size_t y = 14; y < 26; ++y) {
    for (std::size_t x = 14; x < 26; ++x) image.as<std::uint8_t>()[y * 40 + x] = 200;
  }
  const auto corners = corners_of(make_feature_detect(40, 40).reference(data_of(std::move(image))));
  const std::vector<std::pair<int, int>> expected = {{25, 25}, {14, 25}, {25, 14}, {14, 14}};
  ASSERT_EQ(corners.size(), 4U);
  for (std::size_t i = 0; i < 4; ++i) {
    EXPECT_NEAR(corners[i].first, expected[i].first, 1) << i;
    EXPECT_NEAR(corners[i].second, expected[i].second, 1) << i;
  }
}

TEST(VisionReference, ConstantPicturesAndStraightEdgesHaveNoCorners) {
  EXPECT_TRUE(corners_of(make_feature_detect(30, 20).reference(
                             data_of(Tensor({"image", Element::kU8, {20, 30}}))))
                  .empty());
  Tensor edge({"image", Element::kU8, {20, 30}});
  for (std::size_t i = 0; i < 600; ++i) edge.as<std::uint8_t>()[i] = i % 30 < 11 ? 3 : 250;
  EXPECT_TRUE(corners_of(make_feature_detect(30, 20).reference(data_of(std::move(edge)))).empty());
}

TEST(VisionReference, CornersAreOpenCvsInOrder) {
  const auto images = generated_images(9);
  for (const auto& [width, height] : kOddSizes) {
    const auto workload = make_feature_detect(width, height);
    const auto data = workload.make_data({.seed = 1, .images = images.get()});
    std::vector<cv::Point2f> expected;
    cv::goodFeaturesToTrack(mat(data.inputs[0], CV_8U), expected, 500, 0.01, 10.0, cv::noArray(),
                            3);
    const auto corners = corners_of(workload.reference(data));
    ASSERT_EQ(corners.size(), expected.size()) << width << "x" << height;
    for (std::size_t i = 0; i < corners.size(); ++i) {
      EXPECT_EQ(corners[i].first, expected[i].x) << i;
      EXPECT_EQ(corners[i].second, expected[i].y) << i;
    }
  }
}

Data pair_of(Tensor previous, Tensor next) {
  Data data = data_of(std::move(previous));
  data.inputs.push_back(std::move(next));
  return data;
}

/// The flow of one pixel straight from the definition: no tables, all 52 x 52 products anew.
std::pair<double, double> flow_by_definition(const Data& data, int width, int height, int x,
                                             int y) {
  const auto at = [&](const Tensor& image, int column, int row) -> std::int64_t {
    column = std::clamp(column, 0, width - 1);
    row = std::clamp(row, 0, height - 1);
    return image
        .as<std::uint8_t>()[static_cast<std::size_t>(row) * static_cast<std::size_t>(width) +
                            static_cast<std::size_t>(column)];
  };
  const Tensor& previous = data.inputs[0];
  std::int64_t xx = 0, xy = 0, yy = 0, xt = 0, yt = 0;
  for (int j = y - 26; j <= y + 25; ++j) {
    for (int i = x - 26; i <= x + 25; ++i) {
      const int column = std::clamp(i, 0, width - 1);  // the products are replicated
      const int row = std::clamp(j, 0, height - 1);
      const auto dx = at(previous, column + 1, row) - at(previous, column - 1, row);
      const auto dy = at(previous, column, row + 1) - at(previous, column, row - 1);
      const auto dt = at(data.inputs[1], column, row) - at(previous, column, row);
      xx += dx * dx;
      xy += dx * dy;
      yy += dy * dy;
      xt += dx * dt;
      yt += dy * dt;
    }
  }
  const std::int64_t det = xx * yy - xy * xy;
  if (det == 0) return {0.0, 0.0};
  return {static_cast<double>(2 * (xy * yt - yy * xt)) / static_cast<double>(det),
          static_cast<double>(2 * (xy * xt - xx * yt)) / static_cast<double>(det)};
}

TEST(VisionReference, FlowIsThatOfTheDefinition) {
  for (const auto& [width, height] : kOddSizes) {
    const auto data = pair_of(noise_picture(width, height, 5), noise_picture(width, height, 6));
    const auto out = make_optical_flow(width, height).reference(data);
    for (const auto& [x, y] : {std::pair(0, 0),
                               {width - 1, 0},
                               {0, height - 1},
                               {width - 1, height - 1},
                               {width / 2, height / 2},
                               {width / 3, height / 5}}) {
      const auto [u, v] = flow_by_definition(data, width, height, x, y);
      const auto* got =
          out[0].as<double>().data() + std::ptrdiff_t{2} * (std::ptrdiff_t{y} * width + x);
      EXPECT_EQ(got[0], u) << width << "x" << height << " at " << x << "," << y;
      EXPECT_EQ(got[1], v) << width << "x" << height << " at " << x << "," << y;
    }
  }
}

// Vertical stripes have no dy: det = 0 everywhere (the aperture problem), although the picture
// moves.
TEST(VisionReference, FlowIsZeroWhereTheSystemIsSingular) {
  Tensor previous({"previous", Element::kU8, {60, 80}});
  Tensor next({"next", Element::kU8, {60, 80}});
  for (std::size_t i = 0; i < 4800; ++i) {
    previous.as<std::uint8_t>()[i] = static_cast<std::uint8_t>(i % 80 * 3);
    next.as<std::uint8_t>()[i] = static_cast<std::uint8_t>(i % 80 * 3 / 2);
  }
  const auto out =
      make_optical_flow(80, 60).reference(pair_of(std::move(previous), std::move(next)));
  EXPECT_EQ(std::ranges::count(out[0].as<double>(), 0.0), 2 * 4800);
}

// The generated pair moves by (0.75, -0.5). Observed medians over four seeds: 0.733 .. 0.740 and
// -0.485 .. -0.504; a single linear step is not exact.
TEST(VisionReference, FlowOfTheGeneratedPairIsItsMotion) {
  const auto images = generated_images(1);
  const auto workload = make_optical_flow(320, 240);
  const auto out = workload.reference(workload.make_data({.seed = 1, .images = images.get()}));
  std::vector<double> u, v;
  for (std::size_t i = 0; i < 320UL * 240; ++i) {
    u.push_back(out[0].as<double>()[2 * i]);
    v.push_back(out[0].as<double>()[2 * i + 1]);
  }
  std::ranges::sort(u);
  std::ranges::sort(v);
  EXPECT_NEAR(u[u.size() / 2], 0.75, 0.05);
  EXPECT_NEAR(v[v.size() / 2], -0.5, 0.05);
}

}  // namespace
}  // namespace pirt::vision
