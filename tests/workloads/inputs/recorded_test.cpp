// What is made of a recording's messages: which topics, calibrations and places are taken, and what
// is said of it.
#include "workloads/inputs/sequence/recorded.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>

#include "tests/workloads/inputs/own_recording.h"
#include "workloads/inputs/pictures/decoder.h"
#include "workloads/inputs/pictures/images.h"
#include "workloads/inputs/sequence/bad_pictures.h"

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

TEST_F(OwnRecording, PlacesItsSensorsByTransformsOfBeforeTf2) {
  file_ = scratch_.path() / "own.db3";
  writer_ = make_db3(file_);
  const auto add_imu = [this] {
    add("/imu", ImuMessage::kType,
        written(ImuMessage{.head = {Nanos(written_ + 1), "imu"}, .accel_m_s2 = {0, 0, 9.81}},
                writer_->format()));
  };
  const TransformMessage place{
      .head = {Nanos(1), "camera"}, .child = "imu", .parent_from_child = {}};
  add_info("/camera/camera_info");
  add("/tf", TransformMessage::kOldType, written(std::vector{place}, writer_->format()));
  add_imu();
  add_picture("/camera/image_raw", "mono8", 16, 16, kGrey);
  add_imu();
  const Sequence sequence = read();
  EXPECT_EQ(sequence.imu.size(), 2U);
  EXPECT_THAT(sequence.warnings, IsEmpty());
}

TEST_F(OwnRecording, TakesTheTwinOfATopicWhosePicturesAreNone) {
  add_info("/camera/camera_info");
  add_picture("/camera/image_raw", "bayer_rggb8", 16, 16, kGrey);
  add_picture("/camera/image_mono", "mono8", 16, 16, std::string(256, 'b'));
  const Sequence sequence = read();
  EXPECT_THAT(sequence.image(0, 0).pixels, testing::Each('b'));
  EXPECT_THAT(sequence.warnings,
              ElementsAre(AllOf(HasSubstr("pictures are those of /camera/image_mono"),
                                HasSubstr("/camera/image_raw is encoded as 'bayer_rggb8'"))));
}

TEST_F(OwnRecording, TakesTheCompressedTwinOfATopicWhosePicturesAreNone) {
  add_info("/camera/camera_info");
  add_picture("/camera/image_raw", "yuv422_yuy2", 16, 16, std::string(512, 'a'));
  add_compressed("/camera/image_raw/compressed", "png",
                 encode_png(cv::Mat(16, 16, CV_8U, cv::Scalar(9))));
  const Sequence sequence = read();
  EXPECT_THAT(sequence.image(0, 0).pixels, testing::Each(9));
  EXPECT_THAT(sequence.warnings, ElementsAre(HasSubstr("is encoded as 'yuv422_yuy2'")));
}

TEST_F(OwnRecording, TakesTheTwinThatHasThePictures) {
  add_info("/camera/camera_info");
  for (int i = 1; i <= 5; ++i) {
    written_ = from_ms(50.0 * i).count();
    if (i == 2) add_picture("/camera/image_raw", "mono8", 16, 16, kGrey);
    add_compressed("/camera/image_raw/compressed", "png",
                   encode_png(cv::Mat(16, 16, CV_8U, cv::Scalar(9))));
  }
  const Sequence sequence = read();
  EXPECT_EQ(sequence.frames.size(), 5U);
  EXPECT_THAT(sequence.warnings,
              ElementsAre(HasSubstr(
                  "/camera/image_raw has 1 pictures where /camera/image_raw/compressed has 5")));
}

/// An IMU whose messages may be none.
class Imus : public OwnRecording {
 protected:
  void add_flight(const std::vector<std::pair<const char*, double>>& turns_rad_s) {
    add_info("/camera/camera_info");
    for (int i = 1; i < 5; ++i) {
      written_ = from_ms(50.0 * i).count();
      add_picture("/camera/image_raw", "mono8", 16, 16, kGrey);
      for (const auto& [topic, turn_rad_s] : turns_rad_s) {
        add(topic, ImuMessage::kType,
            written(ImuMessage{.head = {Nanos(written_ + 1), frame_},
                               .gyro_rad_s = {turn_rad_s, 0, 0},
                               .accel_m_s2 = {0, 0, 9.81}},
                    writer_->format()));
      }
    }
  }
};

