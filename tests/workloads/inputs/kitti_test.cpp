// KITTI's layout: numbers, labels and poses that are not those of the pictures.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <opencv2/core.hpp>
#include <string>
#include <utility>
#include <vector>

#include "tests/support/data.h"
#include "tests/support/errors.h"
#include "tests/workloads/inputs/sequence_support.h"
#include "workloads/inputs/pictures/decoder.h"
#include "workloads/inputs/sequence/sequence.h"

namespace pirt {
namespace {

namespace fs = std::filesystem;
using test::bad_input;
using test::put;
using testing::HasSubstr;

TEST(Kitti, ReadsTheRealDrive) {
  PIRT_DATA_OR_SKIP(data, "kitti-odometry-urban");
  const Sequence sequence = read_sequence(data);
  ASSERT_EQ(sequence.frames.size(), 51U);
  ASSERT_EQ(sequence.cameras.size(), 1U);
  EXPECT_EQ(sequence.cameras[0].width, 1226);
  EXPECT_DOUBLE_EQ(sequence.cameras[0].fx, 707.0912);
  EXPECT_EQ(sequence.frames[50].time, from_s(5.0));
  EXPECT_THAT(sequence.warnings, testing::ElementsAre(HasSubstr("0.1 s")));
  EXPECT_EQ(sequence.image(0, 0).height, 370);
  double path_m = 0;
  for (std::size_t i = 1; i < 51; ++i) {
    path_m += (sequence.truth[i].body.position - sequence.truth[i - 1].body.position).norm();
  }
  EXPECT_NEAR(path_m, 59.9, 0.1);  // as its README says
}

/// A drive in KITTI's layout, of pictures that are called by these numbers.
class MadeKitti : public testing::Test {
 protected:
  void add(const std::string& folder, const std::vector<std::string>& names) {
    fs::create_directories(scratch_.path() / folder);
    for (const auto& name : names) {
      GreyImage image{16, 16,
                      std::vector<std::uint8_t>(256, static_cast<std::uint8_t>(std::stoi(name)))};
      put(scratch_.path() / folder / (name + ".png"),
          encode_png(cv::Mat(16, 16, CV_8U, image.pixels.data())));
    }
  }
  void calibrate(const std::string& first, const std::string& second) {
    const std::string numbers = " 20 0 8 0 0 20 8 0 0 0 1 0\n";
    put(scratch_.path() / "calib.txt", first + numbers + second + " 20 0 8 -4 0 20 8 0 0 0 1 0\n");
  }
  void SetUp() override { calibrate("P0:", "P1:"); }
  [[nodiscard]] Sequence read() const { return read_kitti(scratch_.path()); }

