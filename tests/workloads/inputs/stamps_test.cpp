// Time and cameras of foreign sequences: what is kept, paired, converted and refused, by numbers
// worked by hand.
#include "workloads/inputs/sequence/stamps.h"

#include <fmt/core.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <numbers>
#include <opencv2/calib3d.hpp>

#include "tests/support/errors.h"
#include "tests/workloads/inputs/sequence_support.h"
#include "workloads/inputs/pictures/recorded_picture.h"
#include "workloads/inputs/recording/messages.h"
#include "workloads/inputs/recording/recording.h"
#include "workloads/inputs/recording/restarts.h"
#include "workloads/inputs/sequence/bad_pictures.h"
#include "workloads/inputs/sequence/calibration_file.h"
#include "workloads/inputs/sequence/camera_info.h"
#include "workloads/inputs/sequence/imu_check.h"
#include "workloads/inputs/sequence/recorded.h"
#include "workloads/inputs/sequence/recorded_calibration.h"

namespace pirt {
namespace {

namespace fs = std::filesystem;
using test::bad_input;
using test::put;
using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

std::vector<Nanos> ms(const std::vector<double>& times) {
  std::vector<Nanos> stamps;
  for (const double time : times) stamps.push_back(from_ms(time));
  return stamps;
}

TEST(Stamps, KeepTheLongestRunThatRises) {
  EXPECT_THAT(rising(ms({1, 2, 3})), ElementsAre(0, 1, 2));
  // The one far ahead goes, not all that come after it.
  EXPECT_THAT(rising(ms({1, 2, 86'400'000, 3, 4})), ElementsAre(0, 1, 3, 4));
  EXPECT_THAT(rising(ms({5, 5, 6})), testing::SizeIs(2));
  EXPECT_THAT(rising(ms({0, 7, 0, 8}), Nanos::zero()), ElementsAre(1, 3)) << "0 is none";
  EXPECT_THAT(rising({}), IsEmpty());
  std::vector<std::string> warnings;
  tell_of_rising("/t", 3, 4, warnings);
  EXPECT_THAT(warnings, ElementsAre(HasSubstr("1 of 4 stamps of /t")));
  EXPECT_THAT(bad_input([&] { tell_of_rising("/t", 1, 4, warnings); }), HasSubstr("do not rise"));
}

TEST(Stamps, OfAClockThatBeginsAnewAreOfItsLongestRun) {
  struct Row {
    Nanos time;
    char run;
  };
  std::vector<Row> rows;
  const auto add = [&rows](char run, int first, int last, int step) {
    for (int i = first; i <= last; i += step) rows.push_back({from_ms(50.0 * i), run});
  };
  // Up to 1 s of A and from there B would be more than B alone.
  add('A', 1, 60, 1);
  add('B', 2, 20, 2);
  add('B', 21, 120, 1);
  std::vector<std::string> warnings;
  keep_rising(rows, "/t", warnings);
  EXPECT_EQ(rows.size(), 110U);
  EXPECT_TRUE(std::ranges::all_of(rows, [](const Row& row) { return row.run == 'B'; }));
  EXPECT_THAT(warnings, ElementsAre(HasSubstr("the clock of /t begins anew after 60 messages")));
  EXPECT_THAT(restarts_of(ms({1, 2, 86'400'000, 3, 4, 5})), IsEmpty()) << "one is far ahead";
  EXPECT_THAT(restarts_of(ms({5000, 5050, 5100, 1, 5150, 5200})), IsEmpty()) << "one is late";
  EXPECT_THAT(restarts_of(ms({5000, 5050, 5100, 9000, 9050, 9100, 5150, 5200, 5250})), IsEmpty());
  EXPECT_THAT(restarts_of(ms({5000, 5050, 5100, 1000, 1050, 1100, 5150, 5200, 5250})), IsEmpty());
  const auto half = ms({5000, 5050, 5100, 4600, 4650, 4700});
  EXPECT_THAT(restarts_of(half), IsEmpty());
  EXPECT_THAT(restarts_of(half, from_ms(100)), ElementsAre(3));
  const auto at_10_hz = ms({1000, 1100, 1200, 1050, 1150, 1250});
  EXPECT_THAT(restarts_of(at_10_hz, from_ms(100)), ElementsAre(3));
  const auto one_late = ms({5000, 5050, 5100, 4850, 5150, 5200});
  EXPECT_THAT(restarts_of(one_late, from_ms(100)), IsEmpty());
  const auto one_ahead = ms({1000, 1100, 1500, 1300, 1400});
  EXPECT_THAT(restarts_of(one_ahead, from_ms(100)), IsEmpty());
  const auto two_swapped = ms({1000, 1150, 1450, 1300, 1600, 1750});
  EXPECT_THAT(restarts_of(two_swapped, from_ms(100)), IsEmpty());
  const auto two_in_turns = ms({1000, 1010, 800, 1030, 820, 1050, 840, 1060, 1070});
  EXPECT_THAT(restarts_of(two_in_turns, from_ms(100)), IsEmpty());
}

TEST(Stamps, ArePlayedWithoutTheirPauses) {
  EXPECT_EQ(playing_times(ms({7, 57, 107, 86'400'107, 86'400'157})), ms({0, 50, 100, 150, 200}));
  EXPECT_EQ(playing_times(ms({0, 50, 100, 20'100})), ms({0, 50, 100, 20'100}));
  EXPECT_EQ(playing_times(ms({0, 60'000, 120'000})), ms({0, 60'000, 120'000})) << "as usual";
  EXPECT_THAT(playing_times({}), IsEmpty());
  EXPECT_EQ(usual_rate_hz(ms({0, 50, 100, 86'400'000}), 1), 20);
  EXPECT_EQ(usual_rate_hz(ms({5}), 1), 1);
}

TEST(Stamps, OfBurstsHaveTheRateOfTheirSamples) {
  for (const int burst : {1, 2, 3, 4}) {
    std::vector<double> times;
    for (int i = 0; i < 400; ++i) {
      const int whole = i / burst;
      const double pause_ms = i < 200 ? 0 : 600'000;
      times.push_back(5.0 * burst * whole + 0.1 * (i % burst) + pause_ms);
    }
    EXPECT_NEAR(usual_rate_hz(ms(times), 1), 200, 4) << burst;
  }
}

TEST(Stamps, OfSamplesThatCameInBurstsAreMadeEven) {
  for (const int burst : {1, 2, 4}) {
    std::vector<ImuSample> imu;
    for (int i = 0; i < 400; ++i) {
      const double pause_ms = i < 200 ? 0 : 600'000;
      const int whole = i / burst;
      imu.push_back({.time = from_ms(5.0 * burst * whole + 0.1 * (i % burst) + pause_ms)});
    }
    const auto recorded = stamps_of(imu);
    std::vector<std::string> warnings;
    spread_bursts(imu, "/imu", warnings);
    EXPECT_EQ(warnings.size(), burst > 1 ? 1U : 0U) << burst;
    EXPECT_EQ(stamps_of(imu) == recorded, burst == 1) << burst;
    for (std::size_t i = 4; i < imu.size(); ++i) {
      const double step_ms = to_ms(imu[i].time - imu[i - 1].time);
      if (i == 200) {
        EXPECT_GT(step_ms, 590'000) << "the pause stays";
      } else {
        EXPECT_NEAR(step_ms, 5, 0.2) << burst << ", " << i;
      }
    }
  }
}

TEST(Stamps, OfBurstsOfAnySizeAreMadeEven) {
  constexpr int kSamples = 4000;  // whole bursts; what is behind them must not matter
  for (const int burst : {5, 10, 16, 20}) {
    for (const int more : {0, 5}) {
      std::vector<ImuSample> imu;
      for (int i = 0; i < kSamples + more; ++i) {
        imu.push_back({.time = from_ms(burst * (1 + i / burst) + 0.004 * (i % burst))});
      }
      std::vector<std::string> warnings;
      spread_bursts(imu, "/imu", warnings);
      EXPECT_EQ(warnings.size(), 1U) << burst;
      EXPECT_NEAR(usual_rate_hz(stamps_of(imu), 1), 1000, 40) << burst << ", " << more;
      imu.resize(kSamples);
      for (std::size_t i = 1; i < imu.size(); ++i) {
        ASSERT_NEAR(to_ms(imu[i].time - imu[i - 1].time), 1, 0.04) << burst << ", " << i;
      }
    }
  }
}

TEST(Stamps, OfABurstMayBeOne) {
  const auto read = [](double figure) {
    std::string text;
    for (int i = 0; i < 400; ++i) {
      const double turns = figure * i;
      text += fmt::format("{},{},{},{},{},{},{}\n", 20'000'000 * (1 + i / 4), turns, 2 * turns,
                          3 * turns, turns, turns, 9 + turns);
    }
    const test::ScratchFolder folder;
    put(folder.path() / "data.csv", text);
    std::vector<std::string> warnings;
    return read_imu_csv(folder.path() / "data.csv", warnings);
  };
  auto imu = read(1e-3);
  ASSERT_EQ(imu.size(), 400U);
  std::vector<std::string> warnings;
  spread_bursts(imu, "/imu", warnings);
  EXPECT_EQ(warnings.size(), 1U);
  for (std::size_t i = 1; i < imu.size(); ++i) {
    ASSERT_NEAR(to_ms(imu[i].time - imu[i - 1].time), 5, 0.2) << i;
  }
  EXPECT_THAT(bad_input([&] { static_cast<void>(read(0)); }), HasSubstr("300 of 400 stamps"))
      << "each recorded four times";
}

TEST(Stamps, ArePairedByTimeAndNotByPosition) {
  std::vector<std::string> warnings;
  const auto pair = [&](const std::vector<double>& left, const std::vector<double>& right) {
    return pair_stamps(ms(left), ms(right), kPairTolerance, warnings);
  };
  EXPECT_THAT(pair({0, 50, 100}, {0, 100, 150}), ElementsAre(0, std::nullopt, 1));
  EXPECT_THAT(warnings, IsEmpty());
  EXPECT_THAT(pair({0, 50, 100}, {2, 53, 104}), ElementsAre(0, 1, std::nullopt));
  EXPECT_THAT(warnings, ElementsAre(AllOf(HasSubstr("3.000 ms apart"), HasSubstr("up to 3.0"))));
  // Of 500 Hz a third of a period, and each has one partner.
  EXPECT_THAT(pair({0, 2, 4}, {1, 3, 5}), testing::Each(std::nullopt));
  EXPECT_THAT(pair({0, 50}, {}), testing::Each(std::nullopt));
}

TEST(Stamps, TellThatTheirUnitIsAnother) {
  const auto microseconds = std::vector{Nanos(50'000), Nanos(100'000), Nanos(150'000)};
  EXPECT_THAT(bad_input([&] { check_step("'data.csv'", microseconds, 20.0); }),
              AllOf(HasSubstr("'data.csv'"), HasSubstr("20000 Hz"), HasSubstr("microseconds?")));
  EXPECT_THAT(bad_input([] {
                check_step("t", {Nanos(1), Nanos(6), Nanos(11)});
              }),
              HasSubstr("of another unit"));
  check_step("t", ms({0, 1000, 2000}), 20.0);  // every twentieth picture
}

TEST(Lens, IsThatOfOpenCv) {
  const CameraModel plain = [] {
    CameraModel made;
    made.width = 640, made.height = 480;
    made.fx = 300, made.fy = 310, made.cx = 320, made.cy = 240;
    return made;
  }();
  CameraModel camera = plain;
  const cv::Matx33d k(300, 0, 320, 0, 310, 240, 0, 0, 1);
  const std::vector<cv::Point3d> points = {
      {0.2, -0.3, 1}, {0.7, 0.5, 1}, {-0.9, 0.1, 1}, {0, 0, 1}};
  const auto expect = [&](const std::vector<cv::Point2d>& pixels) {
    for (std::size_t i = 0; i < points.size(); ++i) {
      const Eigen::Vector2d ray(points[i].x, points[i].y);
      const Eigen::Vector2d pixel = camera.project(ray);
      EXPECT_NEAR(pixel.x(), pixels[i].x, 1e-9) << i;
      EXPECT_NEAR(pixel.y(), pixels[i].y, 1e-9) << i;
      EXPECT_LT((camera.ray(pixel) - ray).norm(), 1e-9) << i;
    }
  };
  std::vector<cv::Point2d> pixels;
  const std::vector<double> rational = {0.3, 0.02, 1e-3, -2e-3, 0.01, 0.5, 0.04, 0.003};
  ASSERT_EQ(set_lens(camera, "rational_polynomial", rational), "");
  cv::projectPoints(points, cv::Vec3d(), cv::Vec3d(), k, rational, pixels);
  expect(pixels);
  camera = plain;
  ASSERT_EQ(set_lens(camera, "equidistant", {0.01, -0.02, 0.003, 0.001}), "");
  cv::fisheye::projectPoints(points, pixels, cv::Vec3d(), cv::Vec3d(), k,
                             cv::Vec4d(0.01, -0.02, 0.003, 0.001));
  expect(pixels);
  camera.fx = camera.fy = 200;  // 320 / 200 rad to either side
  EXPECT_THAT(set_lens(camera, "equidistant", {}), HasSubstr("equidistant"));
  EXPECT_THAT(set_lens(camera, "plumb_bob", {1, 2, 3, 4, 5, 6}), HasSubstr("6 coefficients"));
}

class Info : public testing::Test {
 protected:
  [[nodiscard]] InfoCamera camera(bool rectified) const {
    return camera_of(WireReader("", WireFormat::kRos1, "it"), info_, rectified);
  }
  CameraInfoMessage info_{.head = {},
                          .width = 640,
                          .height = 480,
                          .distortion_model = "plumb_bob",
                          .d = {0.1, 0, 0, 0, 0.01},
                          .k = {400, 0, 320, 0, 410, 240, 0, 0, 1},
                          .p = {300, 0, 310, -60, 0, 300, 230, 0, 0, 0, 1, 0},
                          .r = {0, -1, 0, 1, 0, 0, 0, 0, 1}};
};

TEST_F(Info, IsReadAsThePicturesAre) {
  const InfoCamera raw = camera(false);
  EXPECT_EQ(raw.model.fx, 400);
  EXPECT_EQ(raw.model.k3, 0.01);
  EXPECT_EQ(raw.right_m, 0.2);
  const InfoCamera rectified = camera(true);
  EXPECT_EQ(rectified.model.fx, 300);
  EXPECT_EQ(rectified.model.cy, 230);
  EXPECT_EQ(rectified.model.k1, 0);
  // R turns x of the camera to y of the rectified picture. A right camera that is 0.2 m along x of
  // the rectified pictures is, in the left camera's axes, at R^T (0.2, 0, 0) = (0, -0.2, 0).
  InfoCamera left = raw, left_rectified = rectified;
  left.right_m = left_rectified.right_m = 0;
  EXPECT_TRUE(left.pose_of(raw).position.isApprox(Eigen::Vector3d(0, -0.2, 0)));
  EXPECT_TRUE(raw.pose_of(raw).rotation.isIdentity());
  EXPECT_TRUE(left_rectified.pose_of(rectified).position.isApprox(Eigen::Vector3d(0.2, 0, 0)));
  EXPECT_TRUE(rectified.pose_of(raw).rotation.isApprox(raw.rectified_from_raw));
  info_.p[0] = 3;
  EXPECT_THAT(bad_input([this] { static_cast<void>(camera(true)); }), HasSubstr("in P"));
  info_.p.assign(12, 0), info_.k.assign(9, 0);
  EXPECT_THAT(bad_input([this] { static_cast<void>(camera(true)); }),
              AllOf(HasSubstr("not calibrated (P[0]"), HasSubstr("--calibration")));
  EXPECT_THAT(bad_input([this] { static_cast<void>(camera(false)); }),
              AllOf(HasSubstr("not calibrated (K[0]"), HasSubstr("--calibration")));
}

TEST_F(Info, OfAPartOfTheSensorIsBroughtToThePicture) {
  info_.binning_x = info_.binning_y = 2;
  info_.roi_x = 100, info_.roi_y = 40, info_.roi_width = 400, info_.roi_height = 300;
  const CameraModel model = camera(false).model;
  EXPECT_EQ(std::pair(model.width, model.height), std::pair(200, 150));
  EXPECT_EQ(std::pair(model.fx, model.fy), std::pair(200.0, 205.0));
  EXPECT_EQ(std::pair(model.cx, model.cy), std::pair(110.0, 100.0));
}

// K_00, K_02 and P_rect_00 of 2011_09_26: K is of 1392x512 pixels, P of those that are recorded.
TEST_F(Info, OfKittiSeemsToBeOfRectifiedPictures) {
  info_.width = 1242, info_.height = 375;
  info_.p = {721.5, 0, 609.6, 0, 0, 721.5, 172.9, 0, 0, 0, 1, 0};
  info_.k = {984.2, 0, 690.0, 0, 980.8, 233.2, 0, 0, 1};
  EXPECT_TRUE(seems_rectified(info_));
  info_.k = {959.8, 0, 696.0, 0, 956.9, 224.2, 0, 0, 1};
  EXPECT_TRUE(seems_rectified(info_));
}

TEST_F(Info, OfAPartOfTheSensorDoesNot) {
  EXPECT_FALSE(seems_rectified(info_));
  info_.binning_x = info_.binning_y = 2;
  EXPECT_FALSE(seems_rectified(info_));
  // The centres are at (0.55, 0.67) of the region by K, and at (0.53, 0.63) by P.
  info_.roi_x = 100, info_.roi_y = 40, info_.roi_width = 400, info_.roi_height = 300;
  EXPECT_FALSE(seems_rectified(info_));
  info_.p.assign(12, 0);
  EXPECT_FALSE(seems_rectified(info_));
}

TEST(Calibration, IsReadFromKalibrsFileAndThoseOfRos) {
  const test::ScratchFolder scratch;
  const fs::path file = scratch.path() / "camchain.yaml";
  const std::string camera =
      "  camera_model: pinhole\n  distortion_coeffs: [0.1, 0.2, 0.003, 0.004]\n"
      "  distortion_model: radtan\n  intrinsics: [400, 410, 320, 240]\n  resolution: [640, 480]\n";
  const std::string rows =
      "\n  - [1, 0, 0, -0.1]\n  - [0, 1, 0, 0]\n  - [0, 0, 1, 0]\n"
      "  - [0, 0, 0, 1]\n";
  put(file, "cam0:\n" + camera + "  rostopic: /a\n  T_cam_imu:" + rows + "cam1:\n" + camera +
                "  T_cn_cnm1:" + rows);
  const auto cameras = read_calibration(file);
  ASSERT_EQ(cameras.size(), 2U);
  EXPECT_EQ(cameras[0].topic, "/a");
  EXPECT_EQ(cameras[0].model.p2, 0.004);
  EXPECT_EQ(cameras[0].body_from_camera->position.x(), 0.1);
  EXPECT_EQ(cameras[1].first_from_camera->position.x(), 0.1);
  put(file, "cam0:\n" + camera + "  T_imu_cam:" + rows);
  EXPECT_EQ(read_calibration(file)[0].body_from_camera->position.x(), -0.1);
  put(file,
      "image_width: 640\nimage_height: 480\ncamera_matrix: {rows: 3, cols: 3, data: [400, 0, 320, "
      "0, 410, 240, 0, 0, 1]}\ndistortion_model: plumb_bob\ndistortion_coefficients: {data: [0.1, "
      "0, 0, 0, 0]}\n");
  EXPECT_EQ(read_calibration(file)[0].model.fy, 410);
  put(file, "cam0: {camera_model: omni}\n");
  EXPECT_THAT(bad_input([&] { static_cast<void>(read_calibration(file)); }),
              AllOf(HasSubstr("camchain.yaml:1"), HasSubstr("pinhole")));
  put(file, "name: x\n");
  EXPECT_THAT(bad_input([&] { static_cast<void>(read_calibration(file)); }), HasSubstr("Kalibr"));
}

TEST(Calibration, OfOpenCvsOwnFileHasTheLensOfItsFlags) {
  const test::ScratchFolder scratch;
  const fs::path file = scratch.path() / "camera.yml";
  const auto model = [&](const std::string& flags, const std::string& lens) {
    put(file, "%YAML:1.0\n---\nimage_width: 640\nimage_height: 480\n" + flags +
                  "camera_matrix: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n"
                  "   data: [ 4.0e+02, 0., 320., 0., 4.0e+02, 240., 0., 0., 1. ]\n"
                  "distortion_coefficients: !!opencv-matrix\n   rows: 1\n   dt: d\n   data: [ " +
                  lens + " ]\n");
    return read_calibration(file)[0].model;
  };
  const CameraModel fisheye = model("fisheye_model: 1\n", "-0.01, 0.02, -0.008, 0.001");
  EXPECT_EQ(fisheye.lens, Lens::kEquidistant);
  EXPECT_EQ(fisheye.k4, 0.001);
  const CameraModel plain = model("fisheye_model: 0\n", "0.1, 0.02, 0.003, 0.004, 0.005");
  EXPECT_EQ(plain.lens, Lens::kRadialTangential);
  EXPECT_EQ(std::pair(plain.p2, plain.k3), std::pair(0.004, 0.005));
  EXPECT_EQ(model("", "0.1, 0.02, 0.003, 0.004, 0.005, 0.6, 0.07, 0.008").k6, 0.008);
}

/// Calibrations of a recording of nothing.
class GivenCalibration : public testing::Test {
 protected:
  void SetUp() override {
    const auto writer = make_bag(scratch_.path() / "a.bag");
    writer->write("/imu", ImuMessage::kType, Nanos(1), written(ImuMessage{}, WireFormat::kRos1));
    writer->publish();
  }
  [[nodiscard]] RecordedCalibration of(const std::string& topic, std::size_t place) {
    const auto recording = open_recording(scratch_.path() / "a.bag");
    return RecordedCalibrations(*recording, file_).of(topic, place, warnings_);
  }

  const test::ScratchFolder scratch_;
  const fs::path file_ = scratch_.path() / "calibration.yaml";
  std::vector<std::string> warnings_;
};

TEST_F(GivenCalibration, IsOfTheTopicThatItNames) {
  std::string chain;
  const char* const topics[] = {"/right/image_raw", "/left/image_raw", "/c", "/d"};
  for (int i = 0; i < 4; ++i) {
    chain += fmt::format(
        "cam{}:\n  distortion_model: none\n  intrinsics: [{}, 400, 320, 240]\n"
        "  resolution: [640, 480]\n  rostopic: {}\n",
        i, 400 + 10 * i, topics[i]);
    if (i > 0) {
      chain += "  T_cn_cnm1: [[1, 0, 0, -0.1], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]\n";
    }
  }
  put(file_, chain);
  EXPECT_EQ(of("/left/image_raw/compressed", 0).camera.model.fx, 410);
  const auto last = of("/d", 1);
  EXPECT_EQ(last.camera.model.fx, 430);
  EXPECT_NEAR(last.given->first_from_camera->position.x(), 0.3, 1e-12);
  EXPECT_THAT(warnings_, IsEmpty());
  EXPECT_EQ(of("/e", 1).camera.model.fx, 410);
  EXPECT_THAT(warnings_, ElementsAre(HasSubstr("of /left/image_raw is taken for /e")));
}

TEST_F(GivenCalibration, OfAFolderIsOfTheCameraOfItsName) {
  test::write_small_sequence(file_);
  const Sequence folder = read_sequence(file_);
  const auto right = of("/cam1/image_raw", 0);
  EXPECT_TRUE(right.given->body_from_camera->position.isApprox(
      folder.cameras[1].body_from_camera.position, 1e-12));
  EXPECT_THAT(warnings_, IsEmpty());
  static_cast<void>(of("/left", 0));
  EXPECT_THAT(warnings_, ElementsAre(HasSubstr("of /cam0/image_raw is taken for /left")));
}

TEST_F(GivenCalibration, OfRosTurnsRectifiedPictures) {
  const Eigen::Matrix3d r = rotation_of({0, 0.05, 0});
  put(file_,
      fmt::format("image_width: 640\nimage_height: 480\n"
                  "camera_matrix: {{data: [400, 0, 320, 0, 410, 240, 0, 0, 1]}}\n"
                  "distortion_coefficients: {{data: [0.1, 0, 0, 0, 0]}}\n"
                  "rectification_matrix: {{data: [{}, {}, {}, {}, {}, {}, {}, {}, {}]}}\n"
                  "projection_matrix: {{data: [300, 0, 310, 0, 0, 300, 230, 0, 0, 0, 1, 0]}}\n",
                  r(0, 0), r(0, 1), r(0, 2), r(1, 0), r(1, 1), r(1, 2), r(2, 0), r(2, 1), r(2, 2)));
  const InfoCamera rectified = of("/camera/image_rect", 0).camera;
  EXPECT_EQ(rectified.model.fx, 300);
  EXPECT_TRUE(rectified.picture_from_raw().isApprox(r, 1e-12));
  EXPECT_TRUE(of("/camera/image_raw", 0).camera.picture_from_raw().isIdentity());
  EXPECT_THAT(warnings_, IsEmpty());
}

TEST(Imu, ThatIsDeadOrStuckIsRefused) {
  std::vector<ImuSample> imu;
  for (int i = 0; i < 200; ++i) {
    const double noise = 1e-3 * std::sin(i);
    imu.push_back(
        {from_ms(5.0 * (i + 1)), {noise, 2 * noise, -noise}, {noise, -noise, 9.8 + noise}});
  }
  std::vector<std::string> warnings;
  const auto check = [&](const auto& change) {
    auto changed = imu;
    for (ImuSample& sample : changed) change(sample);
    check_imu("t", changed, warnings);
  };
  check([](auto&) {});
  EXPECT_THAT(bad_input([&] { check([](auto& s) { s.gyro_rad_s.setZero(); }); }),
              AllOf(HasSubstr("angular velocity"), HasSubstr("all 200 samples")));
  EXPECT_THAT(bad_input([&] { check([](auto& s) { s.accel_m_s2.z() = 9.8; }); }),
              HasSubstr("axis z of the acceleration is stuck"));
  // A simulated robot in the plane, without noise.
  check([](auto& s) { s.gyro_rad_s.x() = s.gyro_rad_s.y() = 0; });
  EXPECT_THAT(warnings, IsEmpty());
}

TEST(Imu, AFewSamplesThatNoSensorMeasuresAreLeftOut) {
  std::vector<ImuSample> imu;
  for (int i = 0; i < 400; ++i) {
    const double noise = 1e-3 * std::sin(i);
    imu.push_back(
        {from_ms(5.0 * (i + 1)), {noise, 2 * noise, -noise}, {noise, -noise, 9.8 + noise}});
  }
  imu[100].accel_m_s2.x() = 1e6;
  imu[200].gyro_rad_s.z() = 1e4;
  std::vector<std::string> warnings;
  check_imu("/imu", imu, warnings);
  EXPECT_EQ(imu.size(), 398U);
  EXPECT_THAT(warnings, ElementsAre(HasSubstr("2 of 400 samples")));
  for (int i = 0; i < 10; ++i) imu[static_cast<std::size_t>(30 * i)].accel_m_s2.x() = 1e6;
  EXPECT_THAT(bad_input([&] { check_imu("/imu", imu, warnings); }),
              HasSubstr("more than accelerometers measure"));
}

/// Of 160 frames, of which those that are called bad cannot be read.
Sequence with_bad_frames(std::size_t cameras, const std::function<bool(std::size_t)>& is_bad) {
  Sequence sequence;
  sequence.cameras.resize(cameras);
  sequence.frames.assign(160, Frame{Nanos(0), std::vector<bool>(cameras, true)});
  sequence.image = [is_bad](std::size_t frame, std::size_t) {
    if (is_bad(frame)) throw_bad_input("it is cut");
    return GreyImage{1, 1, {static_cast<std::uint8_t>(frame)}};
  };
  return sequence;
}

TEST(BadPictures, OfTheBeginningAreLeftOutAsOthersAre) {
  Sequence three = with_bad_frames(1, [](std::size_t frame) { return frame < 3; });
  const auto bad = leave_out_bad_pictures(three);
  for (std::size_t i = 0; i < 160; ++i) static_cast<void>(three.image(i, 0));
  EXPECT_EQ(bad->warnings().size(), 3U);
  EXPECT_FALSE(bad->are_too_many());
  Sequence nine = with_bad_frames(1, [](std::size_t frame) { return frame < 9; });
  EXPECT_EQ(bad_input([&] { static_cast<void>(leave_out_bad_pictures(nine)); }), "it is cut");
}

TEST(BadPictures, OfAPairAreAPartOfAllPictures) {
  for (const auto& [count, too_many] : {std::pair<std::size_t, bool>(5, false), {17, true}}) {
    Sequence pairs = with_bad_frames(
        2, [end = 100 + count](std::size_t frame) { return 100 <= frame && frame < end; });
    const auto bad = leave_out_bad_pictures(pairs);
    for (std::size_t i = 0; i < 160; ++i) {
      for (std::size_t camera = 0; camera < 2; ++camera) static_cast<void>(pairs.image(i, camera));
    }
    EXPECT_EQ(bad->are_too_many(), too_many) << count;
  }
}

TEST(BadPictures, TellThatTheCameraHung) {
  Sequence sequence;
  sequence.cameras.resize(1);
  sequence.frames.assign(20, Frame{Nanos(0), {true}});
  std::size_t hung_from = 20;
  sequence.image = [&hung_from](std::size_t frame, std::size_t) {
    GreyImage picture{2, 1, {}};
    picture.pixels = {static_cast<std::uint8_t>(std::min(frame, hung_from)), 7};
    return picture;
  };
  for (const auto& [from, warned] : {std::pair(20U, 0U), {12U, 1U}}) {
    hung_from = from;
    Sequence read = sequence;
    const auto bad = leave_out_bad_pictures(read);
    for (std::size_t i = 0; i < 20; ++i) static_cast<void>(read.image(i, 0));
    EXPECT_EQ(bad->warnings().size(), warned) << from;
  }
}

TEST(Camera, ThatIsOddIsSaid) {
  CameraModel camera;
  camera.width = 640, camera.height = 480;
  camera.fx = camera.fy = 450, camera.cx = 320, camera.cy = 240;
  camera.k1 = -0.28, camera.k2 = 0.07;
  EXPECT_EQ(no_pinhole(camera) + odd_camera(camera), "");
  const auto with = [&camera](double CameraModel::*part, double value) {
    CameraModel other = camera;
    other.*part = value;
    return no_pinhole(other) + odd_camera(other);
  };
  EXPECT_THAT(with(&CameraModel::fx, 1450), HasSubstr("no pixel is so long"));
  EXPECT_THAT(with(&CameraModel::fx, 600), HasSubstr("usually squares"));
  EXPECT_THAT(with(&CameraModel::cx, 120), HasSubstr("the centre of 640x480"));
  EXPECT_THAT(with(&CameraModel::cx, 700), HasSubstr("in the picture"));
  EXPECT_THAT(with(&CameraModel::k1, 1000), HasSubstr("bends the corner"));
  EXPECT_THAT(with(&CameraModel::k1, -3), HasSubstr("bends the corner"));
}

TEST(BadPictures, AreLeftOutAndCounted) {
  Sequence sequence = test::mono(generate_sequence(test::scene(3, 2.0, false)));
  std::size_t most_bad = 1;
  sequence.image = [&most_bad](std::size_t frame, std::size_t) {
    if (frame < most_bad) throw_bad_input(fmt::format("picture {} is cut", frame));
    return GreyImage{2, 1, {1, 2}};
  };
  const auto bad = leave_out_bad_pictures(sequence);
  EXPECT_TRUE(sequence.image(0, 0).empty());
  EXPECT_TRUE(sequence.image(0, 0).empty());
  EXPECT_FALSE(sequence.image(1, 0).empty());
  EXPECT_THAT(bad->warnings(), ElementsAre(HasSubstr("picture 0 is cut")));
  EXPECT_FALSE(bad->are_too_many());
  most_bad = sequence.frames.size();
  for (std::size_t i = 0; i < most_bad; ++i) EXPECT_TRUE(sequence.image(i, 0).empty());
  EXPECT_TRUE(bad->are_too_many());
  // What none of the first can be read of is another kind of picture.
  sequence.image = [](std::size_t, std::size_t) -> GreyImage { throw_bad_input("16 bits"); };
  EXPECT_EQ(bad_input([&] { static_cast<void>(leave_out_bad_pictures(sequence)); }), "16 bits");
}

}  // namespace
}  // namespace pirt
