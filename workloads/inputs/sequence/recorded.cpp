#include "workloads/inputs/sequence/recorded.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <functional>
#include <iterator>
#include <map>
#include <memory>
#include <opencv2/core.hpp>

#include "workloads/base/error.h"
#include "workloads/inputs/pictures/recorded_picture.h"
#include "workloads/inputs/recording/messages.h"
#include "workloads/inputs/recording/recording.h"
#include "workloads/inputs/sequence/imu_check.h"
#include "workloads/inputs/sequence/recorded_calibration.h"
#include "workloads/inputs/sequence/recorded_imu.h"
#include "workloads/inputs/sequence/recorded_topics.h"
#include "workloads/inputs/sequence/stamps.h"
#include "workloads/inputs/sequence/trajectory.h"
#include "workloads/inputs/sequence/transforms.h"

namespace pirt {
namespace {

constexpr Nanos kUnusable = Nanos::min();  ///< Does not rise, so that it is left out.

struct PictureAt {
  Nanos time{};
  std::size_t message = 0;
};

/// One camera's messages.
struct Camera {
  std::size_t topic = 0;
  std::string frame = {};  ///< Of coordinates.
  RecordedCalibration calibration = {};
  std::vector<PictureAt> pictures = {};

  [[nodiscard]] CameraModel& model() { return calibration.camera.model; }
  [[nodiscard]] const CameraModel& model() const { return calibration.camera.model; }
};

struct ImuTopic {
  std::size_t topic = 0;
  std::string frame = {};
  std::vector<ImuSample> samples = {};
};

class Reader {
 public:
  Reader(std::shared_ptr<const Recording> recording, const ReadOptions& options)
      : recording_(std::move(recording)),
        options_(options),
        calibrations_(*recording_, options.calibration) {}

  Sequence read() {
    sequence_.name = recording_->file();
    sequence_.warnings = recording_->warnings();
    use_topics();
    read_messages();
    for (std::size_t i = 0; i < cameras_.size(); ++i) finish_camera(i);
    read_inertial();
    place_cameras();
    frame_pictures();
    read_truth();
    return std::move(sequence_);
  }

 private:
  [[nodiscard]] const Topic& topic(std::size_t i) const { return recording_->topics()[i]; }
  [[noreturn]] void fail(const std::string& problem) const {
    throw_bad_input("'" + recording_->file() + "' " + problem);
  }

  void use_topics() {
    const auto topics = find_topics(*recording_, options_, calibrations_, sequence_.warnings);
    for (const std::size_t each : topics.cameras) cameras_.push_back({each});
    for (const std::size_t each : topics.imus) imus_.push_back({each});
    truth_topic_ = topics.truth;
  }

  [[nodiscard]] bool is_static(std::size_t id) const {
    return topic(id).name.ends_with("tf_static");
  }

  /// Those of the left camera's robot, in whose folder it is; of either name all where none is.
  [[nodiscard]] std::vector<std::size_t> transform_topics() const {
    auto all = recording_->of_type(TransformMessage::kType);
    std::ranges::copy(recording_->of_type(TransformMessage::kOldType), std::back_inserter(all));
    const auto is_own = [this](std::size_t id) {
      const std::string folder = folder_of(topic(id).name);
      return folder.empty() || topic(cameras_.front().topic).name.starts_with(folder + "/");
    };
    auto used = all;
    std::erase_if(used, [&](std::size_t id) {
      return !is_own(id) && std::ranges::any_of(all, [&](std::size_t other) {
        return is_own(other) && is_static(other) == is_static(id) &&
               !folder_of(topic(other).name).empty();
      });
    });
    return used;
  }

