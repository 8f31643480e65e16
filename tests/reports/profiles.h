// A small profile for the tests of what shows or compares profiles.
#pragma once

#include <string>

#include "characterize/profile/profile.h"

namespace pirt::test {

inline PhaseRow small_row(const std::string& workload, Phase phase, State state, double ms) {
  PhaseRow row;
  row.run_id = 1;
  row.platform = "board";
  row.workload = workload;
  row.unit = "cpu";
  row.backend = "fake";
  row.phase = phase;
  row.state = state;
  row.samples = 20;
  row.processes = 1;
  row.median = row.mad = row.p95 = row.p99 = from_ms(ms);
  if (state == State::kSteady) {
    row.ci_low = from_ms(ms * 0.98);
    row.ci_high = from_ms(ms * 1.02);
  }
  return row;
}

/// sobel (prepare cold, call) and fc8 (call) on unit cpu, each @p ms, with intervals of 2 %; energy
/// of sobel.
inline Profile small_profile(double ms) {
  Profile profile;
  profile.path = "small.db";
  profile.runs = {{.run_id = 1,
                   .started = "2026-01-01T00:00:00Z",
                   .finished = "2026-01-01T00:01:00Z",
                   .platform = "board",
                   .seed = 1,
                   .environment = {{"cpu_model", "Some CPU"}, {"load_1m", "0.5"}},
                   .identity = {"cpu_model"},
                   .units = {{"cpu", "fake", "Some device", true, {0}}}}};
  profile.phases = {small_row("sobel", Phase::kPrepare, State::kCold, ms),
                    small_row("sobel", Phase::kCall, State::kSteady, ms),
                    small_row("fc8", Phase::kCall, State::kSteady, ms)};
  EnergyRow energy;
  energy.run_id = 1;
  energy.workload = "sobel";
  energy.unit = "cpu";
  energy.energy_j = ms / 1000;
  energy.source = "model: active_w 1 W x call, guessed";
  energy.domain = "unit";
  profile.energies = {energy};
  return profile;
}

}  // namespace pirt::test
