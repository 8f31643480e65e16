#include "workloads/inputs/sequence/recorded_imu.h"

#include <fmt/core.h>

#include <algorithm>
#include <string>
#include <utility>

#include "workloads/base/error.h"
#include "workloads/base/text/text.h"
#include "workloads/inputs/recording/first_message.h"
#include "workloads/inputs/recording/messages.h"

namespace pirt {
namespace {

struct Inertial {
  std::size_t topic = 0;
  bool has_gyro = false, has_accel = false;
  bool zero_gyro = false, zero_accel = false;  ///< In all of the first messages.
};

Inertial look_at(const Recording& recording, std::size_t topic) {
  constexpr std::size_t kLooked = 10;
  const auto read = [](WireReader& in) { return read_imu(in); };
  const ImuMessage first = first_message(recording, topic, read);
  Inertial found{topic, first.has_gyro, first.has_accel, first.gyro_rad_s.isZero(0),
                 first.accel_m_s2.isZero(0)};
  for (std::size_t i = 0; i < std::min(kLooked, recording.topics()[topic].messages); ++i) {
    try {
      const ImuMessage message = read_message(recording, topic, i, read);
      found.zero_gyro = found.zero_gyro && message.gyro_rad_s.isZero(0);
      found.zero_accel = found.zero_accel && message.accel_m_s2.isZero(0);
    } catch (const Error& error) {
      if (error.code() != ErrorCode::kBadInput) throw;
    }
  }
  return found;
}

/// Some drivers say zero, and how sure they are of it, where they measure nothing. No accelerometer
/// measures zero; a gyroscope that is simulated does, at rest.
void leave_out_zeros(std::vector<Inertial>& found) {
  for (Inertial& each : found) each.has_accel = each.has_accel && !each.zero_accel;
  // Only where another is the gyroscope's half.
  const bool is_apart = std::ranges::any_of(found, [](const Inertial& each) {
    return each.has_gyro && !each.zero_gyro && !each.has_accel;
  });
  if (!is_apart) return;
  for (Inertial& each : found) each.has_gyro = each.has_gyro && !each.zero_gyro;
}

}  // namespace

std::vector<std::size_t> imu_among(const Recording& recording,
                                   const std::vector<std::size_t>& topics, bool are_chosen,
                                   std::vector<std::string>& warnings) {
  std::vector<Inertial> found;
  std::string unusable;
  for (const std::size_t each : topics) {
    try {
      found.push_back(look_at(recording, each));
    } catch (const Error& error) {
      if (error.code() != ErrorCode::kBadInput || are_chosen) throw;
      unusable = error.what();
      warnings.push_back(recording.topics()[each].name + " is not used: " + unusable);
    }
  }
  if (found.empty() && unusable.empty()) return {};
  if (found.empty()) throw_bad_input(unusable + "; run without it: --topics imu=none");
  if (found.size() > 1) leave_out_zeros(found);
  std::vector<std::size_t> whole, gyros, accels;
  std::vector<std::string> names;
  for (const Inertial& each : found) {
    if (each.has_gyro && each.has_accel) {
      whole.push_back(each.topic);
      names.push_back(recording.topics()[each.topic].name);
    } else if (each.has_gyro) {
      gyros.push_back(each.topic);
    } else if (each.has_accel) {
      accels.push_back(each.topic);
    }
  }
  if (whole.size() > 1) {
    throw_bad_input(fmt::format(
        "'{}' has {} topics of {}; choose one: --topics imu={}, or none: {}", recording.file(),
        whole.size(), ImuMessage::kType, names.front(), join(names, ", ")));
  }
  if (whole.size() == 1) return whole;
  if (gyros.size() == 1 && accels.size() == 1) return {gyros[0], accels[0]};
  const std::string& first = recording.topics()[found.front().topic].name;
  throw_bad_input(fmt::format(
      "'{}' has no whole IMU: {} has no {} (covariance[0] is -1, or it is always 0); name the "
      "topics of gyroscope and accelerometer, --topics imu={}+OTHER, or run without: imu=none{}",
      recording.file(), first, found.front().has_gyro ? "linear acceleration" : "angular velocity",
      first, unusable.empty() ? "" : "; " + unusable));
}

void join_samples(std::vector<ImuSample>& samples, const std::vector<ImuSample>& accels,
                  const Eigen::Matrix3d& turn) {
  std::vector<ImuSample> joined;
  for (ImuSample& sample : samples) {
    const auto after = std::ranges::lower_bound(accels, sample.time, {}, &ImuSample::time);
    if (after == accels.begin() || after == accels.end()) continue;
    const ImuSample& a = *(after - 1);
    constexpr Nanos kLongest = std::chrono::milliseconds(100);
    if (after->time - a.time > kLongest) continue;
    const double part = to_s(sample.time - a.time) / to_s(after->time - a.time);
    sample.accel_m_s2 = turn * ((1 - part) * a.accel_m_s2 + part * after->accel_m_s2);
    joined.push_back(sample);
  }
  samples = std::move(joined);
}

}  // namespace pirt