  /// Those of all topics that are used, in one pass.
  void read_messages() {
    constexpr std::uint64_t kHead = 4096;
    // Opening may fail, and what it gives need not be a message at all.
    using Open = std::function<WireReader()>;
    using Read = std::function<void(const Open&)>;
    std::vector<Recording::Wanted> wanted;
    std::map<std::size_t, Read> reads;
    const auto read = [&](std::size_t id, std::uint64_t most, Read by) {
      wanted.push_back({id, most});
      reads[id] = std::move(by);
    };
    for (const std::size_t id : transform_topics()) {
      read(id, Recording::kWhole, [this, id](const Open& open) {
        if_usable(id, [&] {
          auto in = open();
          transforms_.add(read_transforms(in), is_static(id));
        });
      });
    }
    for (Camera& camera : cameras_) {
      read(camera.topic, kHead, [&camera, this](const Open& open) {
        auto& picture = camera.pictures.emplace_back(PictureAt{kUnusable, camera.pictures.size()});
        if_usable(camera.topic, [&] {
          auto in = open();
          const MessageHead head = read_head(in);
          if (camera.frame.empty()) camera.frame = head.frame;
          picture.time = head.time;
        });
      });
    }
    for (ImuTopic& imu : imus_) {
      read(imu.topic, Recording::kWhole, [&imu, this](const Open& open) {
        auto& sample = imu.samples.emplace_back(ImuSample{.time = kUnusable});
        if_usable(imu.topic, [&] {
          auto in = open();
          const auto message = ::pirt::read_imu(in);
          // What the other half measures need not be a number here.
          const bool is_gyro = &imu == &imus_.front(), is_accel = &imu == &imus_.back();
          if ((is_gyro && !message.gyro_rad_s.allFinite()) ||
              (is_accel && !message.accel_m_s2.allFinite())) {
            in.fail("has a number that is not finite");
          }
          if (imu.frame.empty()) imu.frame = message.head.frame;
          sample = {message.head.time, message.gyro_rad_s, message.accel_m_s2};
        });
      });
    }
    if (truth_topic_) {
      read(*truth_topic_, Recording::kWhole, [this](const Open& open) {
        auto& row = sequence_.truth.emplace_back(TruthRow{.time = kUnusable, .body = {}});
        if_usable(*truth_topic_, [&] {
          auto in = open();
          const auto message = read_pose(in, topic(*truth_topic_).type);
          if (truth_frame_.empty()) truth_frame_ = message.child;
          row = {message.head.time, message.pose};
        });
      });
    }
    recording_->walk(wanted, [&](std::size_t id, std::size_t index, const Recording::Load& load) {
      std::string bytes;  // for as long as they are read
      reads.at(id)([&] {
        bytes = load();
        return recording_->reader(id, index, bytes);
      });
    });
    for (const auto& [id, problem] : unusable_) {
      sequence_.warnings.push_back(fmt::format("{} of {} messages of {} are left out: {}",
                                               problem.count, topic(id).messages, topic(id).name,
                                               problem.first));
    }
  }

  /// A sensor that is lost writes zeros, or no numbers: that costs its message, not the recording.
  void if_usable(std::size_t id, const std::function<void()>& read) {
    try {
      read();
    } catch (const Error& error) {
      if (error.code() != ErrorCode::kBadInput) throw;
      auto& problem = unusable_.try_emplace(id, Unusable{0, error.what()}).first->second;
      ++problem.count;
    }
  }

  void finish_camera(std::size_t place) {
    Camera& camera = cameras_[place];
    order(camera.pictures, camera.topic, kFinestPicture_s);
    camera.calibration = calibrations_.of(topic(camera.topic).name, place, sequence_.warnings);
    double& rate_hz = camera.model().rate_hz;
    rate_hz = usual_rate_hz(stamps_of(camera.pictures), rate_hz);
  }

