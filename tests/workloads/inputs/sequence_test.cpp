// Readers of recorded sequences: what they read, and what they refuse with which words.
#include "workloads/inputs/sequence/sequence.h"

#include <fmt/core.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <fstream>
#include <opencv2/calib3d.hpp>
#include <sstream>
#include <utility>

#include "tests/support/data.h"
#include "tests/support/errors.h"
#include "tests/workloads/inputs/sequence_support.h"
#include "workloads/base/text/text.h"
#include "workloads/inputs/pictures/decoder.h"
#include "workloads/inputs/sequence/recorded.h"
#include "workloads/inputs/sequence/trajectory.h"
#include "workloads/vision/vision.h"

namespace pirt {
namespace {

namespace fs = std::filesystem;
using test::bad_input;
using test::put;
using test::text_of;
using testing::HasSubstr;

TEST(Camera, RayIsTheInverseOfProject) {
  const auto sequence = generate_sequence(test::scene(1, 1.0));
  for (const auto& camera : sequence.cameras) {
    for (int y = 0; y < camera.height; y += 37) {
      for (int x = 0; x < camera.width; x += 41) {
        const Eigen::Vector2d pixel(x, y);
        EXPECT_LT((camera.project(camera.ray(pixel)) - pixel).norm(), 1e-6);
      }
    }
  }
}

// The goal for a real lens: OpenCV's to a grey level.
TEST(Camera, UndistortsARealLensAsOpenCvDoes) {
  PIRT_DATA_OR_SKIP(data, "euroc-v1_01-static-camera");
  const CameraModel c = read_camera_yaml(data / "cam0" / "sensor.yaml");
  EXPECT_EQ(c.width, 752);
  EXPECT_DOUBLE_EQ(c.k1, -0.28340811);
  GreyImage image = read_grey_image(data / "cam0" / "1403715273262142976.png", c.width, c.height);
  vision::Undistort lens;
  lens.width = c.width;
  lens.height = c.height;
  lens.camera = {c.fx, c.fy, c.cx, c.cy, c.k1, c.k2, c.p1, c.p2};
  const GreyImage ours{c.width, c.height, vision::undistorted(lens, image.pixels)};
  cv::Mat theirs;
  const cv::Matx33d k(c.fx, 0, c.cx, 0, c.fy, c.cy, 0, 0, 1);
  cv::undistort(cv::Mat(c.height, c.width, CV_8U, image.pixels.data()), theirs, k,
                cv::Vec4d(c.k1, c.k2, c.p1, c.p2));
  int most = 0;
  for (int y = 0; y < c.height; ++y) {
    for (int x = 0; x < c.width; ++x) {
      most = std::max(most, std::abs(ours.row(y)[x] - theirs.at<std::uint8_t>(y, x)));
    }
  }
  EXPECT_LE(most, 1);
  int untouched = 0;  // what not undistorting scores
  for (int y = 0; y < c.height; ++y) {
    for (int x = 0; x < c.width; ++x) {
      untouched = std::max(untouched, std::abs(image.row(y)[x] - theirs.at<std::uint8_t>(y, x)));
    }
  }
  EXPECT_GT(untouched, 50);
}

TEST(Euroc, ReadsWhatWasWritten) {
  const test::ScratchFolder scratch;
  const fs::path folder = scratch.path() / "out";
  SceneOptions options = test::scene(3, 1.0);
  options.width = 160;
  options.height = 120;
  const Sequence written = generate_sequence(options);
  write_euroc(written, folder, 2);
  const Sequence read = read_sequence(folder);
  EXPECT_THAT(read.warnings, testing::IsEmpty());
  ASSERT_EQ(read.cameras.size(), 2U);
  EXPECT_DOUBLE_EQ(read.cameras[1].fx, written.cameras[1].fx);
  EXPECT_TRUE(read.cameras[1].body_from_camera.rotation.isApprox(
      written.cameras[1].body_from_camera.rotation, 1e-12));
  ASSERT_EQ(read.frames.size(), written.frames.size());
  EXPECT_EQ(read.frames[7].time, written.frames[7].time);
  EXPECT_EQ(read.image(7, 1).pixels, written.image(7, 1).pixels);
  ASSERT_EQ(read.imu.size(), written.imu.size());
  EXPECT_TRUE(read.imu[50].gyro_rad_s.isApprox(written.imu[50].gyro_rad_s, 1e-9));
  ASSERT_EQ(read.truth.size(), written.truth.size());
  EXPECT_TRUE(read.truth[99].body.position.isApprox(written.truth[99].body.position, 1e-9));
}

/// A good folder, whose files each case spoils.
class SpoiledEuroc : public testing::Test {
 protected:
  void SetUp() override { test::write_small_sequence(folder_); }
  [[nodiscard]] std::string problem() const {
    return bad_input([&] { static_cast<void>(read_sequence(folder_)); });
  }
  void edit(const fs::path& file, const std::string& from, const std::string& to) const {
    put(folder_ / "mav0" / file, test::replaced(text_of(folder_ / "mav0" / file), from, to));
  }
  [[nodiscard]] std::string row(const fs::path& file, int number) const {
    return test::line_of(text_of(folder_ / "mav0" / file), number);
  }

