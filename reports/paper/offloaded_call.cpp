#include "reports/paper/offloaded_call.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>

#include "reports/document/figures.h"
#include "reports/paper/paper_figures.h"
#include "reports/profile/offloading.h"

namespace pirt {
namespace {

void add(std::optional<TimeFigure>& sum, TimeFigure part) {
  if (sum) part = {sum->time + part.time, sum_of(sum->from, part.from)};
  sum = part;
}

std::optional<TimeFigure> figure_of(const PhaseRow* row) {
  if (row == nullptr || !is_used(*row) || !row->median) return std::nullopt;
  return TimeFigure{*row->median, row->provenance};
}

std::optional<OffloadedCall> measured_call(const Profile& profile, const OffloadingCosts& costs,
                                           std::string_view workload, std::string_view unit) {
  const auto of = [&](Phase phase) { return figure_of(profile.find(workload, unit, phase)); };
  const auto call = of(Phase::kCall);
  if (!call) return std::nullopt;
  OffloadedCall result;
  if (const auto* cost = costs.find(workload, unit, State::kWarm)) {
    result.once = TimeFigure{cost->set_up(), cost->provenance};
  }
  result.launch = of(Phase::kLaunch);
  for (const Phase phase : {Phase::kUpload, Phase::kDownload}) {
    if (const auto copy = of(phase)) add(result.copies, *copy);
  }
  result.execute = of(Phase::kExecute);
  const PhaseRow* const execute = profile.find(workload, unit, Phase::kExecute);
  if (result.execute) result.bound = execute->bound;
  result.call = *call;
  return result;
}

std::optional<OffloadedCall> modelled_call(const Platform& platform, const std::string& workload,
                                           const std::string& unit) {
  const auto model = platform.workloads.find(workload);
  if (model == platform.workloads.end()) return std::nullopt;
  const auto stages = model->second.stages.find(unit);
  if (stages == model->second.stages.end()) return std::nullopt;
  OffloadedCall result;
  std::optional<TimeFigure> call;
  for (const Stage& stage : stages->second) {
    const TimeFigure part{stage.time.mean(), model->second.provenance};
    add(stage.on == unit ? result.execute : stage.on.empty() ? result.copies : result.set_up, part);
    add(call, part);
  }
  if (!call) return std::nullopt;
  result.call = *call;
  return result;
}

std::string shown(const std::optional<TimeFigure>& figure) {
  return figure ? marked(figure_ms(figure->time), figure->from) : "-";
}

std::string words_of_the_paper(Role role) {
  if (role == Role::kGpu) return "fastest execution, largest set-up";
  if (role == Role::kDsp) return "smallest set-up, preferable in all";
  return "-";
}

/// The unit with the least of @p part; null if none has it.
template <typename Part>
const OffloadedCall* least(const std::vector<OffloadedCall>& calls, const Part& part) {
  const OffloadedCall* best = nullptr;
  for (const auto& call : calls) {
    if (part(call) && (best == nullptr || *part(call) < *part(*best))) best = &call;
  }
  return best;
}

std::optional<Nanos> execution_of(const OffloadedCall& call) {
  if (!call.execute) return std::nullopt;
  return call.execute->time;
}

Json json_of(const TimeFigure& figure) {
  return {{"ms", to_ms(figure.time)},
          {"provenance", to_string(figure.from)},
          {"mixture", figure.from.mixture}};
}

struct NamedFigure {
  const char* key;
  const char* text;
  const TimeFigure* figure;
};

std::array<NamedFigure, 5> parts_of(const PaperDsp& dsp) {
  return {
      {{"hvx_no_stalls", "HVX, no stalls", &dsp.vectors_without_stalls},
       {"hvx", "HVX, with the memory model", &dsp.vectors},
       {"table2_peak", "Table I's operations at Table II's peak", &dsp.peak},
       {"table5_fit", "Table V, as it was fitted", &dsp.fitted},
       {"scalar_no_stalls", "scalar code on one thread, no stalls", &dsp.scalar_without_stalls}}};
}

Json json_of(const OffloadedCall& call) {
  Json json = {{"unit", call.unit}, {"role", to_string(call.role)}, {"call", json_of(call.call)}};
  const auto put = [&json](const char* key, const std::optional<TimeFigure>& figure) {
    if (figure) json[key] = json_of(*figure);
  };
  put("set_up_once", call.once);
  put("set_up_each_call", call.set_up);
  put("launch", call.launch);
  put("copies", call.copies);
  put("execute", call.execute);
  if (call.bound) json["execute_at_least_ms"] = to_ms(*call.bound);
  return json;
}

Json json_of(const PaperDsp& dsp) {
  Json json = {{"conclusion", dsp.conclusion()}};
  for (const auto& [key, text, figure] : parts_of(dsp)) json[key] = json_of(*figure);
  return json;
}

}  // namespace

double OffloadedCall::overhead() const {
  if (!execute || call.time.count() == 0) return 0;
  return 1 - to_ms(execute->time) / to_ms(call.time);
}

std::vector<OffloadedCall> offloaded_calls(const Profile& profile, const Platform& platform,
                                           std::string_view workload) {
  const auto costs = offloading_costs(profile);
  std::vector<OffloadedCall> calls;
  for (const auto& unit : platform.units) {
    auto call = unit.measured() ? measured_call(profile, costs, workload, unit.name)
                                : modelled_call(platform, std::string(workload), unit.name);
    if (!call) continue;
    call->unit = unit.name;
    call->backend = unit.backend;
    call->role = unit.role;
    calls.push_back(std::move(*call));
  }
  return calls;
}

Table offloaded_convolution_table(const std::vector<OffloadedCall>& calls) {
  Table table{.title = "One convolution, part by part, ms, beside what the paper's Fig. 7 says",
              .columns = {{"unit", Align::kLeft},
                          {"set-up, once"},
                          {"set-up, each call"},
                          {"launch"},
                          {"copies"},
                          {"execute"},
                          {"call"},
                          {"not execution"},
                          {"the paper", Align::kLeft}}};
  for (const auto& call : calls) {
    table.rows.push_back({call.unit, shown(call.once), shown(call.set_up), shown(call.launch),
                          shown(call.copies), shown(call.execute), shown(call.call),
                          fmt::format("{:.0f}%", 100 * call.overhead()),
                          words_of_the_paper(call.role)});
  }
  const auto* const executes = least(calls, execution_of);
  const auto* const serves = least(calls, [](const auto& c) { return std::optional(c.call.time); });
  if (executes != nullptr) {
    const bool as_printed = executes->role == Role::kGpu && serves->role == Role::kDsp;
    table.footnotes.push_back(fmt::format(
        "Here {} executes fastest and {} is preferable in all; in the paper the GPU and the DSP: "
        "{}.",
        executes->unit, serves->unit, as_printed ? "the same" : "not the same"));
  }
  table.footnotes.emplace_back(
      "set-up, once: device and kernel, warm, before the first call; the runtime does it at its "
      "start. set-up, each call: what another unit does for it. Units without rows in the profile "
      "have the platform file's stages.");
  table.footnotes.emplace_back(provenance_legend());
  return table;
}

std::optional<PaperDsp> paper_dsp(const std::vector<OffloadedCall>& calls) {
  const auto dsp = std::ranges::find_if(calls, [](const OffloadedCall& call) {
    return call.backend == "dsp" && call.execute && call.bound;
  });
  if (dsp == calls.end()) return std::nullopt;
  const auto& energy_mode = *std::ranges::find(paper::kTable5, "energy", &paper::Scheduling::mode);
  const auto& ops = *std::ranges::find(paper::kTable1, "convolution", &paper::Ops::workload);
  return PaperDsp{
      .vectors = *dsp->execute,
      .vectors_without_stalls = {*dsp->bound, Provenance::kCounted},
      .scalar_without_stalls = {from_s(static_cast<double>(kScalarConvolutionPackets) /
                                       paper::kDspThreadHz),
                                Provenance::kCounted},
      .fitted = {from_ms(*energy_mode.dsp_ms), Provenance::kFitted},
      .peak = {from_s(ops.millions * 1e6 / paper::kDspOpsPerSecond), Provenance::kPublished}};
}

std::string PaperDsp::conclusion() const {
  const double of_scalar = to_ms(fitted.time) / to_ms(scalar_without_stalls.time);
  const double of_vectors = to_ms(fitted.time) / to_ms(vectors.time);
  const std::string ratios = fmt::format(
      "Table V's figure is {:.2f} of what scalar code takes and "
      "{} times what vector code takes: ",
      of_scalar, figure(of_vectors));
  if (of_vectors >= 4 && of_scalar > 0.5 && of_scalar < 2) {
    return ratios +
           "that of a DSP whose vectors were not used, or whose calls waited for "
           "something else.";
  }
  if (of_vectors < 2) return ratios + "that of vector code.";
  return ratios + "neither's.";
}

Table paper_dsp_table(const PaperDsp& dsp) {
  Table table{.title = "A convolution on the paper's DSP",
              .columns = {{"what", Align::kLeft}, {"ms"}, {"of HVX"}}};
  for (const auto& [key, text, figure] : parts_of(dsp)) {
    table.rows.push_back({text, shown(*figure),
                          fmt::format("{:.3g}x", to_ms(figure->time) / to_ms(dsp.vectors.time))});
  }
  table.footnotes = {dsp.conclusion(),
                     "scalar code: the kernel's twin in workloads/dsp/program/scalar, counted by "
                     "tests/bench/dsp at the catalog's size.",
                     std::string(provenance_legend())};
  return table;
}

std::vector<Table> offloaded_convolution_tables(const std::vector<OffloadedCall>& calls) {
  std::vector<Table> tables;
  if (!calls.empty()) tables.push_back(offloaded_convolution_table(calls));
  if (const auto dsp = paper_dsp(calls)) tables.push_back(paper_dsp_table(*dsp));
  return tables;
}

Json offloaded_convolution_json(const std::vector<OffloadedCall>& calls) {
  Json json = {{"convolution", Json::array()}};
  for (const auto& call : calls) json["convolution"].push_back(json_of(call));
  if (const auto dsp = paper_dsp(calls)) json["paper_dsp"] = json_of(*dsp);
  return json;
}

}  // namespace pirt
