// The phases that offloading a workload goes through, and where a figure comes from.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <optional>
#include <string_view>

namespace pirt {

enum class Phase : std::uint8_t {
  kDeviceInit,  ///< Once a process: platform, context, queues, worker pools.
  kPrepare,     ///< Once a workload on a unit: build, buffers, weights, one completed run.
  kUpload,      ///< Each call: host to device.
  kLaunch,      ///< Each call: submit to start.
  kExecute,     ///< Each call: the computation.
  kDownload,    ///< Each call: device to host.
  kCall,        ///< upload + launch + execute + download as one call took it.
};
inline constexpr std::array kAllPhases = {Phase::kDeviceInit, Phase::kPrepare, Phase::kUpload,
                                          Phase::kLaunch,     Phase::kExecute, Phase::kDownload,
                                          Phase::kCall};

/// Of the phases that a process goes through once; the others belong to each call.
[[nodiscard]] constexpr bool is_setup(Phase phase) {
  return phase == Phase::kDeviceInit || phase == Phase::kPrepare;
}

/// "device_init", "prepare", ... as in the profile database.
[[nodiscard]] std::string_view to_string(Phase phase);
[[nodiscard]] std::optional<Phase> phase_from_string(std::string_view text);

/// Whether a set-up phase met an empty kernel cache (cold) or a filled one (warm); per-call phases
/// are steady.
enum class State : std::uint8_t { kCold, kWarm, kSteady };
[[nodiscard]] std::string_view to_string(State state);
[[nodiscard]] std::optional<State> state_from_string(std::string_view text);

/// The strongest first: see weakest().
enum class Provenance : std::uint8_t {
  kMeasured,   ///< A clock on this machine.
  kCounted,    ///< Cycles of a simulator times a stated clock.
  kModelled,   ///< A formula with stated inputs.
  kFitted,     ///< Inputs chosen to match published figures.
  kPublished,  ///< Quoted, with source.
};
inline constexpr std::array kAllProvenances = {Provenance::kMeasured, Provenance::kCounted,
                                               Provenance::kModelled, Provenance::kFitted,
                                               Provenance::kPublished};
[[nodiscard]] std::string_view to_string(Provenance provenance);
[[nodiscard]] std::optional<Provenance> provenance_from_string(std::string_view text);

/// Where a figure comes from, sums included: those of several provenances have the weakest of them
/// and are mixtures.
struct Origin {
  Provenance provenance = Provenance::kMeasured;
  bool mixture = false;

  constexpr Origin() = default;
  /// Of a figure that is no sum.
  constexpr Origin(Provenance of) : provenance(of) {}  // NOLINT: a provenance is an origin
  constexpr Origin(Provenance weakest_of, bool is_mixture)
      : provenance(weakest_of), mixture(is_mixture) {}
  friend constexpr bool operator==(const Origin&, const Origin&) = default;
};
/// Of what follows from both (a product, a judgement): the one that is farther from a measurement.
[[nodiscard]] constexpr Origin weakest(Origin a, Origin b) {
  return {std::max(a.provenance, b.provenance), a.mixture || b.mixture};
}
/// Of the sum of both.
[[nodiscard]] constexpr Origin sum_of(Origin a, Origin b) {
  return {std::max(a.provenance, b.provenance),
          a.mixture || b.mixture || a.provenance != b.provenance};
}
/// The provenance's word; whether it is a mixture stands beside it.
[[nodiscard]] inline std::string_view to_string(Origin origin) {
  return to_string(origin.provenance);
}

}  // namespace pirt
