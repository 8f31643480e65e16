// Time, judged once for all layouts: its unit, its order, and which pictures of two cameras are of
// one moment. Nothing is matched by its position.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "workloads/base/error.h"
#include "workloads/inputs/sequence/sequence.h"

namespace pirt {

/// For so long a robot is predicted that nothing is known of; after a longer gap where it is is a
/// guess.
inline constexpr Nanos kLongestPrediction = std::chrono::seconds(30);

/// The median, over several steps at once, since messages may be stamped when they arrive, in
/// bursts; zero for less than two.
[[nodiscard]] Nanos usual_step(const std::vector<Nanos>& stamps);
/// That of the usual step, which a pause does not change. @param otherwise  For less than two.
[[nodiscard]] double usual_rate_hz(const std::vector<Nanos>& stamps, double otherwise);
/// Where samples of a burst have one stamp, each is put 1 ns after the one before it, so that it is
/// a burst as others are. What was recorded twice has the same figures, and stays as it is.
void part_equal_stamps(std::vector<ImuSample>& imu);
/// Where samples were stamped when they arrived, several at once: the last of each burst was new
/// then, and those before it are a usual step apart. Others stay as they are.
/// @param imu  Stamps rise.
void spread_bursts(std::vector<ImuSample>& imu, const std::string& what,
                   std::vector<std::string>& warnings);
/// When each comes after the first, where they are played at their own rate. A step that is longer
/// than kLongestPrediction, a pause or a clock that was set, takes as long as the usual one.
/// @param stamps  Rise.
[[nodiscard]] std::vector<Nanos> playing_times(const std::vector<Nanos>& stamps);

/// No sensor of a robot has 100 kHz, and no camera 1 kHz.
inline constexpr double kFinest_s = 1e-5, kFinestPicture_s = 1e-3;

/// @param what     For the message: the file, the topic.
/// @param rate_hz  What its calibration says, if that does.
/// @throws Error{kBadInput} if the usual step between stamps cannot be: they are of another unit.
void check_step(const std::string& what, std::vector<Nanos> stamps,
                std::optional<double> rate_hz = {}, double finest_s = kFinest_s);

/// Positions of the most stamps that rise strictly: one that is far ahead goes, not all after it.
/// @param after  None up to this one: of messages 0, which is no stamp.
[[nodiscard]] std::vector<std::size_t> rising(const std::vector<Nanos>& stamps,
                                              Nanos after = Nanos::min());
/// Says how many of a topic's, or a file's, are left out. @throws Error{kBadInput} for more than
/// half.
void tell_of_rising(const std::string& what, std::size_t kept, std::size_t all,
                    std::vector<std::string>& warnings);

/// Rows with a `time`.
template <typename Row>
[[nodiscard]] std::vector<Nanos> stamps_of(const std::vector<Row>& rows) {
  std::vector<Nanos> stamps;
  for (const Row& row : rows) stamps.push_back(row.time);
  return stamps;
}
/// The longest run of a clock that begins anew (restarts.h), which is said: its first position, and
/// that behind its last.
[[nodiscard]] std::pair<std::size_t, std::size_t> one_run(const std::string& what,
                                                          const std::vector<Nanos>& stamps,
                                                          std::vector<std::string>& warnings);
/// What comes twice or late was recorded so: it is left out, and said; so is what is of another
/// run.
/// @return  Which run is kept, as one_run.
template <typename Row>
std::pair<std::size_t, std::size_t> keep_rising(std::vector<Row>& rows, const std::string& what,
                                                std::vector<std::string>& warnings,
                                                Nanos after = Nanos::min()) {
  const auto run = one_run(what, stamps_of(rows), warnings);
  rows.erase(rows.begin() + static_cast<std::ptrdiff_t>(run.second), rows.end());
  rows.erase(rows.begin(), rows.begin() + static_cast<std::ptrdiff_t>(run.first));
  std::vector<Row> kept;
  for (const std::size_t i : rising(stamps_of(rows), after)) kept.push_back(std::move(rows[i]));
  tell_of_rising(what, kept.size(), rows.size(), warnings);
  rows = std::move(kept);
  return run;
}

/// Of each left picture the position of the right one.
using Partners = std::vector<std::optional<std::size_t>>;
/// The nearest within @p tolerance, and a third of the usual step; warns if some are apart.
[[nodiscard]] Partners pair_stamps(const std::vector<Nanos>& left, const std::vector<Nanos>& right,
                                   Nanos tolerance, std::vector<std::string>& warnings);
/// Makes the frames of the left camera's stamps. A second camera none of whose pictures has a
/// partner is taken away: it would tell no scale.
/// @param partners  Empty = there is one camera.
/// @param names     Of the cameras, for warnings.
void make_frames(Sequence& sequence, const std::vector<Nanos>& left, const Partners& partners,
                 const std::pair<std::string, std::string>& names);
/// Where a calibration knows how much later the IMU's stamps are (Kalibr's timeshift_cam_imu),
/// frames get its time. Nothing is done without an IMU.
void frames_by_imu(Sequence& sequence, double later_s);

}  // namespace pirt
