// Observations One to Four, Tables III and IV, on the profile of a machine.
#include <fmt/core.h>

#include <algorithm>
#include <map>

#include "reports/document/figures.h"
#include "reports/paper/local_tables.h"
#include "reports/paper/scorecard.h"
#include "reports/profile/offloading.h"
#include "reports/profile/preference.h"
#include "reports/run/run_report.h"
#include "workloads/base/error.h"
#include "workloads/base/text/text.h"

namespace pirt {
namespace {

constexpr const char* kNoProfile = "no profile given";
constexpr const char* kConvolution = "convolution";

Claim decided(Claim claim, bool holds, const std::string& here, Origin from,
              const std::string& why = "") {
  return pirt::decided(std::move(claim), holds, here, to_string(from), why);
}

std::vector<std::string> units_of_role(const Evidence& evidence, Role role) {
  std::vector<std::string> found;
  for (const auto& unit : evidence.profile->units()) {
    if (real_role(evidence, unit) == role) found.push_back(unit);
  }
  return found;
}

/// Of Table III: "mGPU" is the mobile board's.
Role paper_role(const std::string& unit) {
  if (unit == "CPU") return Role::kCpu;
  if (unit == "DSP") return Role::kDsp;
  if (unit == "FPGA") return Role::kFpga;
  return Role::kGpu;
}

/// Joules that are a model say nothing that times do not.
bool energy_is_modelled(const Profile& profile) {
  return std::ranges::none_of(profile.energies, [](const EnergyRow& row) {
    return is_used(row) && row.energy_j && row.provenance.provenance < Provenance::kModelled;
  });
}

std::int64_t dropped_images(const RunRecord& run, const Mix& mix) {
  std::int64_t dropped = 0;
  for (std::size_t p = 0; p < mix.pipelines.size(); ++p) {
    if (mix.pipelines[p].has_image_input()) dropped += run.pipelines[p].dropped;
  }
  return dropped;
}

/// "Resource leak occurs when the input is ready but the execution is delayed": buffers are taken
/// away until images are dropped, and then images go first.
Claim observation_one(const Evidence& evidence) {
  Claim claim{.where = "Observation 1, Algorithm 4",
              .claim = "images that wait are discarded; giving them priority frees their buffers",
              .paper = "-"};
  if (evidence.mix == nullptr || evidence.platform == nullptr || evidence.profile == nullptr) {
    return not_testable(claim, kNoProfile);
  }
  const auto run = [&](const Mix& mix, const char* mode) {
    ScheduleOptions options;
    options.mode = mode;
    return run_virtual(*evidence.platform, evidence.profile, mix, options);
  };
  try {
    Mix mix = *evidence.mix;
    for (auto buffers = mix.image_buffers.value_or(8); buffers >= 1; buffers /= 2) {
      mix.image_buffers = buffers;
      const auto basic = run(mix, "throughput");
      const auto without = dropped_images(basic, mix);
      if (without == 0) continue;
      const auto with = dropped_images(run(mix, "advanced"), mix);
      return decided(
          claim, with < without,
          marked(fmt::format("{} dropped without, {} with", without, with), marks_of(basic).time),
          marks_of(basic).time,
          fmt::format("virtual time, mix {} with {} image buffers", mix.name, buffers));
    }
  } catch (const Error& error) {
    return not_testable(claim, error.what());
  }
  return not_testable(claim, "no image is dropped even with one buffer");
}

/// Without those that stand in for an accelerator.
Ranking among_real(const Evidence& evidence, Ranking ranking) {
  std::erase_if(ranking.units, [&](const RankedUnit& unit) {
    return !real_role(evidence, unit.unit).has_value();
  });
  return ranking;
}

Claim no_single_winner(const Evidence& evidence, const std::vector<Preference>& preferable) {
  Claim claim{.where = "Observation 2",
              .claim = "no single unit is the fastest for all vision workloads",
              .paper = "4 units win"};
  if (real_units(evidence).size() < 2) return not_testable(claim, kNoTwoRealUnits);
  std::map<std::string, int> wins;
  int ties = 0;
  Origin from = Provenance::kMeasured;
  for (const Preference& each : preferable) {
    const Ranking ranking = among_real(evidence, each.by_time);
    if (!each.paper_time || ranking.units.size() < 2) continue;
    const auto best = ranking.preferable();
    if (best.find(" = ") != std::string::npos) {
      ++ties;
      continue;
    }
    ++wins[best];
    from = weakest(from, ranking.units.front().provenance);
  }
  std::vector<std::string> parts;
  for (const auto& [unit, count] : wins) parts.push_back(fmt::format("{} {}", unit, count));
  parts.push_back(fmt::format("ties {}", ties));
  claim.here = join(parts, ", ");
  if (wins.size() < 2 && (ties > 0 || wins.empty())) {
    return not_testable(claim, "intervals overlap where another unit might win");
  }
  return decided(claim, wins.size() > 1, claim.here, from, "workloads won");
}

/// One cell of Table III.
Claim preferable_unit(const Evidence& evidence, const Preference& each, bool energy) {
  const std::string printed = energy ? *each.paper_energy : *each.paper_time;
  const Ranking& ranking = energy ? each.by_energy : each.by_time;
  Claim claim{.where = "Table III",
              .claim = fmt::format("{} prefers the {} by {}", each.workload, printed,
                                   energy ? "energy" : "time"),
              .paper = marked(printed, Provenance::kPublished)};
  claim.here = ranking.preferable();
  if (energy && energy_is_modelled(*evidence.profile)) {
    return not_testable(claim, kAssumedWatts);
  }
  const auto has = units_of_role(evidence, paper_role(printed));
  if (has.empty()) return not_testable(claim, "no real " + printed + " on this machine");
  const auto real = std::ranges::count_if(ranking.units, [&](const RankedUnit& unit) {
    return real_role(evidence, unit.unit).has_value();
  });
  if (real < 2) return not_testable(claim, "no second real unit with a valid figure");
  if (claim.here.find(" = ") != std::string::npos) {
    return not_testable(claim, "the intervals of the best overlap");
  }
  const auto role = real_role(evidence, claim.here);
  return decided(claim, role == paper_role(printed), claim.here, ranking.units.front().provenance);
}

Claim time_is_not_energy(const Evidence& evidence, const std::vector<Preference>& preferable) {
  Claim claim{.where = "Fig. 4",
              .claim = "the faster unit is not always the more energy-efficient one",
              .paper = "2 of 6 differ"};
  if (energy_is_modelled(*evidence.profile)) {
    return not_testable(claim, kAssumedWatts);
  }
  int differ = 0, all = 0;
  for (const Preference& each : preferable) {
    const Ranking by_time = among_real(evidence, each.by_time);
    const Ranking by_energy = among_real(evidence, each.by_energy);
    if (by_time.units.size() < 2 || by_energy.units.size() < 2) continue;
    ++all;
    differ += by_time.units.front().unit == by_energy.units.front().unit ? 0 : 1;
  }
  if (all == 0) return not_testable(claim, "no workload with both figures on two real units");
  return decided(claim, differ > 0, fmt::format("{} of {} differ", differ, all),
                 Provenance::kMeasured);
}

/// Fig. 5 and 6: one role ahead of another in every layer.
Claim layers(const Evidence& evidence, bool energy) {
  const Profile& profile = *evidence.profile;
  Claim claim{.where = energy ? "Fig. 6" : "Fig. 5",
              .claim = fmt::format("the GPU {} than the FPGA in every layer of AlexNet",
                                   energy ? "takes less energy" : "is faster"),
              .paper = "8 of 8"};
  const auto gpus = units_of_role(evidence, Role::kGpu);
  const auto fpgas = units_of_role(evidence, Role::kFpga);
  if (gpus.empty() || fpgas.empty()) return not_testable(claim, "needs a real GPU and an FPGA");
  int ahead = 0, all = 0;
  Origin from = Provenance::kMeasured;
  for (const auto& workload : profile.workloads()) {
    if (!workload.starts_with("conv") && !workload.starts_with("fc")) continue;
    if (workload == kConvolution) continue;
    const auto figure_of = [&](const std::string& unit) -> std::optional<double> {
      const auto* row = profile.find(workload, unit, Phase::kCall);
      const auto* joules = profile.find_energy(workload, unit);
      if (energy) return joules != nullptr && is_used(*joules) ? joules->energy_j : std::nullopt;
      if (row == nullptr || !is_used(*row) || !row->median) return std::nullopt;
      from = weakest(from, row->provenance);
      return to_ms(*row->median);
    };
    const auto gpu = figure_of(gpus.front()), fpga = figure_of(fpgas.front());
    if (!gpu || !fpga) continue;
    ++all;
    ahead += *gpu < *fpga ? 1 : 0;
  }
  if (all == 0) return not_testable(claim, "no layer has valid figures of both");
  return decided(claim, ahead == all, fmt::format("{} of {}", ahead, all), from);
}

/// Cold set-up as a part of the first call of the convolution, of units that are not the CPU.
Claim set_up_matters(const Evidence& evidence, const OffloadingCosts& costs) {
  Claim claim{.where = "Observation 3, Fig. 7",
              .claim = "set-up is a significant part of offloading a convolution",
              .paper = "-"};
  std::vector<std::string> parts;
  bool all = true;
  Origin from = Provenance::kMeasured;
  for (const auto& unit : evidence.profile->units()) {
    const auto* cost = costs.find(kConvolution, unit, State::kCold);
    const auto role = real_role(evidence, unit);
    if (cost == nullptr || !role || role == Role::kCpu) continue;
    const double share = to_ms(cost->set_up()) / std::max(to_ms(cost->calls().first), 1e-9);
    parts.push_back(fmt::format("{} {:.1f} %", unit, 100 * share));
    all = all && share >= 0.1;
    from = weakest(from, cost->provenance);
  }
  if (parts.empty()) {
    return not_testable(claim, "no real accelerator has a cold set-up and a call");
  }
  return decided(claim, all, join(parts, ", "), from, "of the first call, cold; significant: 10 %");
}

Claim set_up_decides(const Evidence& evidence, const OffloadingCosts& costs) {
  Claim claim{.where = "Observation 3, Fig. 7",
              .claim =
                  "with set-up counted, another unit is preferable for the convolution than by "
                  "its execution",
              .paper = "GPU, then DSP"};
  const OffloadingCost *by_execution = nullptr, *by_first_call = nullptr;
  int units = 0;
  for (const auto& unit : real_units(evidence)) {
    const auto* cost = costs.find(kConvolution, unit, State::kCold);
    if (cost == nullptr || !cost->execute) continue;
    ++units;
    if (by_execution == nullptr || *cost->execute < *by_execution->execute) by_execution = cost;
    if (by_first_call == nullptr || cost->calls().first < by_first_call->calls().first) {
      by_first_call = cost;
    }
  }
  if (units < 2) {
    return not_testable(claim, "needs two real units with a cold set-up and an execution");
  }
  return decided(claim, by_execution->unit != by_first_call->unit,
                 fmt::format("{}, then {}", by_execution->unit, by_first_call->unit),
                 weakest(by_execution->provenance, by_first_call->provenance), "cold");
}

Claim set_up_order(const Evidence& evidence, const OffloadingCosts& costs) {
  Claim claim{.where = "Observation 3, Fig. 7",
              .claim = "the GPU has the largest set-up, the DSP the smallest",
              .paper = "DSP < FPGA < GPU"};
  const auto gpus = units_of_role(evidence, Role::kGpu);
  const auto dsps = units_of_role(evidence, Role::kDsp);
  if (gpus.empty() || dsps.empty()) return not_testable(claim, "needs a real GPU and a DSP");
  const auto* gpu = costs.find(kConvolution, gpus.front(), State::kCold);
  const auto* dsp = costs.find(kConvolution, dsps.front(), State::kCold);
  if (gpu == nullptr || dsp == nullptr) {
    return not_testable(claim, "one of them has no valid cold set-up");
  }
  return decided(
      claim, dsp->set_up() < gpu->set_up(),
      fmt::format("DSP {}, GPU {}", duration_text(dsp->set_up()), duration_text(gpu->set_up())),
      weakest(gpu->provenance, dsp->provenance));
}

const Inference* inference_on(const std::vector<Inference>& all, const std::string& where) {
  const auto found = std::ranges::find(all, where, &Inference::where);
  return found == all.end() ? nullptr : &*found;
}

/// Table IV's GPU beside its CPU: energy, or time.
Claim local_inference(const Evidence& evidence, const std::vector<Inference>& all, bool energy) {
  Claim claim{.where = "Observation 4, Table IV",
              .claim = energy ? "the GPU infers with a sixth of the CPU's energy"
                              : "the GPU infers about 10 times faster than the CPU",
              .paper = energy ? "+6.1x less" : "+12x faster"};
  const auto cpus = units_of_role(evidence, Role::kCpu);
  const auto gpus = units_of_role(evidence, Role::kGpu);
  if (cpus.empty() || gpus.empty()) return not_testable(claim, "needs a CPU and a real GPU");
  if (energy && energy_is_modelled(*evidence.profile)) {
    return not_testable(claim, kAssumedWatts);
  }
  const auto* cpu = inference_on(all, cpus.front());
  const auto* gpu = inference_on(all, gpus.front());
  if (cpu == nullptr || gpu == nullptr) return not_testable(claim, "alexnet was not measured");
  const auto of = [&](const Inference& one) { return energy ? one.energy_j : one.low_s; };
  if (!of(*cpu) || !of(*gpu) || *of(*gpu) <= 0) return not_testable(claim, "no valid figure");
  const double ratio = *of(*cpu) / *of(*gpu);
  return decided(claim, ratio >= (energy ? 6 : 10) * 0.8, figure(ratio) + "x",
                 energy ? weakest(cpu->energy_provenance, gpu->energy_provenance)
                        : weakest(cpu->time_provenance, gpu->time_provenance),
                 "within a fifth, or better");
}

Claim cloud(const std::vector<Inference>& all, bool energy) {
  Claim claim{.where = "Observation 4, Table IV",
              .claim = energy ? "the cloud infers with less of the robot's energy than any unit"
                              : "the cloud is too slow, and too unsteady, for real time",
              .paper = energy ? "+0.010 J against +0.132" : "+2 to 5 s against +0.033"};
  std::optional<double> local;
  const Inference* away = nullptr;
  for (const Inference& each : all) {
    if (each.low_s != each.high_s) {
      away = &each;
    } else if (const auto value = energy ? each.energy_j : each.high_s) {
      local = std::min(local.value_or(*value), *value);
    }
  }
  if (away != nullptr && local) {
    claim.here = energy ? fmt::format("+{} J against {}", figure(away->energy_j), figure(*local))
                        : fmt::format("+{} to {} s against {}", figure(away->low_s),
                                      figure(away->high_s), figure(*local));
  }
  return not_testable(claim, "the cloud of this platform has the paper's own figures");
}

}  // namespace

std::vector<Claim> observation_claims(const Evidence& evidence) {
  std::vector<Claim> claims = {observation_one(evidence)};
  if (evidence.profile == nullptr) {
    for (const char* where : {"Observation 2, Table III, Fig. 3 to 6", "Observation 3, Fig. 7",
                              "Observation 4, Table IV"}) {
      claims.push_back(
          not_testable({.where = where, .claim = "what units do here", .paper = "-"}, kNoProfile));
    }
    return claims;
  }
  const auto preferable = preferences(*evidence.profile);
  claims.push_back(no_single_winner(evidence, preferable));
  for (const Preference& each : preferable) {
    if (each.paper_time) claims.push_back(preferable_unit(evidence, each, false));
    if (each.paper_energy) claims.push_back(preferable_unit(evidence, each, true));
  }
  claims.push_back(time_is_not_energy(evidence, preferable));
  claims.push_back(layers(evidence, false));
  claims.push_back(layers(evidence, true));
  const auto costs = offloading_costs(*evidence.profile);
  claims.push_back(set_up_matters(evidence, costs));
  claims.push_back(set_up_decides(evidence, costs));
  claims.push_back(set_up_order(evidence, costs));
  const auto alexnet = inferences(*evidence.profile, evidence.platform);
  for (const bool energy : {true, false}) {
    claims.push_back(local_inference(evidence, alexnet, energy));
    claims.push_back(cloud(alexnet, energy));
  }
  return claims;
}

}  // namespace pirt
