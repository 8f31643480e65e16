#include "workloads/inputs/sequence/stamps.h"

#include <fmt/core.h>

#include <algorithm>
#include <numeric>

#include "workloads/base/error.h"
#include "workloads/inputs/recording/restarts.h"

namespace pirt {
namespace {

/// The median step between two stamps, over several of those at @p ends at once.
Nanos usual_step(const std::vector<Nanos>& stamps, const std::vector<std::size_t>& ends) {
  // Of few most have to be without a pause.
  const std::size_t count = std::clamp<std::size_t>(ends.size() / 8, 1, 24);
  std::vector<Nanos> steps;
  for (std::size_t i = count; i < ends.size(); ++i) {
    const std::size_t from = ends[i - count], to = ends[i];
    steps.push_back((stamps[to] - stamps[from]) / static_cast<std::int64_t>(to - from));
  }
  if (steps.empty()) return Nanos::zero();
  const auto middle = steps.begin() + std::ssize(steps) / 2;
  std::ranges::nth_element(steps, middle);
  return *middle;
}

/// Whether samples come in bursts, of which so many follow another at once: of pairs half do.
bool are_bursts(std::size_t following, std::size_t all) {
  return following >= 2 && 4 * following > all;
}

}  // namespace

Nanos usual_step(const std::vector<Nanos>& stamps) {
  // Bursts of 2, 3, 4, 6 or 8 are even over 24.
  std::vector<std::size_t> all(stamps.size());
  std::iota(all.begin(), all.end(), std::size_t{0});
  return usual_step(stamps, all);
}

double usual_rate_hz(const std::vector<Nanos>& stamps, double otherwise) {
  const Nanos step = usual_step(stamps);
  return step > Nanos::zero() ? 1 / to_s(step) : otherwise;
}

void part_equal_stamps(std::vector<ImuSample>& imu) {
  std::vector<Nanos> later(imu.size());
  std::size_t count = 0;
  for (std::size_t i = 1; i < imu.size(); ++i) {
    const ImuSample &before = imu[i - 1], &sample = imu[i];
    if (sample.time <= Nanos::zero() || sample.time != before.time) continue;
    const auto differ = [](const auto& a, const auto& b) {  // A half may be no number.
      return a.allFinite() && b.allFinite() && a != b;
    };
    const bool is_another = differ(sample.gyro_rad_s, before.gyro_rad_s) ||
                            differ(sample.accel_m_s2, before.accel_m_s2);
    later[i] = later[i - 1] + Nanos(is_another ? 1 : 0);
    count += is_another ? 1U : 0U;
  }
  if (!are_bursts(count, imu.size())) return;
  for (std::size_t i = 0; i < imu.size(); ++i) imu[i].time += later[i];
}

void spread_bursts(std::vector<ImuSample>& imu, const std::string& what,
                   std::vector<std::string>& warnings) {
  const auto stamps = stamps_of(imu);
  const Nanos close = usual_step(stamps) / 5;
  std::vector<std::size_t> ends;  // of bursts
  for (std::size_t i = 0; i < stamps.size(); ++i) {
    if (i + 1 == stamps.size() || stamps[i + 1] - stamps[i] >= close) ends.push_back(i);
  }
  if (!are_bursts(stamps.size() - ends.size(), stamps.size())) return;
  const Nanos usual = usual_step(stamps, ends);  // of bursts of any size
  std::size_t begin = 0;
  for (const std::size_t last : ends) {
    const auto size = static_cast<std::int64_t>(last + 1 - begin);
    const Nanos before = begin == 0 ? Nanos::zero() : stamps[begin - 1];
    const Nanos step = std::min(usual, (stamps[last] - before) / size);
    for (; begin <= last; ++begin) {
      imu[begin].time = stamps[last] - step * static_cast<std::int64_t>(last - begin);
    }
  }
  warnings.push_back(what + ": samples come in bursts, and are taken to be measured evenly");
}

std::vector<Nanos> playing_times(const std::vector<Nanos>& stamps) {
  const Nanos usual = usual_step(stamps);
  std::vector<Nanos> times(stamps.size());
  for (std::size_t i = 1; i < stamps.size(); ++i) {
    const Nanos step = stamps[i] - stamps[i - 1];
    times[i] = times[i - 1] + (step > kLongestPrediction ? usual : step);
  }
  return times;
}

void check_step(const std::string& what, std::vector<Nanos> stamps, std::optional<double> rate_hz,
                double finest_s) {
  if (stamps.size() < 3) return;
  constexpr double kLongest_s = 60;
  constexpr double kFactor = 10;  // sequences are thinned out, but not filled up
  const double step_s = to_s(usual_step(stamps));
  if (rate_hz && step_s * *rate_hz * kFactor < 1) {
    throw_bad_input(fmt::format(
        "{}: its stamps are usually {:g} s apart, which is {:.0f} Hz, and its sensor.yaml "
        "says {:g} Hz; are they microseconds? Give nanoseconds",
        what, step_s, 1 / std::max(step_s, 1e-9), *rate_hz));
  }
  if (step_s < finest_s || step_s > kLongest_s) {
    throw_bad_input(fmt::format(
        "{}: its stamps are usually {:g} s apart; are they of another unit than is read here?",
        what, step_s));
  }
}

std::vector<std::size_t> rising(const std::vector<Nanos>& stamps, Nanos after) {
  // tails[n]: where a run of n + 1 stamps that rise ends earliest, so far.
  std::vector<std::size_t> tails, before(stamps.size());
  for (std::size_t i = 0; i < stamps.size(); ++i) {
    if (stamps[i] <= after) continue;
    const auto place = std::ranges::lower_bound(tails, stamps[i], {},
                                                [&](std::size_t tail) { return stamps[tail]; });
    before[i] = place == tails.begin() ? i : *(place - 1);
    if (place == tails.end()) {
      tails.push_back(i);
    } else {
      *place = i;
    }
  }
  std::vector<std::size_t> kept(tails.size());
  std::size_t at = tails.empty() ? 0 : tails.back();
  for (auto slot = kept.rbegin(); slot != kept.rend(); ++slot) at = before[*slot = at];
  return kept;
}

void tell_of_rising(const std::string& what, std::size_t kept, std::size_t all,
                    std::vector<std::string>& warnings) {
  if (kept == all) return;
  const std::string left_out = fmt::format(
      "{} of {} stamps of {} do not rise, and what has them is not used", all - kept, all, what);
  if (2 * kept < all) {
    throw_bad_input(left_out + "; a sequence needs stamps of when its messages were made");
  }
  warnings.push_back(left_out);
}

std::pair<std::size_t, std::size_t> one_run(const std::string& what,
                                            const std::vector<Nanos>& stamps,
                                            std::vector<std::string>& warnings) {
  const auto restarts = restarts_of(stamps);
  const auto run = longest_run(restarts, stamps);
  if (!restarts.empty()) {
    warnings.push_back(fmt::format(
        "the clock of {} begins anew after {} messages, as that of a simulator that was restarted: "
        "of {} those of the longest run are used, {}",
        what, restarts.front(), stamps.size(), run.second - run.first));
  }
  return run;
}

Partners pair_stamps(const std::vector<Nanos>& left, const std::vector<Nanos>& right,
                     Nanos tolerance, std::vector<std::string>& warnings) {
  const Nanos step = usual_step(left);
  if (step > Nanos::zero()) tolerance = std::min(tolerance, step / 3);
  Partners partners;
  Nanos farthest{};
  std::size_t next = 0;  // of the right ones: each has one partner
  for (const Nanos time : left) {
    while (next + 1 < right.size() &&
           std::chrono::abs(right[next + 1] - time) <= std::chrono::abs(right[next] - time)) {
      ++next;
    }
    const bool there = next < right.size() && std::chrono::abs(right[next] - time) <= tolerance;
    partners.push_back(there ? std::optional(next) : std::nullopt);
    if (there) farthest = std::max(farthest, std::chrono::abs(right[next++] - time));
  }
  if (farthest > Nanos::zero()) {
    warnings.push_back(
        fmt::format("pictures of the two cameras are up to {:.3f} ms apart and taken to be of one "
                    "moment (up to {:.1f} ms are: --stereo-tolerance)",
                    to_ms(farthest), to_ms(tolerance)));
  }
  return partners;
}

void make_frames(Sequence& sequence, const std::vector<Nanos>& left, const Partners& partners,
                 const std::pair<std::string, std::string>& names) {
  const auto pairs = std::ranges::count_if(partners, [](const auto& p) { return p.has_value(); });
  if (pairs == 0) sequence.cameras.resize(1);
  for (std::size_t i = 0; i < left.size(); ++i) {
    Frame frame{left[i], {true}};
    if (pairs > 0) frame.present.push_back(partners[i].has_value());
    sequence.frames.push_back(std::move(frame));
  }
  if (partners.empty() || pairs == std::ssize(left)) return;
  sequence.warnings.push_back(
      pairs == 0
          ? fmt::format("{} is not used: none of its pictures is of the same moment as one of {} "
                        "(3 ms, or what --stereo-tolerance says)",
                        names.second, names.first)
          : fmt::format("{} of {} frames of {} have no picture of {}", std::ssize(left) - pairs,
                        left.size(), names.first, names.second));
}

void frames_by_imu(Sequence& sequence, double later_s) {
  if (sequence.imu.empty() || later_s == 0) return;
  for (Frame& frame : sequence.frames) frame.time += from_s(later_s);
  sequence.warnings.push_back(
      fmt::format("pictures are put {:.3f} ms later, as the calibration says (timeshift_cam_imu)",
                  1e3 * later_s));
}

}  // namespace pirt
