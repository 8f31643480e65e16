// A recorded sequence localized live: the steps of slam/steps.h, each a task of the runtime, which
// decides where it runs.
//
//   IMU ─────────────────────────► imu_propagate ─┐ points, guesses, depths
//   left ──┬► pyramid ──────────────► track ◄─────┤
//          └► extract_features ─┐        └► track_right ◄─ pyramid_right ◄─ right
//                               └────► update_pose ◄┘──► extend_map ──► pose, map
//
// What a picture alone decides (pyramids, features) starts when it arrives, beside the frames
// before it; what the state decides follows frame by frame. A frame that finds too many in flight
// is dropped. Without drops and failures the result is, bit by bit, that of slam::run_serially,
// wherever features are computed by a kernel that gives the bits of slam::extract_features (the
// cpu's does).
//
// Truth is not read here.
#pragma once

#include <cstddef>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "scheduler/robot/companion.h"
#include "scheduler/runtime/runtime.h"
#include "workloads/slam/run/pipeline.h"
#include "workloads/slam/run/plot.h"

namespace pirt {

struct LocalizationOptions {
  slam::Setup setup;
  RuntimeOptions runtime;  ///< Platform, profile, mode, trace; its workloads are given here.
  /// Frames come by their stamps (playing_times); otherwise each as soon as there is room for it.
  bool own_rate = true;
  std::size_t most_in_flight = 2;  ///< Frames that have arrived and are not localized.
  /// A frame to show, or the first after it that was localized.
  std::optional<std::size_t> show = {};
  Companion* companion = nullptr;  ///< Null = it localizes and does nothing else.
  /// How often somebody wanted the run to stop: once, no frame comes any more and those in flight
  /// are finished; twice, nothing is waited for but the calls that run. Empty = never.
  std::function<int()> stops = {};
  /// Pictures may be replaced before they are used (tests of bad frames).
  std::function<void(std::size_t frame, std::size_t camera, GreyImage&)> spoil = {};
};

struct LocalizationResult {
  slam::RunResult run;           ///< Of the frames that were localized, in their order.
  std::vector<Nanos> latencies;  ///< Of the same: from the frame's arrival to its pose.
  std::size_t arrived = 0;       ///< = localized + dropped + failed
  std::size_t dropped = 0;       ///< Found too many in flight.
  std::size_t failed = 0;        ///< Lost a task on the way; the runtime's problems say why.
  Nanos duration{0};             ///< From the first arrival to the last pose.
  slam::ShownFrame shown;        ///< Of the frame to show; empty if there was none.
  /// How many calls of each workload each unit served: [workload][unit].
  std::map<std::string, std::map<std::string, std::int64_t>> served;
  RuntimeStatistics statistics;
  Nanos busy{0};                      ///< Of the calling thread, without the runtime.
  std::vector<std::string> problems;  ///< The first few, of calls that failed.
  bool stopped = false;               ///< Before its time, by LocalizationOptions::stops.
  std::string trace_problem;  ///< Why it is not complete; empty if it is, or none was wanted.

  [[nodiscard]] double rate_hz() const;  ///< Localized frames over the duration.
};

/// Returns when the sequence is over.
/// @throws Error as Runtime's constructor, and for pictures that cannot be read.
[[nodiscard]] LocalizationResult localize_live(const Sequence& sequence,
                                               LocalizationOptions options);

/// The same without the runtime, in the calling thread and on backend cpu alone: slam::run_serially
/// by the clock, and each task of the companion when it asks for it. A frame that finds the one
/// after it due is dropped. Not at the sequence's own rate, the duration is that
/// of the steps alone: pictures are read apart.
[[nodiscard]] LocalizationResult localize_serially(const Sequence& sequence,
                                                   LocalizationOptions options);

}  // namespace pirt