  /// A camera of Kalibr's camchain.
  [[nodiscard]] static std::string chain_of(const char* name, const CameraModel& camera) {
    const Pose cam_imu = camera.body_from_camera.inverse();
    std::string rows;
    for (int r = 0; r < 3; ++r) {
      rows += fmt::format("    - [{}, {}, {}, {}]\n", cam_imu.rotation(r, 0),
                          cam_imu.rotation(r, 1), cam_imu.rotation(r, 2), cam_imu.position(r));
    }
    return fmt::format(
        "{}:\n  camera_model: pinhole\n  distortion_model: radtan\n"
        "  distortion_coeffs: [{}, {}, {}, {}]\n  intrinsics: [{}, {}, {}, {}]\n"
        "  resolution: [160, 120]\n  T_cam_imu:\n{}    - [0, 0, 0, 1]\n",
        name, camera.k1, camera.k2, camera.p1, camera.p2, camera.fx, camera.fy, camera.cx,
        camera.cy, rows);
  }

  test::ScratchFolder scratch_;
  fs::path folder_ = scratch_.path() / "seq";
};

TEST_F(SpoiledEuroc, RefusesAMissingCalibration) {
  fs::remove(folder_ / "mav0/cam0/sensor.yaml");
  EXPECT_THAT(problem(), testing::AllOf(HasSubstr("calibration"), HasSubstr("sensor.yaml")));
}

TEST_F(SpoiledEuroc, LeavesOutStampsThatRepeatOrFall) {
  const Sequence good = read_sequence(folder_);
  for (const std::string file : {"imu0", "cam0", "state_groundtruth_estimate0"}) {
    edit(file + "/data.csv", row(file + "/data.csv", 6).substr(0, 19),
         row(file + "/data.csv", 5).substr(0, 19));
  }
  edit("imu0/data.csv", row("imu0/data.csv", 9).substr(0, 19), "1403715273000000000");
  const Sequence read = read_sequence(folder_);
  EXPECT_EQ(read.imu.size() + 2, good.imu.size());
  EXPECT_EQ(read.frames.size() + 1, good.frames.size());
  EXPECT_EQ(read.truth.size() + 1, good.truth.size());
  EXPECT_THAT(read.warnings,
              testing::Contains(testing::AllOf(HasSubstr("imu0/data.csv"), HasSubstr("2 of"),
                                               HasSubstr("do not rise"))));
}

TEST_F(SpoiledEuroc, IsReadAsTumViHasIt) {
  const Sequence good = read_sequence(folder_);
  const CameraModel& camera = good.cameras[0];
  fs::create_directory(folder_ / "dso");
  put(folder_ / "dso/camchain.yaml", chain_of("cam0", camera));
  const fs::path root = folder_ / "mav0";
  std::string poses = "#timestamp [ns], p, q\n";
  for (const TruthRow& each : good.truth) {
    const Eigen::Quaterniond q(each.body.rotation);
    const auto& p = each.body.position;
    poses += fmt::format("{},{},{},{},{},{},{},{}\n", each.time.count(), p.x(), p.y(), p.z(), q.w(),
                         q.x(), q.y(), q.z());
  }
  for (const char* gone :
       {"cam0/sensor.yaml", "cam1", "imu0/sensor.yaml", "state_groundtruth_estimate0"}) {
    fs::remove_all(root / gone);
  }
  fs::create_directory(root / "mocap0");
  put(root / "mocap0/data.csv", poses);
  const Sequence read = read_sequence(folder_);
  ASSERT_EQ(read.cameras.size(), 1U);
  EXPECT_NEAR(read.cameras[0].rate_hz, camera.rate_hz, 1e-6);
  EXPECT_TRUE(
      read.cameras[0].body_from_camera.position.isApprox(camera.body_from_camera.position, 1e-9));
  EXPECT_EQ(read.cameras[0].k1, camera.k1);
  ASSERT_EQ(read.truth.size(), good.truth.size());
  EXPECT_TRUE(read.truth[7].body.rotation.isApprox(good.truth[7].body.rotation, 1e-9));
  EXPECT_EQ(read.imu.size(), good.imu.size());
  EXPECT_THAT(read.warnings, testing::ElementsAre(HasSubstr("no imu0/sensor.yaml")));
  // The same calibration by name, and truth of a file of its own.
  fs::rename(folder_ / "dso/camchain.yaml", folder_ / "chain.yaml");
  EXPECT_THAT(problem(), HasSubstr("--calibration"));
  std::vector<StampedPose> way;
  for (const TruthRow& each : good.truth) way.push_back({each.time, each.body});
  put(folder_ / "truth.txt", tum_text(way));
  const Sequence given = read_sequence(
      folder_, {.calibration = folder_ / "chain.yaml", .truth = folder_ / "truth.txt"});
  EXPECT_EQ(given.cameras[0].fx, camera.fx);
  ASSERT_EQ(given.truth.size(), good.truth.size());
  EXPECT_LT(std::chrono::abs(given.truth[9].time - good.truth[9].time), Nanos(1000));
  EXPECT_TRUE(given.truth[9].body.position.isApprox(good.truth[9].body.position, 1e-6));
  for (StampedPose& each : way) each.body.position *= 1e5;
  put(folder_ / "truth.txt", tum_text(way));
  EXPECT_THAT(read_sequence(folder_,
                            {.calibration = folder_ / "chain.yaml", .truth = folder_ / "truth.txt"})
                  .warnings,
              testing::Contains(HasSubstr("are these millimetres?")));
  put(folder_ / "truth.txt", "1.5 0 0 0 0 0 0 2\n");
  EXPECT_THAT(bad_input([&] {
                static_cast<void>(read_sequence(folder_, {.calibration = folder_ / "chain.yaml",
                                                          .truth = folder_ / "truth.txt"}));
              }),
              testing::AllOf(HasSubstr("truth.txt:1"), HasSubstr("quaternion")));
}

TEST_F(SpoiledEuroc, ACalibrationIsOfTheCameraOfItsName) {
  const Sequence good = read_sequence(folder_);
  CameraModel other = good.cameras[0];
  other.fx += 50;
  put(folder_ / "chain.yaml", chain_of("cam0", other) + chain_of("cam1", good.cameras[1]));
  for (const char* gone : {"cam0", "cam1/sensor.yaml", "imu0/sensor.yaml"}) {
    fs::remove_all(folder_ / "mav0" / gone);
  }
  const Sequence read = read_sequence(folder_, {.calibration = folder_ / "chain.yaml"});
  ASSERT_EQ(read.cameras.size(), 1U);
  EXPECT_EQ(read.cameras[0].fx, good.cameras[1].fx);
  EXPECT_TRUE(read.cameras[0].body_from_camera.position.isApprox(
      good.cameras[1].body_from_camera.position, 1e-9));
}

TEST_F(SpoiledEuroc, ACalibrationIsOfTheCameraWhoseTopicItNames) {
  const Sequence good = read_sequence(folder_);
  CameraModel left = good.cameras[0];
  left.fx += 50;
  const auto named = [](const std::string& chain, const std::string& topic) {
    return chain.substr(0, chain.find("  T_cam_imu")) + "  rostopic: " + topic + "\n";
  };
  // The right camera is the file's first, 0.1 m along x of the left one's axes.
  put(folder_ / "chain.yaml",
      named(chain_of("cam0", good.cameras[1]), "/cam1/image_raw") +
          named(chain_of("cam1", left), "/cam0/image_raw") +
          "  T_cn_cnm1: [[1, 0, 0, 0.1], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]\n");
  const Sequence read = read_sequence(folder_, {.calibration = folder_ / "chain.yaml"});
  ASSERT_EQ(read.cameras.size(), 2U);
  EXPECT_EQ(read.cameras[0].fx, left.fx);
  EXPECT_EQ(read.cameras[1].fx, good.cameras[1].fx);
  const Pose between =
      read.cameras[0].body_from_camera.inverse() * read.cameras[1].body_from_camera;
  EXPECT_NEAR(between.position.x(), 0.1, 1e-12);
}

TEST_F(SpoiledEuroc, SaysThatACalibrationIsOfAnotherCamera) {
  const fs::path other = scratch_.path() / "other";
  fs::create_directories(other / "cam0");
  fs::rename(folder_ / "mav0/cam0/sensor.yaml", other / "cam0/sensor.yaml");
  fs::remove_all(folder_ / "mav0/cam0");
  EXPECT_THAT(read_sequence(folder_, {.calibration = other}).warnings,
              testing::Contains(HasSubstr("of /cam0/image_raw is taken for cam1")));
}

TEST_F(SpoiledEuroc, WhereTheImuSitsNeedsNotBeSaidWithACalibration) {
  const Sequence good = read_sequence(folder_);
  const fs::path chain = folder_ / "chain.yaml";
  put(chain, chain_of("cam0", good.cameras[0]) + chain_of("cam1", good.cameras[1]));
  edit("imu0/sensor.yaml", "T_BS:", "T_other:");
  for (const bool imu : {false, true}) {
    const Sequence read = read_sequence(folder_, {.imu = imu, .calibration = chain});
    EXPECT_EQ(read.truth.size(), good.truth.size());
    EXPECT_EQ(read.imu.size(), imu ? good.imu.size() : 0U);
  }
  put(folder_ / "mav0/imu0/sensor.yaml", "rate_hz: [");
  const Sequence read = read_sequence(folder_, {.imu = false, .calibration = chain});
  EXPECT_EQ(read.frames.size(), good.frames.size());
  EXPECT_THAT(read.warnings, testing::Contains(HasSubstr("is not taken for truth")));
}

// An IMU that is turned on the body: what cameras see of its accelerations is the same.
TEST_F(SpoiledEuroc, AllCalibrationsHaveTheBodyThatTheSamplesHave) {
  const Sequence good = read_sequence(folder_);
  const fs::path bag = scratch_.path() / "a.bag", chain = folder_ / "chain.yaml";
  ASSERT_TRUE(write_recording(good, bag));
  put(chain, chain_of("cam0", good.cameras[0]) + chain_of("cam1", good.cameras[1]));
  const Pose turn{rotation_of({0.3, -0.2, 0.5}), Eigen::Vector3d::Zero()};
  const auto place = [&](const char* sensor, const Pose& pose) {
    const Pose turned = turn * pose;
    std::string rows;
    for (int r = 0; r < 3; ++r) {
      rows += fmt::format("{}, {}, {}, {}, ", turned.rotation(r, 0), turned.rotation(r, 1),
                          turned.rotation(r, 2), turned.position(r));
    }
    const fs::path file = folder_ / "mav0" / sensor / "sensor.yaml";
    std::string text = text_of(file);
    const auto begin = text.find("data: [") + 7;
    put(file, text.replace(begin, text.find(']') - begin, rows + "0, 0, 0, 1"));
  };
  place("imu0", {});
  place("cam0", good.cameras[0].body_from_camera);
  place("cam1", good.cameras[1].body_from_camera);
  const auto seen = [](const Sequence& sequence) {
    const Eigen::Matrix3d& rotation = sequence.cameras[0].body_from_camera.rotation;
    return Eigen::Vector3d(rotation.transpose() * sequence.imu[9].accel_m_s2);
  };
  const auto camera_at = [](const Sequence& sequence) {
    return sequence.truth[9].body * sequence.cameras[0].body_from_camera;
  };
  const Pose expected = camera_at(read_sequence(folder_));
  for (const fs::path& calibration : {fs::path(), chain, folder_}) {
    const Sequence read = read_sequence(folder_, {.calibration = calibration});
    EXPECT_TRUE(seen(read).isApprox(seen(good), 1e-9)) << calibration;
    EXPECT_TRUE(camera_at(read).rotation.isApprox(expected.rotation, 1e-9)) << calibration;
  }
  EXPECT_TRUE(seen(read_sequence(bag, {.calibration = folder_})).isApprox(seen(good), 1e-9));
}

TEST_F(SpoiledEuroc, TruthThatIsNoneCostsAWarning) {
  put(folder_ / "mav0/state_groundtruth_estimate0/data.csv",
      "version https://git-lfs.github.com/spec/v1\noid sha256:0\n");
  const Sequence read = read_sequence(folder_);
  EXPECT_TRUE(read.truth.empty());
  EXPECT_THAT(read.warnings, testing::Contains(testing::AllOf(
                                 HasSubstr("state_groundtruth_estimate0 is not taken for truth"),
                                 HasSubstr("Git LFS"))));
  put(folder_ / "truth.txt", "1.5 0 0 0 0 0 0 1\n2.5 0 0 0 0 0 0 1\n");
  const Sequence given = read_sequence(folder_, {.truth = folder_ / "truth.txt"});
  EXPECT_EQ(given.truth.size(), 2U);
  EXPECT_THAT(given.warnings, testing::Not(testing::Contains(HasSubstr("Git LFS"))));
}

TEST_F(SpoiledEuroc, SaysThatNobodyKnowsWhatTheTruthIsOf) {
  const std::string chain = chain_of("cam0", read_sequence(folder_).cameras[0]);
  put(folder_ / "chain.yaml", chain.substr(0, chain.find("  T_cam_imu")));
  fs::remove_all(folder_ / "mav0/cam1");
  const Sequence read = read_sequence(folder_, {.calibration = folder_ / "chain.yaml"});
  EXPECT_FALSE(read.truth.empty());
  EXPECT_THAT(read.warnings,
              testing::Contains(testing::AllOf(HasSubstr("nobody knows"),
                                               HasSubstr("state_groundtruth_estimate0"))));
}

TEST_F(SpoiledEuroc, OfOneCameraTheOtherIsNotRead) {
  fs::remove(folder_ / "mav0/cam1/sensor.yaml");
  EXPECT_THAT(problem(), HasSubstr("cam1/sensor.yaml"));
  EXPECT_EQ(read_sequence(folder_, {.second_camera = false}).cameras.size(), 1U);
}

TEST_F(SpoiledEuroc, APauseChangesNoRate) {
  const Sequence good = read_sequence(folder_);
  fs::create_directory(folder_ / "dso");
  put(folder_ / "dso/camchain.yaml", chain_of("cam0", good.cameras[0]));
  for (const char* gone : {"cam0/sensor.yaml", "cam1", "imu0/sensor.yaml"}) {
    fs::remove_all(folder_ / "mav0" / gone);
  }
  for (const char* file : {"cam0/data.csv", "imu0/data.csv"}) {
    std::istringstream rows(text_of(folder_ / "mav0" / file));
    std::string line, text;
    while (std::getline(rows, line)) {
      const std::int64_t stamp = line.starts_with('#') ? 0 : std::stoll(line);
      if (stamp >= good.frames[5].time.count()) {
        line = std::to_string(stamp + from_s(600).count()) + line.substr(line.find(','));
      }
      text += line + "\n";
    }
    put(folder_ / "mav0" / file, text);
  }
  const Sequence read = read_sequence(folder_);
  EXPECT_NEAR(read.cameras[0].rate_hz, good.cameras[0].rate_hz, 0.1);
  EXPECT_NEAR(read.imu_model->rate_hz, 200, 2);
  EXPECT_THAT(read.warnings, testing::Contains(HasSubstr("are not waited for")));
}

TEST_F(SpoiledEuroc, OfAnImuThatWasThinnedOutTheSamplesSayTheRate) {
  EXPECT_EQ(read_sequence(folder_).imu_model->rate_hz, 200);
  std::istringstream rows(text_of(folder_ / "mav0/imu0/data.csv"));
  std::string line, text;
  for (int i = 0; std::getline(rows, line); ++i) {
    if (i % 4 == 0) text += line + "\n";  // the first is the heading
  }
  put(folder_ / "mav0/imu0/data.csv", text);
  const Sequence read = read_sequence(folder_);
  EXPECT_NEAR(read.imu_model->rate_hz, 50, 0.5);
  EXPECT_THAT(read.warnings,
              testing::Contains(HasSubstr("says 200 Hz; its samples come at 50 Hz")).Times(1));
}

TEST_F(SpoiledEuroc, SamplesThatCameInBurstsAreTakenToBeEven) {
  const Sequence good = read_sequence(folder_);
  std::ofstream out(folder_ / "mav0/imu0/data.csv");
  for (std::size_t i = 0; i < good.imu.size(); ++i) {
    const ImuSample& s = good.imu[i];
    const std::size_t last = std::min(i - i % 4 + 3, good.imu.size() - 1);
    const auto earlier = static_cast<std::int64_t>(100'000 * (3 - i % 4));
    out << good.imu[last].time.count() - earlier << ',' << s.gyro_rad_s.x() << ','
        << s.gyro_rad_s.y() << ',' << s.gyro_rad_s.z() << ',' << s.accel_m_s2.x() << ','
        << s.accel_m_s2.y() << ',' << s.accel_m_s2.z() << '\n';
  }
  out.close();
  const Sequence read = read_sequence(folder_);
  ASSERT_EQ(read.imu.size(), good.imu.size());
  for (std::size_t i = 4; i + 4 < good.imu.size(); ++i) {
    EXPECT_LT(std::chrono::abs(read.imu[i].time - good.imu[i].time), Nanos(1000)) << i;
  }
  EXPECT_THAT(read.warnings, testing::ElementsAre(HasSubstr("samples come in bursts")));
}

TEST_F(SpoiledEuroc, TakesTheUpperBitsOfSixteen) {
  const Sequence good = read_sequence(folder_);
  const GreyImage picture = good.image(2, 0);
  const auto file = (folder_ / "mav0/cam0/data" / row("cam0/data.csv", 3).substr(20)).string();
  const auto write = [&](int scale) {
    cv::Mat wide(picture.height, picture.width, CV_16UC1);
    for (int y = 0; y < picture.height; ++y) {
      for (int x = 0; x < picture.width; ++x) {
        wide.at<std::uint16_t>(y, x) = static_cast<std::uint16_t>(scale * picture.row(y)[x] + 7);
      }
    }
    put(file, encode_png(wide));
  };
  write(0);
  EXPECT_THAT(good.image(2, 0).pixels, testing::Each(0));
  write(1);
  EXPECT_THAT(bad_input([&] { static_cast<void>(good.image(2, 0)); }),
              testing::AllOf(HasSubstr("brightest"), HasSubstr("scale it")));
  write(256);
  EXPECT_EQ(good.image(2, 0).pixels, picture.pixels);
  write(1);
  EXPECT_THAT(good.image(2, 0).pixels, testing::Each(testing::Le(1)))
      << "dark, of a camera that has 16 bits";
}

TEST_F(SpoiledEuroc, RefusesRowsThatAreCutOffOrNoNumbers) {
  const std::string whole = row("imu0/data.csv", 9);
  edit("imu0/data.csv", whole, whole.substr(0, whole.rfind(',')));
  EXPECT_THAT(problem(), testing::AllOf(HasSubstr("data.csv:10"), HasSubstr("6 columns")));
  edit("imu0/data.csv", row("imu0/data.csv", 9), whole.substr(0, whole.rfind(',')) + ",nan");
  EXPECT_THAT(problem(), testing::AllOf(HasSubstr("data.csv:10"), HasSubstr("column 7")));
}

TEST_F(SpoiledEuroc, IsReadAsSpreadsheetsWriteIt) {
  const Sequence good = read_sequence(folder_);
  const auto rewrite = [this](const std::string& file, auto each) {
    const fs::path path = folder_ / "mav0" / file / "data.csv";
    std::string text;
    for (std::string line : split(text_of(path), '\n')) text += each(std::move(line)) + "\n";
    put(path, text);
  };
  rewrite("cam0", [](std::string line) {
    const auto comma = line.find(',');
    return line.starts_with('#') || line.empty()
               ? "timestamp [ns],filename"
               : "\"" + line.substr(0, comma) + "\", \"" + line.substr(comma + 1) + "\"";
  });
  // One heading, not one in the midst of it.
  EXPECT_THAT(problem(), testing::AllOf(HasSubstr("column 1"), HasSubstr("timestamp")));
  rewrite("cam0", [first = true](std::string line) mutable {
    return std::exchange(first, false) || !line.starts_with('t') ? line : std::string();
  });
  EXPECT_EQ(read_sequence(folder_).frames.size(), good.frames.size());
  rewrite("imu0", [](std::string line) {
    std::ranges::replace(line, ',', ';');
    return line;
  });
  EXPECT_THAT(problem(), testing::AllOf(HasSubstr("data.csv:2"), HasSubstr("1 columns"),
                                        HasSubstr("separated by commas")));
}

/// The columns of a comma-separated file in another order.
std::string with_columns(const std::string& text, const std::vector<std::size_t>& order) {
  std::istringstream in(text);
  std::string line, all;
  while (std::getline(in, line)) {
    const bool is_marked = line.starts_with('#');
    std::istringstream row(is_marked ? line.substr(1) : line);
    std::vector<std::string> cells;
    for (std::string cell; std::getline(row, cell, ',');) cells.push_back(cell);
    all += is_marked ? "#" : "";
    for (std::size_t i = 0; i < order.size(); ++i) {
      all += (i > 0 ? "," : "") + cells.at(order[i]);
    }
    all += "\n";
  }
  return all;
}

TEST_F(SpoiledEuroc, ColumnsAreFoundByTheirNames) {
  const Sequence good = read_sequence(folder_);
  const auto put_columns = [this](const fs::path& file, const std::vector<std::size_t>& order) {
    put(folder_ / "mav0" / file, with_columns(text_of(folder_ / "mav0" / file), order));
  };
  put_columns("imu0/data.csv", {0, 4, 5, 6, 3, 2, 1});
  put_columns("cam0/data.csv", {1, 0});
  put_columns("state_groundtruth_estimate0/data.csv",
              {0, 1, 2, 3, 5, 6, 7, 4, 14, 15, 16, 11, 12, 13, 8, 9, 10});
  const Sequence read = read_sequence(folder_);
  ASSERT_EQ(read.imu.size(), good.imu.size());
  EXPECT_EQ(read.imu[9].gyro_rad_s, good.imu[9].gyro_rad_s);
  EXPECT_EQ(read.imu[9].accel_m_s2, good.imu[9].accel_m_s2);
  EXPECT_EQ(read.frames.size(), good.frames.size());
  EXPECT_EQ(read.truth[9].body.rotation, good.truth[9].body.rotation);
  EXPECT_EQ(read.truth[9].velocity_m_s, good.truth[9].velocity_m_s);
  EXPECT_EQ(read.truth[9].accel_bias_m_s2, good.truth[9].accel_bias_m_s2);

  const fs::path truth = "state_groundtruth_estimate0/data.csv";
  const std::string whole = row(truth, 5);
  std::size_t cut = 0;  // behind its eighth cell
  for (int cells = 0; cells < 8; ++cells) cut = whole.find(',', cut + 1);
  edit(truth, whole, whole.substr(0, cut));
  EXPECT_THAT(read_sequence(folder_).warnings,
              testing::Contains(HasSubstr("has 8 columns, expected 17")));
  edit(truth, whole.substr(0, cut) + "\n", whole + "\n");
  const std::string named = row("imu0/data.csv", 0);
  edit("imu0/data.csv", named, "when,acc_x,acc_y,acc_z,gyro_z,gyro_y,gyro_x");
  EXPECT_THAT(problem(), HasSubstr("name all")) << "what `when` is nobody knows";
  edit("imu0/data.csv", "when,acc", "time_ns,acc");
  EXPECT_EQ(read_sequence(folder_).imu[9].gyro_rad_s, good.imu[9].gyro_rad_s);
  edit("imu0/data.csv", row("imu0/data.csv", 0), named);
  edit("imu0/data.csv", "w_RS_S_x [rad s^-1]", "w_RS_S_x [deg s^-1]");
  EXPECT_THAT(problem(), testing::AllOf(HasSubstr("imu0/data.csv:1"), HasSubstr("is in deg s^-1"),
                                        HasSubstr("give rad/s")));
  edit("imu0/data.csv", "[deg s^-1]", "(deg/s)");
  EXPECT_THAT(problem(), HasSubstr("is in deg/s"));
  edit("imu0/data.csv", "(deg/s)", "[dps]");
  EXPECT_THAT(problem(), HasSubstr("is in dps"));
  edit("imu0/data.csv", "w_RS_S_x", "turn");
  EXPECT_THAT(problem(), testing::AllOf(HasSubstr("imu0/data.csv:1"), HasSubstr("the heading has"),
                                        HasSubstr("name all")));
}

TEST_F(SpoiledEuroc, NoticesDegreesAndG) {
  const Sequence good = read_sequence(folder_);
  const auto rewrite = [&](double gyro, double accel) {
    std::ofstream out(folder_ / "mav0/imu0/data.csv");
    for (const auto& s : good.imu) {
      // A turn of a radian a second, so that degrees are seen to be too fast.
      const Eigen::Vector3d w = gyro * (s.gyro_rad_s + Eigen::Vector3d::UnitZ());
      const Eigen::Vector3d a = accel * s.accel_m_s2;
      out << s.time.count() << ',' << w.x() << ',' << w.y() << ',' << w.z() << ',' << a.x() << ','
          << a.y() << ',' << a.z() << '\n';
    }
  };
  rewrite(1, 1);
  EXPECT_NO_THROW(static_cast<void>(read_sequence(folder_)));
  rewrite(kDegreesPerRadian, 1);
  EXPECT_THAT(problem(), HasSubstr("degrees"));
  rewrite(1, 1 / kGravity);
  EXPECT_THAT(problem(), HasSubstr("looks like g"));
  rewrite(1, 0.0);
  EXPECT_THAT(problem(), HasSubstr("gravity"));
}

TEST_F(SpoiledEuroc, NoticesAnotherClockAndMicroseconds) {
  const Sequence good = read_sequence(folder_);
  const auto rewrite = [&](std::int64_t later, std::int64_t part) {
    std::ofstream out(folder_ / "mav0/imu0/data.csv");
    for (const auto& s : good.imu) {
      out << (s.time.count() + later) / part << ',' << s.gyro_rad_s.x() << ',' << s.gyro_rad_s.y()
          << ',' << s.gyro_rad_s.z() << ',' << s.accel_m_s2.x() << ',' << s.accel_m_s2.y() << ','
          << s.accel_m_s2.z() << '\n';
    }
  };
  rewrite(0, 1000);
  EXPECT_THAT(problem(), testing::AllOf(HasSubstr("imu0/data.csv"), HasSubstr("microseconds?")));
  rewrite(from_s(1000).count(), 1);
  EXPECT_THAT(problem(), testing::AllOf(HasSubstr("no time in common"), HasSubstr("--no-imu")));
  EXPECT_TRUE(read_sequence(folder_, {.imu = false}).imu.empty());
}

TEST_F(SpoiledEuroc, RefusesExtrinsicsThatAreNone) {
  edit("cam0/sensor.yaml", "0.061,", "61.0,");
  EXPECT_THAT(problem(), HasSubstr("millimetres"));
  edit("cam0/sensor.yaml", "61.0,", "0.061,");
  edit("cam0/sensor.yaml", "data: [", "data: [2");
  EXPECT_THAT(problem(), HasSubstr("no rotation"));
}

TEST_F(SpoiledEuroc, RefusesPicturesThatAreTruncatedMissingOrOfAnotherSize) {
  const Sequence sequence = read_sequence(folder_);
  const fs::path picture = folder_ / "mav0/cam0/data" / row("cam0/data.csv", 3).substr(20);
  const std::string whole = text_of(picture);
  const auto load = [&] { return bad_input([&] { static_cast<void>(sequence.image(2, 0)); }); };
  put(picture, whole.substr(0, whole.size() / 2));
  EXPECT_THAT(load(), HasSubstr(picture.filename().string()));
  put(picture, "\xff\xd8\xff no picture");
  EXPECT_THAT(load(), HasSubstr("cannot use the picture"));
  edit("cam0/sensor.yaml", "resolution: [160, 120]", "resolution: [168, 120]");
  put(picture, whole);
  const Sequence other = read_sequence(folder_);
  EXPECT_THAT(bad_input([&] { static_cast<void>(other.image(2, 0)); }), HasSubstr("160x120"));
  fs::remove(picture);
  EXPECT_THAT(load(), HasSubstr(picture.filename().string()));
}

TEST_F(SpoiledEuroc, SaysThatTheImuStopsAndThatFramesAreMissing) {
  std::string imu;
  for (int i = 0; i < 100; ++i) imu += row("imu0/data.csv", i) + "\n";
  put(folder_ / "mav0/imu0/data.csv", imu);
  edit("cam0/data.csv", row("cam0/data.csv", 4) + "\n", "");
  edit("cam0/data.csv", row("cam0/data.csv", 4) + "\n", "");
  const auto warnings = read_sequence(folder_).warnings;
  EXPECT_THAT(warnings, testing::Contains(HasSubstr("IMU stops")));
  EXPECT_THAT(warnings, testing::Contains(HasSubstr("camera: 1 gap")));
}

TEST(ReadSequence, NamesBothLayoutsForAFolderThatIsNeither) {
  const test::ScratchFolder scratch;
  EXPECT_THAT(bad_input([&] { static_cast<void>(read_sequence(scratch.path())); }),
              testing::AllOf(HasSubstr("cam0"), HasSubstr("calib.txt")));
  EXPECT_THAT(bad_input([&] { static_cast<void>(read_sequence(scratch.path() / "none")); }),
              HasSubstr("there is nothing of that name"));
}

TEST(WriteEuroc, LeavesAFolderThatIsNotEmptyAlone) {
  const test::ScratchFolder scratch;
  put(scratch.path() / "mine", "text");
  EXPECT_THAT(
      bad_input([&] { write_euroc(generate_sequence(test::scene(1, 1.0)), scratch.path(), 1); }),
      HasSubstr("not empty"));
  EXPECT_EQ(text_of(scratch.path() / "mine"), "text");
}

}  // namespace
}  // namespace pirt
