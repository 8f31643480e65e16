// Simulated runs for the tests of the gate of stored profiles.
#pragma once

#include <cmath>
#include <numbers>
#include <string>
#include <vector>

#include "characterize/statistics/statistics.h"
#include "reports/gate/table_gate.h"
#include "workloads/base/math/random.h"

namespace pirt::test {

/// Median and interval as a database has them.
inline void summarize_row(PhaseRow& row) {
  const auto summary = summarize(row.values, row.value_processes);
  row.median = summary.median;
  row.processes = summary.processes;
  row.ci_low = row.ci_high = std::nullopt;
  if (!summary.interval) return;
  row.ci_low = summary.interval->low;
  row.ci_high = summary.interval->high;
}

/// Samples of several processes, each a little apart from the others, as machines have them.
class Machine {
 public:
  Machine(double between, double within, std::uint64_t seed)
      : between_(between), within_(within), random_(seed) {}

  PhaseRow row(const std::string& workload, double ms, int processes = 6, int samples = 20,
               Phase phase = Phase::kExecute, State state = State::kSteady) {
    PhaseRow row;
    row.platform = "board";
    row.workload = workload;
    row.unit = "cpu";
    row.backend = "fake";
    row.phase = phase;
    row.state = state;
    row.ops = 100;
    row.bytes = 10;
    for (int p = 0; p < processes; ++p) {
      const double process_ms = ms * (1 + between_ * normal());
      for (int i = 0; i < samples; ++i) {
        row.values.push_back(from_ms(process_ms * (1 + within_ * std::abs(normal()))));
        row.value_processes.push_back(p);
      }
    }
    row.samples = std::ssize(row.values);
    summarize_row(row);
    return row;
  }

 private:
  double uniform() { return (static_cast<double>(random_.next() >> 11) + 0.5) * 0x1p-53; }
  double normal() {
    return std::sqrt(-2 * std::log(uniform())) * std::cos(2 * std::numbers::pi * uniform());
  }
  double between_, within_;
  Random random_;
};

inline Profile profile_of(std::vector<PhaseRow> rows) {
  Profile profile;
  profile.path = "p.db";
  RunInfo run;
  run.platform = "board";
  run.environment = {{"cpu_model", "one"}};
  run.identity = {"cpu_model"};
  run.units = {{"cpu", "fake", "simulated", true, {}}};
  profile.runs = {run};
  profile.phases = std::move(rows);
  return profile;
}

inline EnergyRow metered(double joules, double width) {
  EnergyRow energy;
  energy.workload = "sobel";
  energy.unit = "cpu";
  energy.energy_j = joules;
  energy.provenance = Provenance::kMeasured;
  energy.ci_low_j = joules * (1 - width);
  energy.ci_high_j = joules * (1 + width);
  return energy;
}

inline GateResult judge_both(const Profile& base, const Profile& candidate) {
  return judge(diff_profiles(base, candidate));
}

inline PeakRow peak(PeakKind kind, double per_second, std::int64_t run_id = 0) {
  PeakRow row;
  row.run_id = run_id;
  row.unit = "cpu";
  row.kind = kind;
  row.per_second = per_second;
  return row;
}

/// A row whose interval ends @p width on either side of @p ms.
inline PhaseRow with_interval(double ms, double width) {
  Machine exact(0, 0, 1);
  PhaseRow row = exact.row("sobel", ms);
  row.ci_low = from_ms(ms * (1 - width));
  row.ci_high = from_ms(ms * (1 + width));
  return row;
}

}  // namespace pirt::test
