// What is made of a recording's messages: which topics, calibrations and places are taken, and what
// is said of it.
#include "workloads/inputs/sequence/recorded.h"

#include <gmock/gmock.h>

#include "tests/workloads/inputs/own_recording.h"
#include "workloads/inputs/pictures/images.h"

namespace pirt {
namespace {

using test::OwnRecording;
using test::put;
using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

const std::string kGrey(256, 'a');  // 16x16 pixels

TEST_F(OwnRecording, LeavesOutAnImuThatIsNowhere) {
  add_info("/camera/camera_info");
  add_picture("/camera/image_raw", "mono8", 16, 16, std::string(256, 'a'));
  add("/imu", ImuMessage::kType,
      written(ImuMessage{.head = {Nanos(1), "imu"}, .accel_m_s2 = {0, 0, 9.81}},
              WireFormat::kRos1));
  const Sequence sequence = read();
  EXPECT_THAT(sequence.imu, IsEmpty());
  EXPECT_THAT(sequence.warnings,
              ElementsAre(AllOf(HasSubstr("/imu is not used"), HasSubstr("/tf_static"))));
}

TEST_F(OwnRecording, SensorsThatNameNoFrameAreNotInTheSameOne) {
  frame_ = "";
  add_info("/camera/camera_info");
  add_picture("/camera/image_raw", "mono8", 16, 16, kGrey);
  add("/imu", ImuMessage::kType,
      written(ImuMessage{.head = {Nanos(1), ""}, .accel_m_s2 = {0, 0, 9.81}}, WireFormat::kRos1));
  const Sequence sequence = read();
  EXPECT_THAT(sequence.imu, IsEmpty());
  EXPECT_THAT(sequence.warnings,
              ElementsAre(AllOf(HasSubstr("/imu is not used"), HasSubstr("names its frame"))));
}

/// Two cameras, whose projections say where they sit.
class RecordedPair : public OwnRecording {
 protected:
  /// @param left, right  The fourth numbers of P, whose first is 20.
  void add_pair(double left, double right) {
    for (const auto& [name, shift] : {std::pair("/left", left), {"/right", right}}) {
      CameraInfoMessage message = info();
      message.p[3] = shift;
      add_info(std::string(name) + "/camera_info", message);
    }
    for (int i = 1; i < 4; ++i) {
      for (const char* topic : {"/left/image_raw", "/right/image_raw"}) {
        written_ = from_ms(50.0 * i).count();
        add_picture(topic, "mono8", 16, 16, kGrey);
      }
    }
  }
};

// As KITTI's colour cameras, which are rectified to a grey one: 0.1 m to its left and 0.4 m to its
// right.
TEST_F(RecordedPair, IsAsFarApartAsBothProjectionsSay) {
  add_pair(2, -8);
  const Sequence sequence = read();
  ASSERT_EQ(sequence.cameras.size(), 2U);
  EXPECT_NEAR(sequence.cameras[1].body_from_camera.position.x(), 0.5, 1e-12);
}

TEST_F(RecordedPair, IsNoFurtherApartThanARobotIsLong) {
  add_pair(0, -2000);
  EXPECT_THAT(problem(), AllOf(HasSubstr("100.0 m apart"), HasSubstr("millimetres?")));
}

TEST_F(RecordedPair, IsReadAsOneCameraIfOneIsWanted) {
  add_info("/left/camera_info");
  for (const char* topic : {"/left/image_raw", "/right/image_raw"}) {
    add_picture(topic, "mono8", 16, 16, kGrey);
  }
  const auto topics = parse_topics("left=/left/image_raw,right=/right/image_raw");
  const Sequence one = read({.second_camera = false, .topics = topics});
  EXPECT_EQ(one.cameras.size(), 1U);
  EXPECT_EQ(one.frames[0].present.size(), 1U);
  EXPECT_THAT(test::bad_input([&] { static_cast<void>(read_sequence(file_, {.topics = topics})); }),
              HasSubstr("no calibration of /right/image_raw"));
}

TEST_F(OwnRecording, SaysThatACalibrationChanges) {
  for (const double focal : {20.0, 20.4, 21.0}) {
    CameraInfoMessage message = info();
    message.k[0] = message.k[4] = focal;
    add_info(focal < 21 ? "/a/camera_info" : "/b/camera_info", message);
  }
  add_info("/b/camera_info");
  for (const char* topic : {"/a/image_raw", "/b/image_raw"}) {
    add_picture(topic, "mono8", 16, 16, kGrey);
  }
  const Sequence sequence = read({.topics = parse_topics("left=/b/image_raw,right=none")});
  EXPECT_THAT(sequence.warnings, ElementsAre(HasSubstr("/b/camera_info changes")));
  EXPECT_EQ(sequence.cameras[0].fx, 21);
  EXPECT_THAT(
      read_sequence(file_, {.topics = parse_topics("left=/a/image_raw,right=none")}).warnings,
      IsEmpty());
}

TEST_F(OwnRecording, RefusesPixelsOfTwoBytesInRowsOfAnOddNumber) {
  add_info("/camera/camera_info");
  add_picture("/camera/image_raw", "mono16", 16, 16, std::string(33 * 16, 'a'));
  EXPECT_THAT(problem(), HasSubstr("odd number of bytes"));
}

TEST_F(OwnRecording, GivesDarkPicturesOfADeepCameraAndLeavesOutAFew) {
  constexpr int kPictures = 40;
  add_picture("/camera/image_raw", "mono16", 16, 16, std::string(512, '\1'));
  for (int i = 2; i < kPictures; ++i) {
    add_picture("/camera/image_raw", "mono16", 16, 16, std::string(512, '\x7f'));
  }
  add_picture("/camera/image_raw", "mono16", 16, 16, std::string(16, 'a'));
  writer_->publish();
  const auto images = images_from(file_);
  EXPECT_THAT(images->describe(), AllOf(HasSubstr("39 images"), HasSubstr("1 left out")));
  const Picture dark = images->gray(0, 16, 16);
  EXPECT_EQ(dark.pixels.as<std::uint8_t>()[0], 1);
}

/// Poses of several topics beside pictures.
class Poses : public OwnRecording {
 protected:
  void add_poses(const std::vector<std::string>& topics) {
    add_info("/camera/camera_info");
    for (int i = 1; i < 4; ++i) {
      written_ = from_ms(50.0 * i).count();
      add_picture("/camera/image_raw", "mono8", 16, 16, std::string(256, 'a'));
      for (std::size_t k = 0; k < topics.size(); ++k) {
        PoseMessage pose{.head = {from_ms(50.0 * i), "world"}, .pose = {}};
        pose.pose.position.x() = static_cast<double>(k);
        add(topics[k], PoseMessage::kType, written(pose, WireFormat::kRos1));
      }
    }
  }
};

TEST_F(Poses, WithTruthInTheirNameAreTruth) {
  add_poses({"/orb_slam/pose", "/ground_truth/pose"});
  const Sequence sequence = read();
  EXPECT_EQ(sequence.truth.at(0).body.position.x(), 1);
  EXPECT_THAT(sequence.warnings,
              testing::Contains(AllOf(HasSubstr("truth is taken to be /ground_truth/pose"),
                                      HasSubstr("not /orb_slam/pose"))));
}

TEST_F(Poses, OfWhichNoneIsNamedAreAskedFor) {
  add_poses({"/a", "/b", "/move_base/goal"});
  EXPECT_THAT(problem(), AllOf(HasSubstr("has 2 topics of geometry_msgs/PoseStamped"),
                               HasSubstr("--topics truth=/a"), testing::Not(HasSubstr("goal"))));
  put(scratch_.path() / "truth.txt", "1.5 0 0 0 0 0 0 1\n2.5 0 0 0 0 0 0 1\n");
  EXPECT_EQ(read_sequence(file_, {.truth = scratch_.path() / "truth.txt"}).truth.size(), 2U);
}

TEST_F(Poses, OfSeveralRobotsAreThatOfTheCameras) {
  add_poses({"/b/truth", "/camera/truth"});
  EXPECT_EQ(read().truth.at(0).body.position.x(), 1);
}

TEST_F(Poses, WithTruthInSeveralNamesAreAskedFor) {
  add_poses({"/a/truth", "/b/truth"});
  EXPECT_THAT(problem(), AllOf(HasSubstr("has 2 topics that could be truth"),
                               HasSubstr("--topics truth=/a/truth")));
}

}  // namespace
}  // namespace pirt