  void read_inertial() {
    if (imus_.empty()) return;
    const std::string& name = topic(imus_[0].topic).name;
    const std::string& frame = imus_[0].frame;
    const auto& given = cameras_.front().calibration.given;
    const bool is_placed = given && given->body_from_camera;
    // Two that name no frame are not in the same one.
    const bool is_named = !frame.empty() || !cameras_.front().frame.empty();
    if (!is_placed && !(is_named && transforms_.between(frame, cameras_.front().frame))) {
      const std::string why = is_named
                                  ? fmt::format("no transform of /tf_static leads from {} to {}",
                                                cameras_.front().frame, frame)
                                  : "neither it nor the camera names its frame for /tf_static";
      sequence_.warnings.push_back(
          fmt::format("{} is not used: {}, so that nobody knows where the IMU sits", name, why));
      return;
    }
    for (ImuTopic& each : imus_) {
      part_equal_stamps(each.samples);
      order(each.samples, each.topic);
      spread_bursts(each.samples, topic(each.topic).name, sequence_.warnings);
    }
    auto samples = std::move(imus_[0].samples);
    if (imus_.size() > 1) {
      const std::string& other = topic(imus_[1].topic).name;
      const auto place = transforms_.between(frame, imus_[1].frame);
      if (!place) {
        fail(fmt::format("has no transform of /tf_static from {} to {}, the frames of {} and {}",
                         imus_[1].frame, frame, other, name));
      }
      join_samples(samples, imus_[1].samples, place->rotation);
      sequence_.warnings.push_back(fmt::format("{} and {} are joined to one IMU", name, other));
      if (samples.size() < 2) fail(fmt::format("has no accelerations at the times of {}", name));
    }
    body_ = frame;
    sequence_.imu = std::move(samples);
    check_imu("'" + recording_->file() + "': " + name, sequence_.imu, sequence_.warnings);
    ImuModel& model = sequence_.imu_model.emplace();
    model.rate_hz = usual_rate_hz(stamps_of(sequence_.imu), model.rate_hz);
  }

  void place_cameras() {
    Camera& left = cameras_.front();
    if (body_.empty()) body_ = left.frame;
    const auto place = [this](const Camera& camera) -> Pose {
      const auto& given = camera.calibration.given;
      if (given && given->body_from_camera) {
        return sequence_.imu.empty() ? Pose{} : *given->body_from_camera;
      }
      const Pose turned{camera.calibration.camera.picture_from_raw().transpose(),
                        Eigen::Vector3d::Zero()};
      return *transforms_.between(body_, camera.frame) * turned;
    };
    left.model().body_from_camera = place(left);
    if (cameras_.size() > 1) {
      Camera& right = cameras_[1];
      const InfoCamera& left_info = left.calibration.camera;
      const InfoCamera& right_info = right.calibration.camera;
      const Pose& origin = left.model().body_from_camera;
      Pose& placed = right.model().body_from_camera;
      const bool has_tf =
          right.frame != left.frame && transforms_.between(body_, right.frame).has_value();
      const bool has_info = right_info.right_m > left_info.right_m;
      const Pose by_info = left_info.pose_of(right_info);
      if (const auto from_right = left_from_right()) {
        placed = origin * *from_right;
      } else if (has_tf) {
        placed = place(right);
        // Projections of two rigs are of different cameras.
        const auto rig_of = [this](const Camera& camera) {
          return folder_of(folder_of(base_topic(topic(camera.topic).name)));
        };
        if (has_info && rig_of(left) == rig_of(right) &&
            differ(origin.inverse() * placed, by_info)) {
          placed = origin * by_info;
        }
      } else if (has_info) {
        placed = origin * by_info;
      } else {
        sequence_.warnings.push_back(
            topic(right.topic).name +
            " is not used: neither /tf_static nor its projection says where the camera sits");
        cameras_.resize(1);
      }
    }
    for (const Camera& camera : cameras_) sequence_.cameras.push_back(camera.model());
  }

  /// Of the right camera in the left one's axes. A simulator may name frames that are not those of
  /// pictures, whose z is ahead.
  [[nodiscard]] bool differ(const Pose& by_tf, const Pose& by_info) {
    constexpr double kPart = 0.2, kTurn_deg = 3;
    const double apart_m = (by_tf.position - by_info.position).norm();
    const double turn_deg =
        angle_of(by_tf.rotation.transpose() * by_info.rotation) * kDegreesPerRadian;
    if (apart_m <= kPart * by_info.position.norm() && turn_deg <= kTurn_deg) return false;
    const auto text = [](const Eigen::Vector3d& at) {
      return fmt::format("({:.3f}, {:.3f}, {:.3f}) m", at.x(), at.y(), at.z());
    };
    sequence_.warnings.push_back(fmt::format(
        "{} is at {} of {} by /tf_static and at {} by their projections, turned by {:.1f} degrees "
        "between the two: the projections are taken; are the frames those of the pictures, z "
        "ahead?",
        topic(cameras_[1].topic).name, text(by_tf.position), topic(cameras_[0].topic).name,
        text(by_info.position), turn_deg));
    return true;
  }

