#include "workloads/inputs/sequence/sequence.h"

#include <fmt/core.h>

#include <algorithm>
#include <iterator>

#include "workloads/base/error.h"
#include "workloads/inputs/recording/recording.h"
#include "workloads/inputs/sequence/camera_info.h"
#include "workloads/inputs/sequence/recorded.h"
#include "workloads/inputs/sequence/stamps.h"
#include "workloads/inputs/sequence/trajectory.h"

namespace pirt {
namespace {

namespace fs = std::filesystem;

/// A stamp that is this many usual periods after the one before leaves a gap.
constexpr double kGap = 2.5;

template <typename Row>
void find_gaps(const std::vector<Row>& rows, const std::string& what,
               std::vector<std::string>& found) {
  if (rows.size() < 3) return;
  const double usual_s = to_s(usual_step(stamps_of(rows)));
  std::size_t gaps = 0;
  double longest_s = 0;
  double at_s = 0;
  for (std::size_t i = 1; i < rows.size(); ++i) {
    const double step_s = to_s(rows[i].time - rows[i - 1].time);
    if (step_s < kGap * usual_s) continue;
    ++gaps;
    if (step_s <= longest_s) continue;
    longest_s = step_s;
    at_s = to_s(rows[i - 1].time - rows[0].time);
  }
  if (gaps == 0) return;
  found.push_back(
      fmt::format("{}: {} gap{} in its time stamps, the longest {:.3f} s at {:.3f} s "
                  "where {:.3f} s is usual",
                  what, gaps, gaps == 1 ? "" : "s", longest_s, at_s, usual_s));
  if (longest_s > to_s(kLongestPrediction)) {
    found.back() +=
        fmt::format("; after more than {:.0f} s the robot is lost, and its pose a guess",
                    to_s(kLongestPrediction));
  }
}

/// Truth that is too rare is looked for between its stamps in vain.
void judge_truth(const Sequence& sequence, std::vector<std::string>& found) {
  const auto& truth = sequence.truth;
  if (truth.empty() || sequence.frames.empty()) return;
  constexpr double kFastest_m_s = 100;
  std::vector<double> speeds;
  for (std::size_t i = 1; i < truth.size(); ++i) {
    speeds.push_back((truth[i].body.position - truth[i - 1].body.position).norm() /
                     to_s(truth[i].time - truth[i - 1].time));
  }
  std::ranges::sort(speeds);
  if (!speeds.empty() && speeds[speeds.size() / 2] > kFastest_m_s) {
    found.push_back(fmt::format(
        "truth usually moves at {:.0f} m/s: are these millimetres? Errors against it mean nothing",
        speeds[speeds.size() / 2]));
  }
  std::size_t with = 0;
  for (const Frame& frame : sequence.frames) with += truth_at(truth, frame.time) ? 1U : 0U;
  if (2 * with >= sequence.frames.size()) return;
  const double step_s =
      to_s(truth.back().time - truth.front().time) / std::max(1.0, double(truth.size()) - 1);
  found.push_back(fmt::format(
      "truth is there at {} of {} frames: its stamps are {:.3f} s apart on average, from {:.3f} s "
      "after the first frame to {:.3f} s after it, and it is not made up where they are more than "
      "{:.1f} s apart",
      with, sequence.frames.size(), step_s, to_s(truth.front().time - sequence.frames.front().time),
      to_s(truth.back().time - sequence.frames.front().time), to_s(kLongestTruthGap)));
}

/// What a run can live with, but its user should know.
std::vector<std::string> gaps_of(const Sequence& sequence) {
  std::vector<std::string> found;
  find_gaps(sequence.frames, "camera", found);
  const auto stamps = stamps_of(sequence.frames);
  if (!stamps.empty() && playing_times(stamps).back() < stamps.back() - stamps.front()) {
    found.push_back(fmt::format("gaps of more than {:.0f} s between pictures are not waited for",
                                to_s(kLongestPrediction)));
  }
  judge_truth(sequence, found);
  find_gaps(sequence.imu, "IMU", found);
  if (sequence.imu.empty() || sequence.frames.empty()) return found;
  const Nanos begin = sequence.frames.front().time;
  const Nanos end = sequence.frames.back().time;
  if (sequence.imu.front().time > end || sequence.imu.back().time < begin) {
    throw_bad_input(
        fmt::format("'{}': the IMU's stamps, {:.3f} s to {:.3f} s, and the pictures', {:.3f} s to "
                    "{:.3f} s, have "
                    "no time in common; give them one clock, or leave the IMU out (--no-imu)",
                    sequence.name, to_s(sequence.imu.front().time), to_s(sequence.imu.back().time),
                    to_s(begin), to_s(end)));
  }
  const Nanos slack = from_ms(50);
  if (sequence.imu.front().time > begin + slack) {
    found.push_back(fmt::format("the IMU starts {:.3f} s after the camera",
                                to_s(sequence.imu.front().time - begin)));
  }
  if (sequence.imu.back().time < end - slack) {
    found.push_back(fmt::format("the IMU stops {:.3f} s before the camera",
                                to_s(end - sequence.imu.back().time)));
  }
  return found;
}

bool has_any(const fs::path& folder, std::initializer_list<const char*> names) {
  return std::ranges::any_of(names, [&](const char* name) { return fs::exists(folder / name); });
}

/// Of a folder that has pictures in a layout: a recording that lies there, too, is what was made of
/// it, or it of that.
Sequence read_layout(const fs::path& folder, const ReadOptions& options) {
  const bool is_euroc = has_any(folder, {"mav0", "cam0"});
  const bool is_kitti = has_any(folder, {"calib.txt", "image_0", "image_l"});
  const bool is_recording = names_a_recording(folder);
  const bool has_pictures = has_any(folder, {"mav0", "cam0", "image_0", "image_l"}) &&
                            !has_any(folder, {"metadata.yaml"});
  if (is_recording && !has_pictures) return read_recording(folder, options);
  const auto& topics = options.topics;
  if (topics.left || topics.right || topics.imu || topics.truth) {
    throw_bad_input("topics (--topics) are of recordings (.bag, .db3, .mcap), and '" +
                    folder.string() + "' is none");
  }
  if (!fs::is_directory(folder)) {
    throw_bad_input("'" + folder.string() +
                    "' is neither the folder of a sequence nor a recording of ROS (.bag, .db3, "
                    ".mcap, the last two also with .zstd behind)" +
                    (fs::exists(folder) ? "" : ": there is nothing of that name"));
  }
  if (is_kitti && !is_euroc && !options.calibration.empty()) {
    throw_bad_input("'" + folder.string() +
                    "' has its calibration in calib.txt; --calibration is of recordings and of "
                    "EuRoC's layout");
  }
  if (is_euroc || is_kitti) {
    Sequence sequence = is_euroc ? read_euroc(folder, options) : read_kitti(folder, options);
    if (is_recording) {
      sequence.warnings.push_back("the recording that lies in '" + folder.string() +
                                  "' is not read; its pictures are");
    }
    return sequence;
  }
  throw_bad_input(
      "'" + folder.string() +
      "' is no sequence: EuRoC's layout has mav0/cam0, KITTI's calib.txt and image_0, ROS 2's a "
      ".db3 or .mcap");
}

/// Two cameras at one place have no depth: one file was taken for both.
void check_baseline(Sequence& sequence) {
  if (sequence.cameras.size() < 2) return;
  constexpr double kLongest_m = 5;
  const double apart_m = (sequence.cameras[1].body_from_camera.position -
                          sequence.cameras[0].body_from_camera.position)
                             .norm();
  if (apart_m > kLongest_m) {
    throw_bad_input(
        fmt::format("'{}': by the calibration the two cameras are {:.1f} m apart; are these "
                    "millimetres? Give metres, or use one camera (--mono)",
                    sequence.name, apart_m));
  }
  if (apart_m > 1e-3) return;
  sequence.warnings.push_back(
      "the calibration puts both cameras at one place; those of the second are not used");
  sequence.cameras.resize(1);
  for (Frame& frame : sequence.frames) frame.present.resize(1);
}

}  // namespace

Sequence read_sequence(const fs::path& path, const ReadOptions& options) {
  Sequence sequence = read_layout(path, options);
  check_baseline(sequence);
  for (std::size_t i = 0; i < sequence.cameras.size(); ++i) {
    const std::string odd = odd_camera(sequence.cameras[i]);
    if (odd.empty()) continue;
    sequence.warnings.push_back(fmt::format("the calibration of camera {} is odd: {}", i, odd));
  }
  if (!options.truth.empty()) sequence.truth = read_tum(options.truth, sequence.warnings);
  std::ranges::move(gaps_of(sequence), std::back_inserter(sequence.warnings));
  return sequence;
}

}  // namespace pirt
