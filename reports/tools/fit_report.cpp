#include "reports/tools/fit_report.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>

#include "reports/document/figures.h"
#include "workloads/base/text/json.h"
#include "workloads/base/text/text.h"

namespace pirt {
namespace {

/// A parameter whose standard error is as large as itself may as well be 0.
bool is_told_from_zero(const FittedParameter& parameter) {
  return parameter.standard_error && *parameter.standard_error < parameter.value;
}

std::string verdict(const FittedParameter& parameter) {
  if (!parameter.standard_error) return "ended at its bound";
  return is_told_from_zero(parameter) ? "" : "not told from 0";
}

Table parameter_table(const UnitFit& each) {
  const EnergyFit& fit = each.fit;
  Table table{.title = fmt::format("Energy model of unit {}, fitted to {} cells of {}", each.unit,
                                   fit.residuals.size(), each.meter),
              .columns = {{"parameter", Align::kLeft},
                          {"value"},
                          {"+/-"},
                          {"unit", Align::kLeft},
                          {"remarks", Align::kLeft}}};
  for (const FittedParameter& parameter : fit.parameters) {
    table.rows.push_back({std::string(to_string(parameter.parameter)),
                          marked(figure(parameter.value), Provenance::kFitted),
                          figure(parameter.standard_error),
                          std::string(unit_of(parameter.parameter)), verdict(parameter)});
  }
  if (each.idle_w) table.rows.push_back({"idle_w", figure(*each.idle_w), "-", "W", "read"});
  if (each.held_w) table.rows.push_back({"held_w", figure(*each.held_w), "-", "W", "read"});
  if (!fit.refusal.empty()) table.footnotes.push_back("Not fitted: " + fit.refusal);
  for (const auto& line : each.dropped) table.footnotes.push_back(line);
  if (!fit.left_out.empty()) {
    table.footnotes.push_back("Left out, since their operations depend on the data: " +
                              join(fit.left_out, ", "));
  }
  if (fit.refusal.empty()) {
    table.footnotes.emplace_back("+/-: standard error, from the residuals below");
  }
  return table;
}

Table residual_table(const UnitFit& each) {
  Table table{
      .title = fmt::format("Energy of unit {}: measured and fitted", each.unit),
      .columns = {
          {"workload", Align::kLeft}, {"measured mJ"}, {"fitted mJ"}, {"residual mJ"}, {"error"}}};
  double squares = 0;
  double worst = 0;
  for (const FitResidual& residual : each.fit.residuals) {
    const double error = residual.relative_error();
    squares += error * error;
    worst = std::max(worst, std::abs(error));
    table.rows.push_back({residual.workload, figure(residual.measured_j * 1e3),
                          marked(figure(residual.fitted_j * 1e3), Provenance::kFitted),
                          fmt::format("{:+.3g}", (residual.fitted_j - residual.measured_j) * 1e3),
                          fmt::format("{:+.1f}%", 100 * error)});
  }
  const auto count = static_cast<double>(each.fit.residuals.size());
  table.footnotes.push_back(fmt::format("Relative error: root mean square {:.1f} %, worst {:.1f} %",
                                        100 * std::sqrt(squares / count), 100 * worst));
  return table;
}

}  // namespace

std::vector<Table> fit_tables(std::span<const UnitFit> fits) {
  std::vector<Table> tables;
  for (const UnitFit& each : fits) {
    tables.push_back(parameter_table(each));
    if (each.fit.refusal.empty()) tables.push_back(residual_table(each));
  }
  return tables;
}

Json fit_json(std::span<const UnitFit> fits) {
  auto units = Json::array();
  for (const UnitFit& each : fits) {
    auto parameters = Json::array();
    for (const FittedParameter& parameter : each.fit.parameters) {
      Json entry = {{"parameter", to_string(parameter.parameter)},
                    {"value", parameter.value},
                    {"unit", unit_of(parameter.parameter)},
                    {"told_from_zero", is_told_from_zero(parameter)}};
      if (parameter.standard_error) entry["standard_error"] = *parameter.standard_error;
      parameters.push_back(std::move(entry));
    }
    auto residuals = Json::array();
    for (const FitResidual& residual : each.fit.residuals) {
      residuals.push_back({{"workload", residual.workload},
                           {"measured_j", residual.measured_j},
                           {"fitted_j", residual.fitted_j},
                           {"relative_error", residual.relative_error()}});
    }
    Json unit = {{"unit", each.unit},        {"meter", each.meter},
                 {"run", each.run},          {"provenance", to_string(Provenance::kFitted)},
                 {"parameters", parameters}, {"residuals", residuals},
                 {"dropped", each.dropped},  {"left_out", each.fit.left_out}};
    if (each.idle_w) unit["idle_w"] = *each.idle_w;
    if (each.held_w) unit["held_w"] = *each.held_w;
    if (each.fit.condition > 0 && std::isfinite(each.fit.condition)) {
      unit["condition"] = each.fit.condition;
    }
    if (!each.fit.refusal.empty()) unit["refusal"] = each.fit.refusal;
    units.push_back(std::move(unit));
  }
  return units;
}

}  // namespace pirt