TEST_F(Imus, OneThatSaysNoNumbersIsLeftOut) {
  add_flight({{"/a_imu", std::nan("")}, {"/imu", 0.1}});
  const Sequence sequence = read();
  ASSERT_EQ(sequence.imu.size(), 4U);
  EXPECT_EQ(sequence.imu[0].gyro_rad_s.x(), 0.1);
  EXPECT_THAT(sequence.warnings,
              ElementsAre(AllOf(HasSubstr("/a_imu is not used"), HasSubstr("not finite"))));
  EXPECT_THAT(test::bad_input([&] {
                static_cast<void>(read_sequence(file_, {.topics = parse_topics("imu=/a_imu")}));
              }),
              HasSubstr("not finite"));
}

TEST_F(Imus, TheOnlyOneThatSaysNoNumbersIsRefusedWithTheRemedy) {
  add_flight({{"/imu", std::nan("")}});
  EXPECT_THAT(problem(), AllOf(HasSubstr("not finite"), HasSubstr("--topics imu=none")));
}

/// Topics without a file.
class Listed final : public Recording {
 public:
  Listed() : Recording("listed") {}
  void list(Topic topic, std::int64_t count) {
    auto& places = topics_[add(std::move(topic))].places;
    for (std::int64_t i = 0; i < count; ++i) places.push_back({Nanos(i)});
  }
  using Recording::finish;

 private:
  [[nodiscard]] std::string load(const Topic::Place& /*place*/,
                                 std::uint64_t /*most*/) const override {
    return "";
  }
};

TEST(Recording, OfTopicsOfOneNameTheOneThatCanBeReadIsMeant) {
  Listed recording;
  const std::string type(ImuMessage::kType);
  recording.list({.name = "/imu", .type = type, .encoding = "json"}, 801);
  recording.list({.name = "/imu", .type = type}, 800);
  recording.finish();
  EXPECT_THAT(recording.of_type(type), ElementsAre(1));
  EXPECT_THAT(recording.warnings(), ElementsAre(HasSubstr("801, encoded as 'json')")));
}

TEST_F(OwnRecording, TheInfoOfTheFolderAboveIsOfAnotherCamera) {
  add_info("/camera_info");
  add_picture("/image_raw", "mono8", 16, 16, kGrey);
  add_picture("/cam2/image_raw", "mono8", 16, 16, kGrey);
  const Sequence sequence = read();
  EXPECT_EQ(sequence.cameras.size(), 1U);
  EXPECT_THAT(sequence.warnings, ElementsAre(HasSubstr("/cam2/image_raw has no camera_info")));
}

/// Two cameras, whose projections say where they sit.
class RecordedPair : public OwnRecording {
 protected:
  /// @param left, right  The fourth numbers of P, whose first is 20.
  void add_pair(double left, double right, const std::string& robot = "") {
    for (const auto& [name, shift] : {std::pair("/left", left), {"/right", right}}) {
      CameraInfoMessage message = info();
      message.p[3] = shift;
      add_info(robot + name + "/camera_info", message);
    }
    for (int i = 1; i < 4; ++i) {
      for (const char* name : {"/left", "/right"}) {
        frame_ = name;
        written_ = from_ms(50.0 * i).count();
        add_picture(robot + name + "/image_raw", "mono8", 16, 16, kGrey);
      }
    }
  }
  /// @param first_right  In place of the right camera's first picture.
  void add_compressed_pair(const std::string& first_right) {
    const std::string png = encode_png(cv::Mat(16, 16, CV_8U, cv::Scalar(9)));
    for (const auto& [name, shift] : {std::pair<std::string, double>("/left", 0), {"/right", -8}}) {
      CameraInfoMessage message = info();
      message.p[3] = shift;
      add_info(name + "/camera_info", message);
      for (int i = 1; i < 4; ++i) {
        frame_ = name;
        written_ = from_ms(50.0 * i).count();
        add_compressed(name + "/image_raw/compressed", "png",
                       i == 1 && shift < 0 ? first_right : png);
      }
    }
  }
  /// @param right  Where the right camera is in the left one's axes.
  void add_transform(const std::string& topic, const Eigen::Vector3d& right) {
    TransformMessage message{
        .head = {Nanos(1), "/left"}, .child = "/right", .parent_from_child = {}};
    message.parent_from_child.position = right;
    add(topic, TransformMessage::kType, written(std::vector{message}, WireFormat::kRos1));
  }
};

TEST_F(RecordedPair, SitsAsTheTransformsOfItsRobotSay) {
  const std::pair<std::string, double> robots[] = {{"/robot1", 0.1}, {"/robot2", 0.5}};
  for (const auto& [robot, apart_m] : robots) {
    add_transform(robot + "/tf_static", {apart_m, 0, 0});
    add_pair(0, 0, robot);
  }
  writer_->publish();
  for (const auto& [robot, apart_m] : robots) {
    const auto topics =
        parse_topics("left=" + robot + "/left/image_raw,right=" + robot + "/right/image_raw");
    const Sequence sequence = read_sequence(file_, {.topics = topics});
    ASSERT_EQ(sequence.cameras.size(), 2U) << robot;
    EXPECT_NEAR(sequence.cameras[1].body_from_camera.position.x(), apart_m, 1e-12) << robot;
  }
}

