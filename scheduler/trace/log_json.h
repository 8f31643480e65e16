// The dispatcher's part of a trace as JSON: what it was made of, its inputs, and what it decided.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "scheduler/dispatcher/dispatcher.h"
#include "scheduler/policies/policy.h"
#include "workloads/base/text/json.h"

namespace pirt {

/// All that a fresh dispatcher is made from.
struct DispatcherSetup {
  /// Another one also where a policy decides otherwise by the same inputs.
  static constexpr int kSchemaVersion = 6;
  const PolicyInfo* mode = nullptr;
  std::vector<std::string> units;
  std::vector<std::optional<int>> slots;  ///< By unit.
  PolicySetup policy;
};

[[nodiscard]] Json to_json(const DispatcherSetup& setup);
/// Null for an empty plan.
[[nodiscard]] Json to_json(const BudgetPlan& plan);
/// The same back.
/// @throws JsonError for a missing key or a wrong type, Error{kBadInput} for what fits no platform
/// of @p units units.
[[nodiscard]] BudgetPlan budget_plan_from_json(const Json& json, std::size_t units);

/// What is wrong with a trace that lacks something, and what to do.
[[nodiscard]] std::string not_a_trace(const std::string& source, const JsonError& error);

/// Of a trace's part "pirt".
/// @throws Error{kBadInput} for another version; JsonError where there is none.
void check_trace_version(const Json& json);

/// @throws JsonError for a missing key or a wrong type, Error{kBadInput} for
/// another version, an unknown mode, or tables that do not fit the units.
[[nodiscard]] DispatcherSetup dispatcher_setup_from_json(const Json& json);

/// An input with its answer. Holds the tasks that an input only shows, and what these show; it is
/// moved, and never copied.
struct LogEntry {
  LogEntry() = default;
  LogEntry(LogEntry&&) = default;

  DispatcherInput input;
  std::vector<Task> tasks;
  std::vector<std::vector<TaskId>> after;             ///< Of each task,
  std::vector<std::vector<std::uint32_t>> after_own;  ///< likewise,
  std::vector<std::vector<SeriesId>> reads;           ///< and likewise.
  bool taken = true;
  Effects effects;  ///< Without what was recalled.
};

/// "completed", "dropped": as they stand in the log.
[[nodiscard]] std::string_view word(Outcome outcome);

/// One line of JSON. Keys are left out where they do not apply.
[[nodiscard]] std::string log_line(const DispatcherInput& input, const Answer& answer);
/// @param number  Of the entry in its log, from 1: for messages.
/// @throws JsonError as above, Error{kBadInput} for a word that is none.
[[nodiscard]] LogEntry log_entry_from_json(const Json& json, std::size_t number);

}  // namespace pirt
