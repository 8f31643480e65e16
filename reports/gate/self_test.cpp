#include "reports/gate/self_test.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>

#include "workloads/base/error.h"
#include "workloads/base/text/json.h"
#include "workloads/base/text/text.h"

namespace pirt {
namespace {

using Event = Ledger::Event;

/// The phases that an injection into @p step shows in.
bool shows(std::string_view injected, const std::string& phase) {
  if (injected.starts_with("execute")) return phase == "execute" || phase == "call";
  if (injected.starts_with("prepare")) return phase == "prepare";
  return phase.starts_with("schedule");
}

std::string percent_text(double rate) { return fmt::format("{:.2g}", 100 * rate); }

}  // namespace

const std::vector<Trial>& self_test_trials() {
  static const std::vector<Trial> trials = {{"same", "", 0.01},
                                            {"execute +10 %", "execute=1.1", 0.05},
                                            {"prepare +20 %", "prepare=1.2", 0.05},
                                            {"scheduler +10 %", "scheduler=1.1", 0.05},
                                            {"execute +5 %", "execute=1.05", std::nullopt}};
  return trials;
}

const Trial& find_trial(const std::string& name) {
  std::vector<std::string> names;
  for (const Trial& trial : self_test_trials()) {
    if (trial.name == name) return trial;
    names.emplace_back(trial.name);
  }
  throw_bad_input("there is no trial '" + name + "'" + suggestion(name, names));
}

std::string_view to_string(TrialAnswer answer) {
  switch (answer) {
    case TrialAnswer::kRight:
      return "right";
    case TrialAnswer::kWrong:
      return "wrong";
    case TrialAnswer::kInconclusive:
      return "inconclusive";
  }
  return "";
}

TrialAnswer answer_of(const Trial& trial, const GateResult& result, const DuetCell& injected) {
  const int code = exit_code_of(result);
  if (trial.injected.empty()) {
    return code == 0                   ? TrialAnswer::kRight
           : code == kExitInconclusive ? TrialAnswer::kInconclusive
                                       : TrialAnswer::kWrong;
  }
  bool open = false;
  for (const GateRow& row : result.rows) {
    if (row.workload != injected.workload || row.unit != injected.unit) continue;
    if (!shows(trial.injected, row.phase)) continue;
    if (row.verdict == GateVerdict::kSlower) return TrialAnswer::kRight;
    open = open || row.verdict == GateVerdict::kInconclusive;
  }
  return open ? TrialAnswer::kInconclusive : TrialAnswer::kWrong;
}

std::int64_t TrialCount::misses(const Trial& trial) const {
  return trial.injected.empty() ? wrong : wrong + inconclusive;
}

Event SelfTest::event_of(const Trial& trial, TrialAnswer answer, double elapsed_s,
                         std::string detail) {
  Event body = {{"trial", trial.name}, {"answer", to_string(answer)}, {"elapsed_s", elapsed_s}};
  if (!detail.empty()) body["detail"] = std::move(detail);
  return {{"decision", body}};
}

void SelfTest::apply(const Event& event) {
  try {
    const Event& body = event.at("decision");
    const std::string name = body.at("trial");
    const Trial& trial = find_trial(name);
    const std::string answer = body.at("answer");
    TrialCount& count = counts_[std::string(trial.name)];
    std::int64_t* const of = answer == "right"          ? &count.right
                             : answer == "wrong"        ? &count.wrong
                             : answer == "inconclusive" ? &count.inconclusive
                                                        : nullptr;
    if (of == nullptr) throw_bad_input("there is no answer '" + answer + "'");
    ++*of;
    count.elapsed_s += body.at("elapsed_s").get<double>();
  } catch (const JsonError&) {
    throw_bad_input("an event that lacks something");
  }
}

TrialCount SelfTest::count(const Trial& trial) const {
  const auto found = counts_.find(trial.name);
  return found == counts_.end() ? TrialCount{} : found->second;
}

bool breaks_promise(const SelfTest& test) {
  return std::ranges::any_of(self_test_trials(), [&](const Trial& trial) {
    const TrialCount count = test.count(trial);
    // One in a few is no contradiction to one in a hundred only if it could be chance.
    return trial.promised && count.decisions() > 0 &&
           rate_lower_bound(count.misses(trial), count.decisions()) > *trial.promised + 1e-9;
  });
}

Document self_test_document(const SelfTest& test) {
  Table table{.title = "Whole decisions on this machine",
              .columns = {{"trial", Align::kLeft},
                          {"decisions"},
                          {"right"},
                          {"wrong"},
                          {"inconclusive"},
                          {"rate %"},
                          {"at most %"},
                          {"promised %"},
                          {"s a decision"}}};
  for (const Trial& trial : self_test_trials()) {
    const TrialCount count = test.count(trial);
    const auto n = count.decisions();
    if (n == 0) continue;
    const auto misses = count.misses(trial);
    const double rate = static_cast<double>(misses) / static_cast<double>(n);
    table.rows.push_back({std::string(trial.name), std::to_string(n), std::to_string(count.right),
                          std::to_string(count.wrong), std::to_string(count.inconclusive),
                          percent_text(rate), percent_text(rate_upper_bound(misses, n)),
                          trial.promised ? percent_text(*trial.promised) : "-",
                          fmt::format("{:.1f}", count.elapsed_s / static_cast<double>(n))});
  }
  table.footnotes = {
      "same: the rate of false alarms; others: of slowdowns that were missed, an inconclusive "
      "answer being a miss.",
      "at most: with 95 % confidence, from so many decisions; more of them say more: go on with "
      "the same --ledger."};
  Document document{.title = "The gate of two programs, tested on itself", .parts = {table}};
  return document;
}

Json self_test_json(const SelfTest& test) {
  Event trials = Event::array();
  for (const Trial& trial : self_test_trials()) {
    const TrialCount count = test.count(trial);
    const auto n = count.decisions();
    if (n == 0) continue;
    const auto misses = count.misses(trial);
    Event json = {{"trial", trial.name},
                  {"decisions", n},
                  {"right", count.right},
                  {"wrong", count.wrong},
                  {"inconclusive", count.inconclusive},
                  {"rate", static_cast<double>(misses) / static_cast<double>(n)},
                  {"rate_at_most", rate_upper_bound(misses, n)}};
    if (trial.promised) json["promised"] = *trial.promised;
    json["elapsed_s"] = count.elapsed_s;
    trials.push_back(json);
  }
  return {{"schema_version", 1}, {"breaks_promise", breaks_promise(test)}, {"trials", trials}};
}

}  // namespace pirt