  /// As a file says it.
  [[nodiscard]] std::optional<Pose> left_from_right() const {
    const auto& left = cameras_[0].calibration.given;
    const auto& right = cameras_[1].calibration.given;
    if (!left || !right) return std::nullopt;
    for (const auto from : {&GivenCamera::body_from_camera, &GivenCamera::first_from_camera}) {
      const std::optional<Pose>& of_left = (*left).*from;
      const std::optional<Pose>& of_right = (*right).*from;
      if (of_left && of_right) return of_left->inverse() * *of_right;
    }
    return std::nullopt;
  }

  void frame_pictures() {
    const auto left = stamps_of(cameras_.front().pictures);
    Partners partners;
    if (cameras_.size() > 1) {
      partners = pair_stamps(left, stamps_of(cameras_[1].pictures), options_.pair_tolerance,
                             sequence_.warnings);
    }
    make_frames(sequence_, left, partners,
                {topic(cameras_.front().topic).name, topic(cameras_.back().topic).name});
    const auto& given = cameras_.front().calibration.given;
    if (given) frames_by_imu(sequence_, given->imu_later_s);
    sequence_.image = [recording = recording_, partners, cameras = cameras_,
                       deep = std::make_shared<std::array<std::atomic<bool>, 2>>()](
                          std::size_t frame, std::size_t camera) {
      const Camera& by = cameras[camera];
      const std::size_t picture = camera == 0 ? frame : partners[frame].value();
      return recorded_grey(*recording, by.topic, by.pictures[picture].message, by.model().width,
                           by.model().height, &deep->at(camera));
    };
  }

  void read_truth() {
    if (!truth_topic_) return;
    const std::string& name = topic(*truth_topic_).name;
    if (options_.topics.truth) {
      order(sequence_.truth, *truth_topic_);
    } else {
      take_truth(sequence_, name, [this] { order(sequence_.truth, *truth_topic_); });
    }
    if (sequence_.truth.empty()) return;
    const auto body =
        truth_frame_.empty() ? std::nullopt : transforms_.between(truth_frame_, body_);
    for (TruthRow& row : sequence_.truth) {
      if (body) row.body = row.body * *body;
    }
    // Truth of no frame's name is of the body, which is the IMU's where the recording has one.
    const bool is_unplaced = !truth_frame_.empty() && truth_frame_ != body_ && !body;
    const bool may_be_imus = truth_frame_.empty() && sequence_.imu.empty() &&
                             !recording_->of_type(ImuMessage::kType).empty();
    if (is_unplaced || may_be_imus) {
      sequence_.warnings.push_back(fmt::format(
          "nobody knows where {} sits on {}, whose path is estimated: errors against {} have that "
          "in them",
          is_unplaced ? truth_frame_ : "what " + name + " is of", body_, name));
    }
  }

  /// Rows of all messages of a topic, as recorded. Where most have no stamp, the times of recording
  /// are taken.
  template <typename Row>
  void order(std::vector<Row>& rows, std::size_t id, double finest_s = kFinest_s) {
    const auto none =
        std::ranges::count_if(rows, [](const Row& row) { return row.time == Nanos::zero(); });
    const bool has_stamps = 2 * none <= std::ssize(rows);
    if (!has_stamps) {
      for (std::size_t i = 0; i < rows.size(); ++i) {
        if (rows[i].time != kUnusable) rows[i].time = recording_->time(id, i);
      }
      sequence_.warnings.push_back(
          fmt::format("messages of {} have no stamps; the times of recording are taken, which are "
                      "later and less even",
                      topic(id).name));
    }
    const auto unusable = unusable_.find(id);
    if (unusable != unusable_.end() && 2 * unusable->second.count > rows.size()) {
      throw_bad_input(unusable->second.first);
    }
    const auto recorded = keep_window(rows, id);
    const auto stamps = stamps_of(rows);
    const auto [begin, end] = keep_rising(rows, topic(id).name, sequence_.warnings, Nanos::zero());
    if (id == cameras_.front().topic) {
      // Where all were recorded at one time that tells no runs apart.
      if (begin > 0 && recorded[begin - 1] < recorded[begin]) window_.first = recorded[begin - 1];
      if (end < recorded.size() && recorded[end - 1] < recorded[end]) {
        window_.second = recorded[end];
      }
      span_ = {recorded[begin], recorded[end - 1]};
    }
    if (has_stamps) compare_clock(id, recorded, stamps);
    check_step("'" + recording_->file() + "': " + topic(id).name, stamps_of(rows), std::nullopt,
               finest_s);
  }