TEST_F(RecordedPair, SitsAsTheOnlyTransformsSay) {
  add_transform("/robot/tf_static", {0.3, 0, 0});
  add_pair(0, 0);
  const Sequence sequence = read();
  ASSERT_EQ(sequence.cameras.size(), 2U);
  EXPECT_NEAR(sequence.cameras[1].body_from_camera.position.x(), 0.3, 1e-12);
}

TEST_F(RecordedPair, SitsAsItsProjectionsSayIfTransformsSayOtherwise) {
  add_transform("/tf_static", {0, -0.4, 0});  // x is ahead, and y to the left
  add_pair(0, -8);
  const Sequence sequence = read();
  ASSERT_EQ(sequence.cameras.size(), 2U);
  EXPECT_NEAR(sequence.cameras[1].body_from_camera.position.x(), 0.4, 1e-12);
  EXPECT_NEAR(sequence.cameras[1].body_from_camera.position.y(), 0, 1e-12);
  EXPECT_THAT(sequence.warnings, testing::Contains(AllOf(HasSubstr("-0.400,"), HasSubstr("(0.400,"),
                                                         HasSubstr("the projections are taken"))));
}

TEST_F(RecordedPair, SitsAsTransformsSayIfItsProjectionsAgree) {
  add_transform("/tf_static", {0.41, 0.02, 0});
  add_pair(0, -8);
  const Sequence sequence = read();
  ASSERT_EQ(sequence.cameras.size(), 2U);
  EXPECT_NEAR(sequence.cameras[1].body_from_camera.position.x(), 0.41, 1e-12);
  EXPECT_THAT(sequence.warnings, IsEmpty());
}

// As KITTI's colour cameras, which are rectified to a grey one: 0.1 m to its left and 0.4 m to its
// right.
TEST_F(RecordedPair, IsAsFarApartAsBothProjectionsSay) {
  add_pair(2, -8);
  const Sequence sequence = read();
  ASSERT_EQ(sequence.cameras.size(), 2U);
  EXPECT_NEAR(sequence.cameras[1].body_from_camera.position.x(), 0.5, 1e-12);
}

TEST_F(RecordedPair, IsOneThoughItsFirstPictureIsEmpty) {
  add_compressed_pair("");
  const Sequence sequence = read();
  ASSERT_EQ(sequence.cameras.size(), 2U);
  EXPECT_THAT(test::bad_input([&] { static_cast<void>(sequence.image(0, 1)); }),
              HasSubstr("has no pixels"));
  EXPECT_FALSE(sequence.image(1, 1).empty());
}