  const test::ScratchFolder scratch_;
};

TEST_F(MadeKitti, OrdersAndPairsPicturesByTheirNumbers) {
  add("image_0", {"1", "2", "9", "10"});
  add("image_1", {"1", "9", "10", "11"});
  put(scratch_.path() / "times.txt", "0\n0.1\n0.2\n0.3\n0.4\n0.5\n0.6\n0.7\n0.8\n0.9\n1.0\n");
  const Sequence sequence = read();
  ASSERT_EQ(sequence.frames.size(), 4U);
  for (const auto& [frame, number] : {std::pair{0, 1}, {1, 2}, {2, 9}, {3, 10}}) {
    const auto i = static_cast<std::size_t>(frame);
    EXPECT_EQ(sequence.frames[i].time, from_s(0.1 * number));
    EXPECT_EQ(sequence.image(i, 0).pixels[0], number);
    EXPECT_EQ(sequence.frames[i].present[1], number != 2);
    if (number == 2) continue;
    EXPECT_EQ(sequence.image(i, 1).pixels[0], number);
  }
  add("image_0", {"09"});
  EXPECT_THAT(bad_input([this] { static_cast<void>(read()); }), HasSubstr("the same number"));
}

TEST_F(MadeKitti, TakesProjectionsByTheirLabels) {
  add("image_0", {"1"});
  add("image_1", {"1"});
  calibrate("P1:", "P0:");
  EXPECT_NEAR(read().cameras[0].body_from_camera.position.x(), 0.2, 1e-12);
  calibrate("P0:\t", "P1:\t");
  EXPECT_NEAR(read().cameras[1].body_from_camera.position.x(), 0.2, 1e-12);
  calibrate("P2:", "P1:");
  EXPECT_THAT(bad_input([this] { static_cast<void>(read()); }), HasSubstr("has no P0"));
}

TEST_F(MadeKitti, OfOneCameraTheOtherIsNotRead) {
  add("image_0", {"1"});
  add("image_1", {"1"});
  put(scratch_.path() / "calib.txt", "P0: 20 0 8 0 0 20 8 0 0 0 1 0\n");
  EXPECT_THAT(bad_input([this] { static_cast<void>(read()); }), HasSubstr("has no P1"));
  EXPECT_EQ(read_sequence(scratch_.path(), {.second_camera = false}).cameras.size(), 1U);
}

TEST_F(MadeKitti, TakesNoCameraForTheRightOneThatSitsElsewhere) {
  add("image_0", {"1", "2", "3"});
  add("image_1", {"1", "2", "3"});
  for (const char* fourth : {"4", "0"}) {
    put(scratch_.path() / "calib.txt",
        std::string("P0: 20 0 8 0 0 20 8 0 0 0 1 0\nP1: 20 0 8 ") + fourth + " 0 20 8 0 0 0 1 0\n");
    const Sequence sequence = read();
    EXPECT_EQ(sequence.cameras.size(), 1U);
    EXPECT_EQ(sequence.frames[0].present.size(), 1U);
    EXPECT_THAT(sequence.warnings, testing::Contains(HasSubstr("P1 does not put camera 1")));
  }
}

TEST_F(MadeKitti, RefusesNamesWhoseOrderIsNotCertain) {
  for (const auto& names : {std::vector<std::string>{"15.763", "16.013"}, {"15.9", "15.10"}}) {
    const fs::path folder = scratch_.path() / "image_0";
    fs::remove_all(folder);
    add("image_0", names);
    EXPECT_THAT(bad_input([this] { static_cast<void>(read()); }),
                HasSubstr("nobody knows their order"));
  }
}

TEST_F(MadeKitti, ACutFirstPictureCostsOneFrame) {
  add("image_0", {"1", "2", "3"});
  put(scratch_.path() / "image_0/1.png", "no picture");
  EXPECT_EQ(read().cameras[0].width, 16);
}

TEST_F(MadeKitti, IsReadBesideARecordingOfIt) {
  add("image_0", {"1", "2", "3"});
  put(scratch_.path() / "flight.mcap", "not even one");
  const Sequence sequence = read_sequence(scratch_.path());
  EXPECT_EQ(sequence.frames.size(), 3U);
  EXPECT_THAT(sequence.warnings, testing::Contains(HasSubstr("is not read")));
}

TEST_F(MadeKitti, TakesNoOtherCalibration) {
  add("image_0", {"1", "2", "3"});
  EXPECT_THAT(bad_input([this] {
                const fs::path file = scratch_.path() / "calib.txt";
                static_cast<void>(read_sequence(scratch_.path(), {.calibration = file}));
              }),
              HasSubstr("has its calibration in calib.txt"));
}

TEST_F(MadeKitti, TakesNoPosesWhosePicturesAreNotKnown) {
  add("image_0", {"1", "2", "3"});
  put(scratch_.path() / "poses.txt", "1 0 0 0 0 1 0 0 0 0 1 0\n");
  const Sequence sequence = read();
  EXPECT_TRUE(sequence.truth.empty());
  EXPECT_THAT(sequence.warnings, testing::Contains(HasSubstr("1 poses for 3 pictures")));
}

TEST_F(MadeKitti, ACameraWithoutPairsIsNoCamera) {
  add("image_0", {"1", "2"});
  add("image_1", {"3", "4"});
  const Sequence sequence = read();
  EXPECT_EQ(sequence.cameras.size(), 1U);
  EXPECT_THAT(sequence.warnings, testing::Contains(HasSubstr("image_1 is not used")));
}

TEST(Kitti, TakesThePosesThatThereAre) {
  const test::ScratchFolder scratch;
  fs::create_directories(scratch.path() / "image_0");
  const fs::path small = scratch.path() / "small";
  test::write_small_sequence(small);
  int i = 0;
  for (const auto& entry : fs::directory_iterator(small / "mav0/cam0/data")) {
    fs::copy(entry.path(), scratch.path() / "image_0" / (std::to_string(i++) + ".png"));
  }
  put(scratch.path() / "calib.txt", "P0: 700 0 80 0 0 700 60 0 0 0 1 0\n");
  EXPECT_EQ(read_kitti(scratch.path()).frames.size(), 10U);
  put(scratch.path() / "poses.txt", "1 0 0 0 0 1 0 0 0 0 1 0\n");
  const Sequence short_truth = read_kitti(scratch.path());
  EXPECT_EQ(short_truth.truth.size(), 1U);
  EXPECT_THAT(short_truth.warnings,
              testing::Contains(HasSubstr("has no poses of 9 of 10 pictures")));
  std::string mirrored;
  for (int k = 0; k < 10; ++k) mirrored += "-1 0 0 0 0 1 0 0 0 0 1 0\n";
  put(scratch.path() / "poses.txt", mirrored);
  const Sequence without = read_kitti(scratch.path());
  EXPECT_TRUE(without.truth.empty());
  EXPECT_THAT(without.warnings, testing::Contains(testing::AllOf(HasSubstr("not taken for truth"),
                                                                 HasSubstr("no rotation"))));
  put(scratch.path() / "truth.txt", "1.5 0 0 0 0 0 0 1\n");
  EXPECT_EQ(read_sequence(scratch.path(), {.truth = scratch.path() / "truth.txt"}).truth.size(),
            1U);
  put(scratch.path() / "calib.txt", "P0: 700 0 80 0 0 700 60 0 0 0 1\n");
  EXPECT_THAT(bad_input([&] { static_cast<void>(read_kitti(scratch.path())); }),
              HasSubstr("calib.txt:1"));
}

}  // namespace
}  // namespace pirt
