#include "reports/profile/preference.h"

#include <algorithm>
#include <array>

#include "reports/profile/shown_row.h"

namespace pirt {
namespace {

constexpr std::array<PaperPreference, 6> kTable3 = {{{"gaussian_blur", "CPU", "mGPU"},
                                                     {"convolution", "GPU", "GPU"},
                                                     {"sobel", "GPU", "DSP"},
                                                     {"undistort", "GPU", "GPU"},
                                                     {"feature_detect", "DSP", "DSP"},
                                                     {"optical_flow", "FPGA", "FPGA"}}};

void sort_best_first(Ranking& ranking) {
  std::ranges::stable_sort(ranking.units, {}, &RankedUnit::value);
}

Ranking rank_time(const Profile& profile, const std::string& workload) {
  Ranking ranking;
  for (const auto& unit : profile.units()) {
    const auto* row = profile.find(workload, unit, Phase::kCall);
    if (row == nullptr || !is_used(*row) || !row->median) continue;
    ranking.units.push_back({.unit = unit,
                             .value = to_ms(*row->median),
                             .low = to_ms(row->ci_low.value_or(*row->median)),
                             .high = to_ms(row->ci_high.value_or(*row->median)),
                             .provenance = row->provenance,
                             .doubt = doubt_mark(*row)});
  }
  sort_best_first(ranking);
  return ranking;
}

Ranking rank_energy(const Profile& profile, const std::string& workload) {
  Ranking ranking;
  for (const auto& unit : profile.units()) {
    const auto* row = profile.find_energy(workload, unit);
    if (row == nullptr || !is_used(*row) || !row->energy_j) continue;
    const double value = *row->energy_j;
    ranking.units.push_back({unit, value, row->ci_low_j.value_or(value),
                             row->ci_high_j.value_or(value), row->provenance, doubt_mark(*row)});
  }
  sort_best_first(ranking);
  return ranking;
}

}  // namespace

std::span<const PaperPreference> paper_preferences() { return kTable3; }

std::string Ranking::preferable() const {
  if (units.empty()) return "-";
  std::string text = units[0].unit;
  for (std::size_t i = 1; i < units.size(); ++i) {
    if (units[i].low <= units[0].high) text += " = " + units[i].unit;
  }
  return text;
}

std::optional<double> Ranking::advantage() const {
  if (units.size() < 2 || units[0].value <= 0) return std::nullopt;
  return units[1].value / units[0].value;
}

std::vector<Preference> preferences(const Profile& profile) {
  std::vector<Preference> result;
  for (const auto& workload : profile.workloads()) {
    Preference preference{.workload = workload,
                          .by_time = rank_time(profile, workload),
                          .by_energy = rank_energy(profile, workload),
                          .paper_time = std::nullopt,
                          .paper_energy = std::nullopt};
    const auto paper = std::ranges::find(kTable3, workload, &PaperPreference::workload);
    if (paper != kTable3.end()) {
      preference.paper_time = paper->time;
      preference.paper_energy = paper->energy;
    }
    result.push_back(std::move(preference));
  }
  return result;
}

}  // namespace pirt
