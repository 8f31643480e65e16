// Recordings of ROS: what is written is read as it was, bytes are those of the formats, and what
// cannot be read is said by name.
#include "workloads/inputs/recording/recording.h"

#include <fmt/core.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <memory>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "tests/support/data.h"
#include "tests/support/errors.h"
#include "tests/workloads/inputs/own_recording.h"
#include "workloads/inputs/pictures/images.h"
#include "workloads/inputs/recording/bag_format.h"
#include "workloads/inputs/recording/messages.h"
#include "workloads/inputs/sequence/recorded.h"

namespace pirt {
namespace {

namespace fs = std::filesystem;
using test::bad_input;
using test::OwnRecording;
using test::put;
using test::text_of;
using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

SceneOptions small_scene(bool stereo = true) {
  SceneOptions options = test::scene(3, 1.0, stereo);
  options.path.rest_s = 0.2;
  options.width = 160;
  options.height = 120;
  options.camera_rate_hz = 10;
  return options;
}

class Recorded : public testing::TestWithParam<const char*> {
 protected:
  [[nodiscard]] fs::path file() const { return scratch_.path() / ("r" + std::string(GetParam())); }
  [[nodiscard]] std::unique_ptr<RecordingWriter> writer() const {
    const std::string format = GetParam();
    return format == ".bag"   ? make_bag(file())
           : format == ".db3" ? make_db3(file())
                              : make_mcap(file());
  }
  const test::ScratchFolder scratch_;
};

TEST_P(Recorded, ReadsAsTheFolderOfTheSameSequence) {
  const Sequence written = generate_sequence(small_scene());
  write_euroc(written, scratch_.path() / "folder", 1);
  ASSERT_TRUE(write_recording(written, file()));
  const Sequence read = read_sequence(file());
  const Sequence folder = read_sequence(scratch_.path() / "folder");
  EXPECT_THAT(read.warnings, IsEmpty());
  ASSERT_EQ(read.cameras.size(), 2U);
  for (std::size_t i = 0; i < 2; ++i) {
    const CameraModel& ours = read.cameras[i];
    const CameraModel& theirs = folder.cameras[i];
    EXPECT_EQ(ours.width, theirs.width);
    EXPECT_EQ(ours.height, theirs.height);
    EXPECT_NEAR(ours.rate_hz, theirs.rate_hz, 1e-6);
    for (const auto part :
         {&CameraModel::fx, &CameraModel::fy, &CameraModel::cx, &CameraModel::cy, &CameraModel::k1,
          &CameraModel::k2, &CameraModel::p1, &CameraModel::p2}) {
      EXPECT_DOUBLE_EQ(ours.*part, theirs.*part);
    }
    EXPECT_TRUE(ours.body_from_camera.rotation.isApprox(theirs.body_from_camera.rotation, 1e-12));
    EXPECT_TRUE(ours.body_from_camera.position.isApprox(theirs.body_from_camera.position, 1e-12));
  }
  ASSERT_EQ(read.frames.size(), folder.frames.size());
  for (std::size_t i = 0; i < read.frames.size(); ++i) {
    EXPECT_EQ(read.frames[i].time, folder.frames[i].time);
    EXPECT_EQ(read.frames[i].present, folder.frames[i].present);
    for (std::size_t camera = 0; camera < 2; ++camera) {
      EXPECT_EQ(read.image(i, camera).pixels, folder.image(i, camera).pixels);
    }
  }
  ASSERT_EQ(read.imu.size(), folder.imu.size());
  for (std::size_t i = 0; i < read.imu.size(); ++i) {
    EXPECT_EQ(read.imu[i].time, folder.imu[i].time);
    // The folder has 12 digits.
    EXPECT_TRUE(read.imu[i].gyro_rad_s.isApprox(folder.imu[i].gyro_rad_s, 1e-11));
    EXPECT_TRUE(read.imu[i].accel_m_s2.isApprox(folder.imu[i].accel_m_s2, 1e-11));
  }
  EXPECT_NEAR(read.imu_model->rate_hz, folder.imu_model->rate_hz, 1e-6);
  EXPECT_EQ(read.imu_model->gyro_noise, folder.imu_model->gyro_noise);
  ASSERT_EQ(read.truth.size(), folder.truth.size());
  for (std::size_t i = 0; i < read.truth.size(); ++i) {
    EXPECT_EQ(read.truth[i].time, folder.truth[i].time);
    EXPECT_TRUE(read.truth[i].body.position.isApprox(folder.truth[i].body.position, 1e-11));
    EXPECT_TRUE(read.truth[i].body.rotation.isApprox(folder.truth[i].body.rotation, 1e-10));
  }
}

TEST_P(Recorded, TakesTheTopicsThatAreChosen) {
  ASSERT_TRUE(write_recording(generate_sequence(small_scene()), file()));
  const Sequence right =
      read_recording(file(), {.topics = parse_topics("left=/cam1/image_raw,imu=none")});
  EXPECT_EQ(right.cameras.size(), 1U);
  EXPECT_THAT(right.imu, IsEmpty());
  EXPECT_FALSE(right.imu_model);
  const Sequence both = read_sequence(file());
  EXPECT_EQ(right.image(2, 0).pixels, both.image(2, 1).pixels);
  // Without an IMU the camera is the body.
  EXPECT_TRUE(right.cameras[0].body_from_camera.rotation.isIdentity(1e-12));
  EXPECT_EQ(read_recording(file(), {.topics = parse_topics("right=none")}).cameras.size(), 1U);
}

TEST_P(Recorded, SaysWhichTopicsThereAreWhereOneIsMissing) {
  ASSERT_TRUE(write_recording(generate_sequence(small_scene(false)), file()));
  const auto problem = [&](const std::string& topics) {
    return bad_input(
        [&] { static_cast<void>(read_recording(file(), {.topics = parse_topics(topics)})); });
  };
  EXPECT_THAT(problem("left=/cam1/image_raw"),
              AllOf(HasSubstr("no topic '/cam1/image_raw'"),
                    HasSubstr("/cam0/image_raw (sensor_msgs/Image, 1")));
  EXPECT_THAT(problem("imu=/truth"), AllOf(HasSubstr("/truth as geometry_msgs/PoseStamped"),
                                           HasSubstr("sensor_msgs/Imu is needed")));
  EXPECT_THAT(problem("lift=/cam0/image_raw"), HasSubstr("did you mean left"));
  EXPECT_THAT(problem("left=none"), HasSubstr("leaves no camera"));
  EXPECT_THAT(problem("left=/cam0/image_raw,right=/cam0/image_raw"),
              HasSubstr("one topic as left and right"));
}

TEST_P(Recorded, APauseChangesNoRate) {
  Sequence flight = generate_sequence(small_scene(false));
  const auto pause = [middle = flight.frames[5].time](auto& rows) {
    for (auto& row : rows) row.time += row.time < middle ? Nanos(0) : from_s(600);
  };
  pause(flight.frames), pause(flight.imu), pause(flight.truth);
  ASSERT_TRUE(write_recording(flight, file()));
  const Sequence read = read_sequence(file());
  EXPECT_NEAR(read.imu_model->rate_hz, 200, 2);
  EXPECT_NEAR(read.cameras[0].rate_hz, 10, 0.1);
}

TEST_P(Recorded, OfAClockThatBeginsAnewTheLongestRunIsRead) {
  const auto out = writer();
  const auto write = [&](const char* topic, double time_ms) {
    out->write(topic, ImuMessage::kType, from_ms(time_ms), written(ImuMessage{}, out->format()));
  };
  write("/tf_static", 10);
  for (const int run : {1, 2}) {
    write("/slow", 10.0 * run);
    for (int i = 1; i <= 60 * run; ++i) write("/fast", 50.0 * i);
  }
  out->publish();
  const auto recording = open_recording(file());
  const auto messages = [&](const char* topic) {
    return recording->topics()[recording->topic(topic)].messages;
  };
  EXPECT_EQ(messages("/fast"), 120U);
  EXPECT_EQ(messages("/slow"), 1U);
  EXPECT_EQ(recording->time(recording->topic("/slow"), 0), from_ms(20)) << "of the second run";
  EXPECT_EQ(messages("/tf_static"), 1U) << "which is said once";
  EXPECT_THAT(recording->warnings(),
              ElementsAre(AllOf(HasSubstr("begins anew"), HasSubstr("61 messages"))));
}

TEST_P(Recorded, OfTwoComputersOneBehindTheOtherAllIsRead) {
  const auto out = writer();
  for (const char* sensor : {"/a/imu", "/b/imu"}) {
    for (int i = 1; i <= 200; ++i) {
      const Nanos time = from_ms(10.0 * i);
      out->write(sensor, ImuMessage::kType, time,
                 written(ImuMessage{.head = {time, "imu"}}, out->format()));
      out->write("/tf", TransformMessage::kType, time,
                 written(std::vector<TransformMessage>(), out->format()));
    }
  }
  out->publish();
  const auto recording = open_recording(file());
  for (const auto& [topic, count] :
       {std::pair<const char*, std::size_t>("/a/imu", 200), {"/b/imu", 200}, {"/tf", 400}}) {
    const std::size_t id = recording->topic(topic);
    ASSERT_EQ(recording->topics()[id].messages, count) << topic;
    EXPECT_EQ(recording->time(id, count - 1), from_ms(2000)) << topic;
  }
  EXPECT_THAT(recording->warnings(), IsEmpty());
}

TEST_P(Recorded, OfPartsInTheWrongOrderAllIsRead) {
  const auto out = writer();
  for (const double begin_ms : {3000, 1000}) {
    for (int i = 1; i <= 200; ++i) {
      const Nanos time = from_ms(begin_ms + 10.0 * i);
      out->write("/imu", ImuMessage::kType, time,
                 written(ImuMessage{.head = {time, "imu"}}, out->format()));
    }
  }
  out->publish();
  const auto recording = open_recording(file());
  ASSERT_EQ(recording->topics().at(0).messages, 400U);
  for (std::size_t i = 0; i < 400; ++i) {
    EXPECT_EQ(recording->time(0, i), from_ms(1010 + 10.0 * static_cast<double>(i)));
  }
  EXPECT_THAT(recording->warnings(), IsEmpty());
}

TEST_P(Recorded, OfARecordersClockThatIsSetBackAllIsRead) {
  const std::tuple<double, double, bool> clocks[] = {
      {2, 10, false}, {5, 10, true}, {0.5, 10, false}, {0.5, 10, true}, {0.25, 100, false}};
  for (const auto& [back_s, step_ms, sensors_too] : clocks) {
    fs::remove(file());
    const auto out = writer();
    for (int i = 1; i <= 200; ++i) {
      const Nanos time = from_ms(10'000 + step_ms * i);
      const Nanos recorded = i <= 100 ? time : time - from_s(back_s);
      const ImuMessage imu{.head = {sensors_too ? recorded : time, "imu"}};
      for (const char* topic : {"/imu", "/other"}) {
        if (i % 3 == 0 || std::string(topic) == "/imu") {
          out->write(topic, ImuMessage::kType, recorded, written(imu, out->format()));
        }
      }
      // One that the recorder's clock stamps tells nothing of the others.
      if (i % 5 == 0) {
        out->write("/stamped_late", ImuMessage::kType, recorded,
                   written(ImuMessage{.head = {recorded, "imu"}}, out->format()));
      }
    }
    out->publish();
    const auto recording = open_recording(file());
    const std::size_t imu = recording->topic("/imu"), other = recording->topic("/other");
    const bool is_anew = sensors_too && back_s > 1;
    EXPECT_EQ(recording->topics()[imu].messages, is_anew ? 100U : 200U);
    EXPECT_EQ(recording->topics()[other].messages, is_anew ? 33U : 66U);
    std::string said;
    for (const std::string& each : recording->warnings()) said += each;
    EXPECT_EQ(said.find("begins anew") != std::string::npos, is_anew) << said;
    EXPECT_EQ(said.empty(), sensors_too && !is_anew) << said;
    if (sensors_too) continue;
    EXPECT_THAT(recording->warnings(),
                ElementsAre(HasSubstr(
                    fmt::format("set back by {:.2f} s after 100 messages of /imu", back_s))));
    for (std::size_t i = 0; i < 200; ++i) {
      EXPECT_EQ(recording->time(imu, i), from_ms(10'000 + step_ms * static_cast<double>(i + 1)));
      EXPECT_FALSE(recording->message(imu, i).empty());
    }
  }
}

TEST_P(Recorded, GivesPicturesToMeasureWith) {
  const Sequence sequence = generate_sequence(small_scene(false));
  ASSERT_TRUE(write_recording(sequence, file()));
  const auto images = images_from(file());
  EXPECT_THAT(images->describe(), AllOf(HasSubstr("10 images"), HasSubstr("/cam0/image_raw")));
  const Picture picture = images->gray(3, 160, 120);
  EXPECT_THAT(picture.notes, IsEmpty());
  const auto expected = sequence.image(3, 0);
  EXPECT_TRUE(std::ranges::equal(picture.pixels.as<std::uint8_t>(), expected.pixels));
}

TEST_P(Recorded, LeavesNothingBehindWhenStopped) {
  EXPECT_FALSE(write_recording(generate_sequence(small_scene()), file(),
                               [](std::size_t written, std::size_t) { return written < 3; }));
  EXPECT_TRUE(fs::is_empty(scratch_.path()));
  ASSERT_TRUE(write_recording(generate_sequence(small_scene(false)), file()));
  EXPECT_THAT(bad_input([&] { write_recording(generate_sequence(small_scene(false)), file()); }),
              HasSubstr("exists"));
}

TEST_P(Recorded, SaysThatAFileIsCut) {
  ASSERT_TRUE(write_recording(generate_sequence(small_scene(false)), file()));
  const std::string whole = text_of(file());
  for (const std::size_t kept : {whole.size() - 1, whole.size() / 2, std::size_t{5000},
                                 std::size_t{100}, std::size_t{5}, std::size_t{0}}) {
    put(file(), whole.substr(0, kept));
    std::string said;
    try {
      // The database shows some cuts only where its pages are; of MCAP what is whole is read.
      const Sequence read = read_sequence(file());
      for (const std::string& each : read.warnings) said += each;
      for (std::size_t i = 0; i < read.frames.size(); ++i) static_cast<void>(read.image(i, 0));
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::kBadInput);
      said = error.what();
    }
    EXPECT_THAT(said, HasSubstr(file().string())) << kept;
  }
}

INSTANTIATE_TEST_SUITE_P(Formats, Recorded, testing::Values(".bag", ".db3", ".mcap"),
                         [](const auto& test) { return std::string(test.param).substr(1); });

TEST_F(OwnRecording, TurnsColoursIntoGrey) {
  // OpenCV's luma of pure red is 0.299 * 255.
  add_info("/camera/camera_info");
  std::string red;
  for (int i = 0; i < 16 * 16; ++i) red += std::string("\xff\0\0", 3);
  add_picture("/camera/image_color", "rgb8", 16, 16, red);
  const Sequence sequence = read();
  EXPECT_THAT(sequence.image(0, 0).pixels, testing::Each(76));
}

TEST_F(OwnRecording, SaysWhatIsNotKnown) {
  add_info("/camera/camera_info");
  add_picture("/camera/image_raw", "bayer_rggb8", 16, 16, std::string(256, 'a'));
  EXPECT_THAT(problem(), AllOf(HasSubstr("bayer_rggb8"),
                               HasSubstr("message 1 of /camera/image_raw"), HasSubstr("mono8")));
}

TEST_F(OwnRecording, NeedsACalibration) {
  add_picture("/camera/image_raw", "mono8", 16, 16, std::string(256, 'a'));
  EXPECT_THAT(problem(), AllOf(HasSubstr("no calibration of /camera/image_raw"),
                               HasSubstr("/camera/camera_info")));
}

TEST_F(OwnRecording, RefusesALensThatItDoesNotKnow) {
  add_info("/camera/camera_info", "fov", {0.1});
  add_picture("/camera/image_raw", "mono8", 16, 16, std::string(256, 'a'));
  EXPECT_THAT(problem(), AllOf(HasSubstr("'fov'"), HasSubstr("plumb_bob")));
}

TEST_F(OwnRecording, SaysThatALensIsNotKnown) {
  add_info("/camera/camera_info", "plumb_bob", {});
  add_picture("/camera/image_raw", "mono8", 16, 16, std::string(256, 'a'));
  EXPECT_THAT(read().warnings,
              ElementsAre(AllOf(HasSubstr("/camera/camera_info"), HasSubstr("D is empty"),
                                HasSubstr("--calibration"))));
}

TEST_F(OwnRecording, NeedsPictures) {
  add_info("/camera/camera_info");
  EXPECT_THAT(problem(), HasSubstr("has no pictures"));
}

TEST_F(OwnRecording, AsksWhichOfManyCamerasIsMeant) {
  for (const char* name : {"/a", "/b", "/c"}) {
    add_info(std::string(name) + "/camera_info");
    add_picture(std::string(name) + "/image_raw", "mono8", 16, 16, std::string(256, 'a'));
  }
  EXPECT_THAT(problem(), HasSubstr("--topics left=/a/image_raw,right=/b/image_raw"));
}

TEST_F(OwnRecording, SaysThatPicturesHaveAnotherSizeThanTheirCalibration) {
  add_info("/camera/camera_info");
  add_picture("/camera/image_raw", "mono8", 17, 16, std::string(17 * 16, 'a'));
  EXPECT_THAT(problem(), AllOf(HasSubstr("17x16"), HasSubstr("16x16")));
}

TEST_F(OwnRecording, TakesThePicturesAmongTopicsOfTheirType) {
  // What is depth, a mosaic or shown by another topic is left out, and said.
  for (const char* name : {"/a_depth", "/color", "/z_bayer"}) {
    add_info(std::string(name) + "/camera_info");
  }
  add_picture("/a_depth/image_raw", "16UC1", 16, 16, std::string(512, 'a'));
  add_picture("/color/image_raw", "mono8", 16, 16, std::string(256, 'b'));
  add_picture("/color/image_rect", "mono8", 16, 16, std::string(256, 'c'));
  add_picture("/z_bayer/image_raw", "bayer_rggb8", 16, 16, std::string(256, 'd'));
  const Sequence sequence = read();
  EXPECT_THAT(sequence.image(0, 0).pixels, testing::Each('b'));
  EXPECT_THAT(
      sequence.warnings,
      ElementsAre(AllOf(HasSubstr("pictures are those of /color/image_raw"),
                        HasSubstr("/a_depth/image_raw is encoded as '16UC1', which is depth"),
                        HasSubstr("/color/image_rect shows /color/image_raw"),
                        HasSubstr("/z_bayer/image_raw is encoded as 'bayer_rggb8'"))));
}

TEST_F(OwnRecording, LeavesOutTruthThatWasLostAndTransformsThatNobodyFilled) {
  add_info("/camera/camera_info");
  for (int i = 0; i < 6; ++i) {
    written_ = from_ms(50.0 * (i + 1)).count();
    add_picture("/camera/image_raw", "mono8", 16, 16, std::string(256, 'a'));
    PoseMessage pose{.head = {from_ms(50.0 * (i + 1)), "world"}, .pose = {}};
    if (i == 2) pose.pose.rotation.setZero();
    if (i == 4) pose.pose.position.setConstant(std::nan(""));
    add("/truth", PoseMessage::kType, written(pose, WireFormat::kRos1));
  }
  TransformMessage none{.head = {Nanos(1), "base"}, .child = "arm", .parent_from_child = {}};
  none.parent_from_child.rotation.setZero();
  add("/tf_static", TransformMessage::kType, written(std::vector{none}, WireFormat::kRos1));
  const Sequence sequence = read();
  EXPECT_EQ(sequence.truth.size(), 4U);
  EXPECT_THAT(sequence.warnings,
              testing::Contains(AllOf(HasSubstr("2 of 6 messages of /truth are left out"),
                                      HasSubstr("message 3 of /truth"))));
}

TEST_F(OwnRecording, LeavesOutMessagesThatAreNone) {
  add_info("/camera/camera_info");
  for (int i = 0; i < 5; ++i) {
    written_ = from_ms(50.0 * (i + 1)).count();
    if (i == 2) {
      add("/camera/image_raw", ImageMessage::kType, "");
    } else {
      add_picture("/camera/image_raw", "mono8", 16, 16, std::string(256, static_cast<char>(i)));
    }
  }
  const Sequence sequence = read();
  ASSERT_EQ(sequence.frames.size(), 4U);
  EXPECT_THAT(sequence.image(2, 0).pixels, testing::Each(3));
  EXPECT_THAT(sequence.warnings,
              testing::Contains(HasSubstr("1 of 5 messages of /camera/image_raw are left out")));
}

TEST_F(OwnRecording, TakesTheTimeOfRecordingWhereMessagesHaveNone) {
  add_info("/camera/camera_info");
  const std::string pixels(256, 'a');
  for (int i = 1; i < 5; ++i) {
    writer_->write("/camera/image_raw", ImageMessage::kType, from_ms(50.0 * i),
                   written(ImageMessage{.head = {Nanos(0), "camera"},
                                        .compressed = false,
                                        .width = 16,
                                        .height = 16,
                                        .encoding = "mono8",
                                        .step = 16,
                                        .data = pixels},
                           WireFormat::kRos1));
  }
  const Sequence sequence = read();
  ASSERT_EQ(sequence.frames.size(), 4U);
  EXPECT_EQ(sequence.frames[3].time, from_ms(200));
  EXPECT_THAT(sequence.warnings, ElementsAre(HasSubstr("have no stamps")));
}

/// An IMU of two topics, as some drivers publish it.
class HalfImus : public OwnRecording {
 protected:
  void add_half(const std::string& topic, double time_ms, bool gyro) {
    ImuMessage message{.head = {from_ms(time_ms), "camera"},
                       .gyro_rad_s = {time_ms, 1, 2},
                       .accel_m_s2 = {0.01 * time_ms, 0.1 * time_ms, 9.8}};
    (gyro ? message.has_accel : message.has_gyro) = false;
    (gyro ? message.accel_m_s2 : message.gyro_rad_s).setConstant(std::nan(""));
    writer_->write(topic, ImuMessage::kType, from_ms(time_ms), written(message, WireFormat::kRos1));
  }
  void SetUp() override {
    add_info("/camera/camera_info");
    written_ = from_ms(15).count();
    add_picture("/camera/image_raw", "mono8", 16, 16, std::string(256, 'a'));
    for (const double time : {10.0, 20.0, 30.0}) add_half("/accel", time, false);
  }
};

TEST_F(HalfImus, AreJoined) {
  for (const double time : {5.0, 12.0, 25.0, 35.0}) add_half("/gyro", time, true);
  const Sequence sequence = read();
  // The gyroscope's times that lie between two of the accelerometer's.
  ASSERT_EQ(sequence.imu.size(), 2U);
  EXPECT_EQ(sequence.imu[0].time, from_ms(12));
  EXPECT_NEAR(sequence.imu[0].accel_m_s2.x(), 0.12, 1e-12);
  EXPECT_NEAR(sequence.imu[1].accel_m_s2.y(), 2.5, 1e-12);
  EXPECT_EQ(sequence.imu[1].gyro_rad_s.x(), 25);
  EXPECT_THAT(sequence.warnings, testing::Contains(HasSubstr("/gyro and /accel are joined")));
}

TEST_F(HalfImus, OneOfThemIsNoImu) {
  EXPECT_THAT(problem(), AllOf(HasSubstr("/accel has no angular velocity"),
                               HasSubstr("covariance[0]"), HasSubstr("imu=none")));
}

// As a RealSense's: by the covariances of both they measure all.
TEST_F(OwnRecording, HalvesOfAnImuThatAreAlwaysZeroAreLeftOut) {
  add_info("/camera/camera_info");
  written_ = from_ms(25).count();
  add_picture("/camera/image_raw", "mono8", 16, 16, std::string(256, 'a'));
  const auto add_imu = [this](const char* topic, const ImuMessage& message) {
    writer_->write(topic, ImuMessage::kType, message.head.time,
                   written(message, WireFormat::kRos1));
  };
  for (int i = 1; i < 15; ++i) {
    const MessageHead head{from_ms(10.0 * i), "camera"};
    add_imu("/accel", {.head = head, .accel_m_s2 = {0, 0, 9.8}});
    add_imu("/gyro", {.head = head, .gyro_rad_s = {0.1, 0, 0}});
  }
  writer_->publish();
  for (const SequenceTopics& topics : {SequenceTopics{}, parse_topics("imu=/accel+/gyro")}) {
    const Sequence sequence = read_sequence(file_, {.topics = topics});
    ASSERT_EQ(sequence.imu.size(), 13U);
    EXPECT_EQ(sequence.imu[5].gyro_rad_s.x(), 0.1);
    EXPECT_NEAR(sequence.imu[5].accel_m_s2.z(), 9.8, 1e-12);
  }
}

/// A bag of one chunk, with that chunk packed by a program.
class PackedBag : public testing::Test {
 protected:
  void write(const std::string& compression, const std::string& command) {
    SceneOptions options = small_scene(false);
    options.camera_rate_hz = 5;
    sequence_ = generate_sequence(options);
    ASSERT_TRUE(write_recording(sequence_, file_));
    const std::string text = text_of(file_);
    const std::size_t begin = bag::kVersion.size() + bag::kHeadBytes;
    const auto number = [&](std::size_t at) {
      std::uint32_t value = 0;
      std::memcpy(&value, text.data() + at, sizeof value);
      return value;
    };
    const std::size_t data = begin + 8 + number(begin);
    const std::size_t size = number(data - 4);
    put(plain_, text.substr(data, size));
    if (!command.empty()) {
      if (std::system((command + " <" + plain_.string() + " >" + packed_.string()).c_str()) != 0) {
        GTEST_SKIP() << "there is no " << command;
      }
    } else {
      put(packed_, text_of(plain_));
    }
    const std::string chunk =
        bag::record(bag::op_field(bag::Op::kChunk) + bag::field("compression", compression) +
                        bag::field("size", bag::raw(static_cast<std::uint32_t>(size))),
                    text_of(packed_));
    std::string head = text.substr(0, begin);
    const auto at = head.find("index_pos=") + 10;
    std::uint64_t index = 0;
    std::memcpy(&index, head.data() + at, sizeof index);
    head.replace(at, 8, bag::raw(index + chunk.size() - (data + size - begin)));
    put(file_, head + chunk + text.substr(data + size));
  }

  const test::ScratchFolder scratch_;
  fs::path file_ = scratch_.path() / "packed.bag";
  fs::path plain_ = scratch_.path() / "plain", packed_ = scratch_.path() / "chunk";
  Sequence sequence_;
};

TEST_F(PackedBag, OfBz2IsUnpacked) {
  write("bz2", "bzip2");
  if (IsSkipped()) return;
  EXPECT_EQ(read_sequence(file_).image(1, 0).pixels, sequence_.image(1, 0).pixels);
}

TEST_F(PackedBag, OfLz4IsUnpacked) {
  write("lz4", "lz4 -q");
  if (IsSkipped()) return;
  EXPECT_EQ(read_sequence(file_).image(1, 0).pixels, sequence_.image(1, 0).pixels);
}

TEST_F(PackedBag, SaysWhichCompressionIsNotKnown) {
  write("zip", "");
  EXPECT_THAT(bad_input([&] { static_cast<void>(read_sequence(file_)); }),
              AllOf(HasSubstr("'zip'"), HasSubstr("none, bz2, lz4 or zstd")));
}

TEST_F(PackedBag, SaysThatAChunkIsDamaged) {
  write("bz2", "");
  EXPECT_THAT(bad_input([&] { static_cast<void>(read_sequence(file_)); }),
              HasSubstr("a chunk of bz2 does not unpack"));
}

TEST(Bag, ThatWasNotClosedNamesTheRemedy) {
  const test::ScratchFolder scratch;
  const auto file = scratch.path() / "open.bag";
  ASSERT_TRUE(write_recording(generate_sequence(small_scene(false)), file));
  std::string text = text_of(file);
  text.replace(text.find("index_pos=") + 10, 8, std::string(8, '\0'));
  put(file, text);
  EXPECT_THAT(bad_input([&] { static_cast<void>(read_sequence(file)); }),
              AllOf(HasSubstr("was not closed"), HasSubstr("rosbag reindex")));
}

TEST(Wire, PutsCdrFieldsAtMultiplesOfTheirSize) {
  // OMG CDR, little-endian: a text of 2 letters takes 4 + 3 bytes, the number behind it begins
  // at 8.
  WireWriter out(WireFormat::kCdr);
  out.text("ab");
  out.f64(1.0);
  out.u8(7);
  out.u32(5);
  EXPECT_EQ(out.written(), std::string("\0\1\0\0"
                                       "\3\0\0\0ab\0\0"
                                       "\0\0\0\0\0\0\xf0\x3f"
                                       "\7\0\0\0\5\0\0\0",
                                       28));
  WireReader in(out.written(), WireFormat::kCdr, "it");
  EXPECT_EQ(in.text(), "ab");
  EXPECT_EQ(in.f64(), 1.0);
  EXPECT_EQ(in.u8(), 7);
  EXPECT_EQ(in.u32(), 5U);
  EXPECT_EQ(bad_input([&] { in.u8(); }), "it ends within a field");
}

TEST(Wire, ReadsWhatCdrSaysOfItself) {
  // A number of 4 bytes and one of 8, which XCDR2 has at a multiple of 4.
  const std::string one("\x3f\xf0\0\0\0\0\0\0", 8);
  const auto read = [](const std::string& bytes) {
    WireReader in(bytes, WireFormat::kCdr, "it");
    const std::uint32_t number = in.u32();
    return std::pair(number, in.f64());
  };
  EXPECT_EQ(read(std::string("\0\0\0\0\0\0\0\5\0\0\0\0", 12) + one), std::pair(5U, 1.0));
  EXPECT_EQ(read(std::string("\0\6\0\0\0\0\0\5", 8) + one), std::pair(5U, 1.0));
  EXPECT_EQ(read(std::string("\0\7\0\0\5\0\0\0\0\0\0\0\0\0\xf0\x3f", 16)), std::pair(5U, 1.0));
  EXPECT_THAT(bad_input([&] { read(std::string("\0\2\0\0", 4)); }), HasSubstr("CDR of kind 2"));
}

TEST(Recording, ThatIsOfAnotherKindIsNamed) {
  const test::ScratchFolder scratch;
  const auto refused = [&](const std::string& name, const std::string& text) {
    put(scratch.path() / name, text);
    return bad_input([&] { static_cast<void>(open_recording(scratch.path() / name)); });
  };
  EXPECT_THAT(refused("a.mcap", "x"), HasSubstr("no MCAP recording"));
  EXPECT_THAT(refused("a.db3", ""), HasSubstr("is empty"));
  EXPECT_THAT(refused("a.txt", "x"),
              AllOf(HasSubstr(".bag"), HasSubstr(".db3"), HasSubstr(".mcap")));
  for (const char* name : {"p.bag", "p.db3", "p.mcap", "p.db3.zstd"}) {
    EXPECT_THAT(refused(name, "version https://git-lfs.github.com/spec/v1\noid sha256:0\n"),
                AllOf(HasSubstr("Git LFS"), HasSubstr("git lfs pull")));
  }
}

}  // namespace
}  // namespace pirt