TEST_F(RecordedPair, IsOneThoughItsFirstPictureIsNone) {
  add_compressed_pair(std::string(4, '\0'));
  const Sequence sequence = read();
  ASSERT_EQ(sequence.cameras.size(), 2U);
  EXPECT_THAT(test::bad_input([&] { static_cast<void>(sequence.image(0, 1)); }),
              HasSubstr("is encoded as 'png'"));
  EXPECT_FALSE(sequence.image(1, 1).empty());
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

TEST_F(OwnRecording, SaysThatPicturesSeemToBeRectified) {
  CameraInfoMessage message = info();
  message.k = {20, 0, 8, 0, 20, 10, 0, 0, 1};
  message.p = {14, 0, 8, 0, 0, 14, 8, 0, 0, 0, 1, 0};
  add_info("/camera/camera_info", message);
  add_picture("/camera/image_raw", "mono8", 16, 16, kGrey);
  EXPECT_THAT(read().warnings,
              ElementsAre(AllOf(HasSubstr("/camera/image_raw seem to be rectified"),
                                HasSubstr("--calibration"))));
}

/// A camera and its IMU, stamped by other clocks than the recorder's.
class Clocks : public OwnRecording {
 protected:
  void SetUp() override { add_info("/camera/camera_info"); }
  void add_frame(Nanos stamp, Nanos recorded) {
    writer_->write("/camera/image_raw", ImageMessage::kType, recorded,
                   written(ImageMessage{.head = {stamp, frame_},
                                        .compressed = false,
                                        .width = 16,
                                        .height = 16,
                                        .encoding = "mono8",
                                        .step = 16,
                                        .data = kGrey},
                           WireFormat::kRos1));
  }
  void add_sample(Nanos stamp, Nanos recorded, double turn_rad_s) {
    writer_->write("/imu", ImuMessage::kType, recorded,
                   written(ImuMessage{.head = {stamp, frame_},
                                      .gyro_rad_s = {turn_rad_s, 0, 0},
                                      .accel_m_s2 = {0, 0, 9.8 + 0.01 * turn_rad_s}},
                           WireFormat::kRos1));
  }
  /// @param delay  Of the camera's stamps, not of the IMU's.
  void add_flight(Nanos delay) {
    for (int i = 1; i <= 20; ++i) {
      const Nanos time = from_ms(1000 + 100.0 * i);
      add_frame(time - delay, time);
      add_sample(time, time, 0.1);
    }
  }
};

// A simulator's: the IMU from 0 to 40 s and the camera from 12 s, then from 0 to 35 s and from 2 s.
TEST_F(Clocks, ThatBeginAnewAreOfOneRun) {
  Nanos recorded{};
  const auto run = [&](double turn_rad_s, int first_picture, int last) {
    for (int i = 1; i <= last; ++i) {
      const Nanos stamp = from_ms(100.0 * i);
      recorded += from_ms(100);
      add_sample(stamp, recorded, turn_rad_s + 0.001 * (i % 2));
      if (i >= first_picture && i % 5 == 0) add_frame(stamp, recorded);
    }
  };
  run(1, 120, 400);
  run(2, 20, 350);
  const Sequence sequence = read();
  EXPECT_EQ(sequence.frames.size(), 67U);
  EXPECT_EQ(sequence.imu.size(), 350U);
  EXPECT_TRUE(std::ranges::all_of(
      sequence.imu, [](const ImuSample& sample) { return sample.gyro_rad_s.x() >= 2; }));
  EXPECT_THAT(sequence.warnings,
              testing::Contains(HasSubstr("400 of 750 messages of /imu were recorded in other")));
  EXPECT_THAT(sequence.warnings, testing::Not(testing::Contains(HasSubstr("two clocks"))));
}

TEST_F(Clocks, OfWhichOneIsOffAreSaid) {
  add_flight(from_ms(500));
  EXPECT_THAT(read().warnings,
              testing::Contains(AllOf(HasSubstr("stamps of /imu are usually 0.000 s before"),
                                      HasSubstr("0.500 s: are these two clocks?"))));
}

TEST_F(Clocks, OfWhichOneIsRecordedLateAreNotTwo) {
  add_flight(from_ms(100));
  EXPECT_THAT(read().warnings, testing::Not(testing::Contains(HasSubstr("two clocks"))));
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

TEST_F(OwnRecording, GivesPicturesThoughItsFirstMessageIsCut) {
  constexpr int kPictures = 40;
  add("/camera/image_raw", ImageMessage::kType, "");
  for (int i = 1; i < kPictures; ++i) add_picture("/camera/image_raw", "mono8", 16, 16, kGrey);
  writer_->publish();
  EXPECT_THAT(images_from(file_)->describe(),
              AllOf(HasSubstr("39 images"), HasSubstr("1 left out")));
}

TEST_F(OwnRecording, LeavesOutAJpegWhosePixelsAreDamaged) {
  constexpr std::size_t kPictures = 40, kDamaged = 7, kCut = 60;
  cv::Mat noise(16, 16, CV_8U);
  cv::randu(noise, 0, 255);
  std::vector<std::uint8_t> bytes;
  cv::imencode(".jpg", noise, bytes);
  const std::string whole(bytes.begin(), bytes.end());
  // Its end is there: only the decoder can tell.
  const std::string damaged = whole.substr(0, whole.size() - kCut) + whole.substr(whole.size() - 2);
  add_info("/camera/camera_info");
  for (std::size_t i = 0; i < kPictures; ++i) {
    written_ = from_ms(50.0 * static_cast<double>(i + 1)).count();
    add_compressed("/camera/image_raw/compressed", "jpeg", i == kDamaged ? damaged : whole);
  }
  Sequence sequence = read();
  EXPECT_THAT(images_from(file_)->describe(),
              AllOf(HasSubstr("39 images"), HasSubstr("1 left out")));
  const auto bad = leave_out_bad_pictures(sequence);
  EXPECT_TRUE(sequence.image(kDamaged, 0).empty());
  EXPECT_FALSE(sequence.image(kDamaged + 1, 0).empty());
  EXPECT_THAT(bad->warnings(), ElementsAre(AllOf(HasSubstr("message 8"), HasSubstr("decode"))));
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
