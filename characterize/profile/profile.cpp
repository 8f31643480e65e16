#include "characterize/profile/profile.h"

#include <algorithm>
#include <charconv>
#include <cmath>

namespace pirt {
namespace {

template <typename Row>
std::vector<std::string> first_appearances(const std::vector<Row>& rows, std::string Row::*member) {
  std::vector<std::string> names;
  for (const Row& row : rows) {
    if (std::ranges::find(names, row.*member) == names.end()) names.push_back(row.*member);
  }
  return names;
}

}  // namespace

bool PhaseRow::is_deterministic() const {
  return std::ranges::find(notes, kDeterministic) != notes.end();
}

std::string PhaseRow::unknown() const {
  const auto reason = std::ranges::find_if(
      reasons, [](const std::string& each) { return each.starts_with(kUnknownPhase); });
  return reason == reasons.end() ? "" : reason->substr(kUnknownPhase.size());
}

int PhaseRow::failed_processes() const {
  int count = 0;
  for (const std::string& note : notes) {
    if (!note.starts_with(kFailedProcesses)) continue;
    const auto number = std::string_view(note).substr(kFailedProcesses.size());
    std::from_chars(number.data(), number.data() + number.size(), count);
  }
  return count;
}

bool PhaseRow::is_wild() const {
  return is_doubted(*this) && ci_low && ci_high && to_s(*ci_high) > kWildSpan * to_s(*ci_low);
}

std::string PhaseRow::phase_name() const {
  std::string name(to_string(phase));
  if (state != State::kSteady) name += " " + std::string(to_string(state));
  return name;
}

std::optional<double> RunInfo::figure(const std::string& key) const {
  const auto fact = environment.find(key);
  if (fact == environment.end()) return std::nullopt;
  const std::string& text = fact->second;
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  const bool whole = error == std::errc() && end == text.data() + text.size();
  return whole && std::isfinite(value) ? std::optional(value) : std::nullopt;
}

std::optional<StandingPower> standing_power(const RunInfo& run, const std::string& unit) {
  const std::string meter = "meter." + unit;
  const auto rest_w = run.figure(meter + ".idle_w");
  if (!rest_w) return std::nullopt;
  const auto own = run.environment.find(meter);
  const auto shares = [&](const UnitRecord& other) {
    const auto fact = run.environment.find("meter." + other.unit);
    return own != run.environment.end() && fact != run.environment.end() &&
           fact->second == own->second;
  };
  const auto sharing = std::max<std::ptrdiff_t>(1, std::ranges::count_if(run.units, shares));
  const auto units = static_cast<double>(sharing);
  StandingPower power{.idle_w = *rest_w / units};
  const auto awake_w = run.figure(meter + ".awake_w");
  if (awake_w) power.held_w = std::max(0.0, *awake_w - *rest_w) / units;
  return power;
}

const PhaseRow* Profile::find(std::string_view workload, std::string_view unit, Phase phase,
                              State state) const {
  const auto it = std::ranges::find_if(phases, [&](const PhaseRow& row) {
    return row.workload == workload && row.unit == unit && row.phase == phase && row.state == state;
  });
  return it == phases.end() ? nullptr : &*it;
}

const PhaseRow* Profile::find_condition(std::string_view workload, std::string_view unit,
                                        Condition condition) const {
  const auto it = std::ranges::find_if(conditions, [&](const PhaseRow& row) {
    return row.workload == workload && row.unit == unit && row.phase == Phase::kExecute &&
           row.condition == condition;
  });
  return it == conditions.end() ? nullptr : &*it;
}

const EnergyRow* Profile::find_energy(std::string_view workload, std::string_view unit) const {
  const auto it = std::ranges::find_if(
      energies, [&](const EnergyRow& row) { return row.workload == workload && row.unit == unit; });
  return it == energies.end() ? nullptr : &*it;
}

const PeakRow* Profile::find_peak(std::string_view unit, PeakKind kind) const {
  const auto it = std::ranges::find_if(
      peaks, [&](const PeakRow& row) { return row.unit == unit && row.kind == kind; });
  return it == peaks.end() ? nullptr : &*it;
}

const UnitRecord* Profile::find_unit(std::string_view unit) const {
  for (const RunInfo& run : runs) {
    const auto it = std::ranges::find(run.units, unit, &UnitRecord::unit);
    if (it != run.units.end()) return &*it;
  }
  return nullptr;
}

const RunInfo* Profile::find_run(std::int64_t run_id) const {
  const auto it = std::ranges::find(runs, run_id, &RunInfo::run_id);
  return it == runs.end() ? nullptr : &*it;
}

std::vector<std::string> Profile::workloads() const {
  return first_appearances(phases, &PhaseRow::workload);
}

std::vector<std::string> Profile::units() const {
  return first_appearances(phases, &PhaseRow::unit);
}

const std::string& Profile::platform() const { return runs.front().platform; }

}  // namespace pirt