  /// Takes out what cannot be used, and what is of another run of the left camera's clock.
  /// @return  When those that are left were recorded.
  template <typename Row>
  [[nodiscard]] std::vector<Nanos> keep_window(std::vector<Row>& rows, std::size_t id) {
    std::vector<Nanos> recorded;
    std::size_t outside = 0;
    for (std::size_t i = 0; i < rows.size(); ++i) {
      if (rows[i].time == kUnusable) continue;
      const Nanos at = recording_->time(id, i);
      if (window_.first < at && at < window_.second) {
        recorded.push_back(at);
      } else {
        rows[i].time = kUnusable;
        ++outside;
      }
    }
    const std::string& left = topic(cameras_.front().topic).name;
    if (recorded.empty()) {
      fail(
          fmt::format("has no message of {} in the run of {} that is used; choose another topic, "
                      "or none (--topics)",
                      topic(id).name, left));
    }
    if (outside > 0) {
      sequence_.warnings.push_back(
          fmt::format("{} of {} messages of {} were recorded in other runs of {}, and are not used",
                      outside, rows.size(), topic(id).name, left));
    }
    std::erase_if(rows, [](const Row& row) { return row.time == kUnusable; });
    return recorded;
  }

  /// With the left camera's, by how long before they are recorded the two stamp their messages.
  void compare_clock(std::size_t id, const std::vector<Nanos>& recorded,
                     const std::vector<Nanos>& stamps) {
    constexpr double kMost_s = 0.25;
    std::vector<double> delays_s;
    for (std::size_t i = 0; i < stamps.size(); ++i) {
      if (stamps[i] > Nanos::zero() && span_.first <= recorded[i] && recorded[i] <= span_.second) {
        delays_s.push_back(to_s(recorded[i]) - to_s(stamps[i]));
      }
    }
    constexpr std::ptrdiff_t kLeast = 3;  // What is said once may be said again.
    if (std::ssize(delays_s) < kLeast) return;
    // A clock of another pace, as a converter's or none, tells nothing of the stamps'.
    const bool stays = std::abs(delays_s.back() - delays_s.front()) <=
                       std::max(kMost_s, 0.01 * to_s(span_.second - span_.first));
    const auto middle = delays_s.begin() + std::ssize(delays_s) / 2;
    std::ranges::nth_element(delays_s, middle);
    const std::size_t left = cameras_.front().topic;
    if (id == left && stays) left_delay_s_ = *middle;
    if (!left_delay_s_ || std::abs(*middle - *left_delay_s_) <= kMost_s) return;
    sequence_.warnings.push_back(
        fmt::format("stamps of {} are usually {:.3f} s before they were recorded, those of {} "
                    "{:.3f} s: are these two clocks?",
                    topic(id).name, *middle, topic(left).name, *left_delay_s_));
  }

  std::shared_ptr<const Recording> recording_;
  const ReadOptions& options_;
  RecordedCalibrations calibrations_;
  Transforms transforms_;
  std::vector<Camera> cameras_;
  std::vector<ImuTopic> imus_;  ///< Two: gyroscope, accelerometer.
  std::optional<std::size_t> truth_topic_;
  struct Unusable {
    std::size_t count = 0;
    std::string first;
  };
  std::map<std::size_t, Unusable> unusable_;  ///< Messages by topic.
  std::string truth_frame_;                   ///< Whose pose it is, where the type says it.
  std::string body_;                          ///< Frame of coordinates.
  /// Of the left camera by the recorder's clock: between the pictures of other runs that are next
  /// to its run, and from that one's first picture to its last.
  std::pair<Nanos, Nanos> window_{Nanos::min(), Nanos::max()}, span_;
  std::optional<double> left_delay_s_;  ///< From its stamps to when they were recorded, usually.
  Sequence sequence_;
};

}  // namespace

Sequence read_recording(const std::filesystem::path& file, const ReadOptions& options) {
  return Reader(open_recording(file), options).read();
}

}  // namespace pirt
