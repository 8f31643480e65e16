// The answer of `pirt regress`, whatever was compared, for people (a document), for pull requests
// (the same as Markdown), for CI servers (JUnit XML) and for programs (JSON).
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "reports/document/document.h"
#include "reports/gate/decisions.h"
#include "reports/gate/table_gate.h"
#include "workloads/base/text/json.h"

namespace pirt {

struct GateReport {
  std::string base, candidate;  ///< What was compared: paths.
  std::string anchor = {};      ///< The older base that was compared with as well.
  bool strict = false;          ///< Undecided rows are no pass.
  GateResult result;
  std::optional<Decisions> decisions;
  std::vector<std::string> notes = {};  ///< Below the answer.
  std::vector<std::string> rule;        ///< In words, below the table.
  Json rule_json = Json::object();      ///< In figures.
};

/// The rule of two stored tables, and what was taken off as the machine's, also against an anchor.
void describe_rule(const GateThresholds& thresholds, GateReport& report);

/// 1 if anything became slower or failed, else 3 if anything is inconclusive or not comparable (or,
/// @p strict, undecided), else 0.
[[nodiscard]] int exit_code_of(const GateResult& result, bool strict = false);

/// @param all  Also the rows that are the same or not judged; otherwise they are counted.
[[nodiscard]] Document gate_document(const GateReport& report, bool all);
[[nodiscard]] Json gate_json(const GateReport& report);

/// A test case a row: slower and failed ones fail, what has no answer is skipped, with the reason.
/// @source The format that Jenkins and GitLab read: testsuites, testsuite, testcase, failure,
/// skipped.
[[nodiscard]] std::string gate_junit(const GateReport& report);

}  // namespace pirt
