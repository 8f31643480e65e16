#include "scheduler/trace/log_json.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <iterator>
#include <string_view>
#include <utility>

#include "workloads/base/error.h"
#include "workloads/base/text/json.h"

namespace pirt {
namespace {

constexpr std::array<std::string_view, 7> kInputs = {"submit",   "release", "complete",   "cancel",
                                                     "set_unit", "wake",    "slice_ended"};
constexpr std::array<std::string_view, 3> kOutcomes = {"completed", "failed", "returned"};
constexpr std::array<std::string_view, 3> kUnitStates = {"up", "draining", "gone"};

template <typename Enum, std::size_t N>
std::string_view word(const std::array<std::string_view, N>& words, Enum value) {
  return words[static_cast<std::size_t>(value)];
}

template <typename Enum, std::size_t N>
Enum value_of(const std::array<std::string_view, N>& words, const std::string& text) {
  const auto found = std::ranges::find(words, text);
  if (found == words.end()) throw_bad_input("'" + text + "' is no word of the log");
  return static_cast<Enum>(found - words.begin());
}

/// A whole number as it stands there: Json's own conversion takes those with a fraction too.
template <typename Integer>
Integer whole(const Json& json) {
  const bool fits = json.is_number_unsigned()  ? std::in_range<Integer>(json.get<std::uint64_t>())
                    : json.is_number_integer() ? std::in_range<Integer>(json.get<std::int64_t>())
                                               : false;
  if (!fits) throw_bad_input(json_text(json) + " is no whole number that can stand there");
  return json.get<Integer>();
}

Nanos time_from_json(const Json& json) {
  const Nanos time(whole<std::int64_t>(json));
  if (time < Nanos::zero())
    throw_bad_input("a time of " + json_text(json) + " ns is before the begin");
  return time;
}

Json costs_json(const CostTable& costs) {
  Json rows = Json::array();
  for (const auto& workload : costs) {
    Json& row = rows.emplace_back(Json::array());
    for (const auto& cost : workload) {
      row.push_back(cost ? Json{cost->total.count(), cost->occupied.count(),
                                cost->energy_j ? Json(*cost->energy_j) : Json(),
                                to_string(cost->energy_provenance), cost->energy_provenance.mixture}
                         : Json());
    }
  }
  return rows;
}

/// What @p read makes of each element.
template <typename Read>
auto list_of(const Json& json, const Read& read) {
  std::vector<decltype(read(json))> list;
  for (const Json& each : json) list.push_back(read(each));
  return list;
}

std::optional<CallCost> cost_from_json(const Json& json) {
  if (json.is_null()) return std::nullopt;
  CallCost cost{.total = time_from_json(json.at(0)),
                .occupied = time_from_json(json.at(1)),
                .energy_j = std::nullopt};
  if (!json.at(2).is_null()) cost.energy_j = json.at(2).get<double>();
  const auto provenance = provenance_from_string(json.at(3).get<std::string>());
  if (!provenance) throw_bad_input(json_text(json.at(3)) + " is no provenance");
  cost.energy_provenance = {*provenance, json.at(4).get<bool>()};
  return cost;
}

Role known_role(const Json& json) {
  const auto role = role_from_string(json.get<std::string>());
  if (!role) throw_bad_input(json_text(json) + " is no role");
  return *role;
}

Json plan_json(const MixPlan& plan) {
  Json entries = Json::array();
  for (const auto& [unit, start, finish, previous] : plan.entries) {
    entries.push_back({unit, start.count(), finish.count(), previous ? Json(*previous) : Json()});
  }
  return {{"entries", entries}, {"makespan_ns", plan.makespan.count()}};
}

/// By its members in order, so that one that is added does not compile until it is written here
/// and read below.
Json policy_json(const PolicySetup& setup) {
  const auto& [roles, servers, costs, plan, budget, budget_without, weights, literal_overflow,
               basic, follows, seed] = setup;
  Json role_names = Json::array();
  for (const Role role : roles) role_names.push_back(to_string(role));
  Json without = Json::array();
  for (const BudgetPlan& each : budget_without) without.push_back(to_json(each));
  return {{"roles", role_names},
          {"servers", servers},
          {"costs", costs_json(costs)},
          {"plan", plan_json(plan)},
          {"budget", to_json(budget)},
          {"budget_without", without},
          {"weights", weights},
          {"literal_overflow", literal_overflow},
          {"basic", basic == nullptr ? Json() : Json(basic->name)},
          {"follows", follows == nullptr ? Json() : Json(follows->name)},
          {"seed", seed}};
}

MixPlan::Entry plan_entry_from_json(const Json& json) {
  return {whole<UnitId>(json.at(0)), time_from_json(json.at(1)), time_from_json(json.at(2)),
          json.at(3).is_null() ? std::nullopt : std::optional(whole<std::uint32_t>(json.at(3)))};
}

const PolicyInfo* basic_policy_from_json(const Json& json) {
  return json.is_null() ? nullptr : &find_basic_policy(json.get<std::string>());
}

PolicySetup policy_from_json(const Json& json) {
  PolicySetup setup;
  setup.roles = list_of(json.at("roles"), known_role);
  setup.servers = json.at("servers").get<std::vector<int>>();
  setup.costs = list_of(json.at("costs"),
                        [](const Json& workload) { return list_of(workload, cost_from_json); });
  setup.plan.entries = list_of(json.at("plan").at("entries"), plan_entry_from_json);
  setup.plan.makespan = time_from_json(json.at("plan").at("makespan_ns"));
  const auto plan_from_json = [units = setup.roles.size()](const Json& plan) {
    return budget_plan_from_json(plan, units);
  };
  setup.budget = plan_from_json(json.at("budget"));
  setup.budget_without = list_of(json.at("budget_without"), plan_from_json);
  setup.weights = json.at("weights").get<WeightTable>();
  setup.literal_overflow = json.at("literal_overflow").get<bool>();
  setup.follows = basic_policy_from_json(json.value("follows", Json()));
  setup.basic = basic_policy_from_json(json.at("basic"));
  setup.seed = whole<std::uint64_t>(json.at("seed"));
  return setup;
}

void require(bool condition, const char* what) {
  if (!condition) throw_bad_input(std::string(what) + " do not fit the units and the mode");
}

/// What policies rely on and do not check.
void check_sizes(const DispatcherSetup& setup) {
  const std::size_t units = setup.units.size();
  const PolicySetup& policy = setup.policy;
  const auto of_units = [&](const auto& row) { return row.size() == units; };
  require(units > 0 && units <= kMaxUnits, "the units");
  require(of_units(setup.slots) && of_units(policy.roles) && of_units(policy.servers),
          "slots, roles and servers");
  require(std::ranges::all_of(policy.servers, [](int each) { return each >= 1; }), "servers");
  require(std::ranges::all_of(setup.slots, [](const auto& each) { return each.value_or(1) >= 1; }),
          "slots");
  require(std::ranges::all_of(policy.costs, of_units), "costs");
  require(setup.mode->has_basic() == (policy.basic != nullptr), "mode and basic");
  require(setup.mode->budgets || policy.follows == nullptr, "mode and follows");
  const PolicyInfo& basic = policy.basic == nullptr ? *setup.mode : *policy.basic;
  const auto has_role = [&](const PolicyInfo& info) {
    return !info.needs_role ||
           std::ranges::find(policy.roles, *info.needs_role) != policy.roles.end();
  };
  require(has_role(*setup.mode) && has_role(basic), "roles");
  require(setup.mode->budgets == !policy.budget.tasks.empty(), "the plan");
  require(policy.budget_without.empty() || policy.budget_without.size() == units, "the plans");
  for (const BudgetPlan& each : policy.budget_without) {
    require(each.tasks.empty() || (each.tasks.size() == policy.budget.tasks.size() &&
                                   each.pipelines.size() == policy.budget.pipelines.size()),
            "the plans");
  }
  const bool weighed = basic.rule != WeightRule::kNone;
  require(policy.weights.size() == (weighed ? policy.costs.size() : 0) &&
              std::ranges::all_of(policy.weights, of_units),
          "weights");
  for (const auto& entry : policy.plan.entries) {
    require(entry.unit < units && entry.previous.value_or(0) < policy.plan.entries.size(),
            "entries of the plan");
  }
}

/// `,"key":[...]`, what @p write appends of each with commas between; nothing where there is none.
template <typename Item, typename Write>
void add_list(const char* key, std::span<const Item> items, std::string& line, const Write& write) {
  if (items.empty()) return;
  fmt::format_to(std::back_inserter(line), R"(,"{}":)", key);
  char separator = '[';
  for (const Item& each : items) {
    line += std::exchange(separator, ',');
    write(each);
  }
  line += ']';
}

void add_task(const Task& task, std::string& line) {
  const auto out = std::back_inserter(line);
  const TaskClass& kind = task.kind;
  fmt::format_to(out, R"({{"class":[{},{},{},{},{}])", kind.workload, kind.eligible, kind.real_time,
                 kind.image_input, kind.entry);
  const auto add_numbers = [&](const char* key, const auto& numbers) {
    if (!numbers.empty()) fmt::format_to(out, R"(,"{}":[{}])", key, fmt::join(numbers, ","));
  };
  if (task.deadline) fmt::format_to(out, R"(,"deadline":{})", task.deadline->count());
  if (task.expires_at) fmt::format_to(out, R"(,"expires":{})", task.expires_at->count());
  if (task.recall) {
    fmt::format_to(out, R"(,"recall":[{},{}])", task.recall->at.count(), task.recall->from);
  }
  add_numbers("after", task.after);
  add_numbers("after_own", task.after_own);
  if (task.state) fmt::format_to(out, R"(,"state":{})", *task.state);
  if (task.series) fmt::format_to(out, R"(,"series":{})", *task.series);
  add_numbers("reads", task.reads);
  line += '}';
}

void add_decisions(const Answer& answer, std::string& line) {
  const auto out = std::back_inserter(line);
  const auto add_sliced = [&](const char* key, std::span<const Sliced> tasks) {
    add_list(key, tasks, line,
             [&](const Sliced& each) { fmt::format_to(out, "[{},{}]", each.task, each.unit); });
  };
  add_list("start", answer.started, line, [&](const Start& each) {
    fmt::format_to(out, "[{},{},{},{}]", each.task, each.unit, each.dispatched_at.count(),
                   each.ready_at.count());
  });
  add_list("end", answer.ended, line, [&](const Ended& each) {
    fmt::format_to(out, R"([{},"{}"])", each.task, to_string(each.how));
  });
  add_sliced("leave", answer.suspended);
  add_sliced("resume", answer.resumed);
}

using Kind = DispatcherInput::Kind;

bool names_firing(Kind kind, bool taken) {
  return kind == Kind::kRelease || (kind == Kind::kSubmit && taken);
}
bool names_task(Kind kind) {
  return kind == Kind::kComplete || kind == Kind::kCancel || kind == Kind::kSliceEnded;
}
bool names_unit(Kind kind) {
  return kind == Kind::kComplete || kind == Kind::kSetUnit || kind == Kind::kSliceEnded;
}

}  // namespace

Json to_json(const DispatcherSetup& setup) {
  Json slots = Json::array();
  for (const auto& each : setup.slots) slots.push_back(each ? Json(*each) : Json());
  return {{"schema_version", DispatcherSetup::kSchemaVersion},
          {"mode", setup.mode->name},
          {"units", setup.units},
          {"slots", slots},
          {"policy", policy_json(setup.policy)}};
}

void check_trace_version(const Json& json) {
  const auto version = whole<std::int64_t>(json.at("schema_version"));
  if (version == DispatcherSetup::kSchemaVersion) return;
  throw_bad_input(
      fmt::format("a trace of schema_version {}, this pirt reads {}; write it again with this one",
                  version, DispatcherSetup::kSchemaVersion));
}

DispatcherSetup dispatcher_setup_from_json(const Json& json) {
  check_trace_version(json);
  DispatcherSetup setup;
  setup.mode = &find_policy(json.at("mode").get<std::string>());
  setup.units = json.at("units").get<std::vector<std::string>>();
  setup.slots = list_of(json.at("slots"), [](const Json& each) {
    return each.is_null() ? std::nullopt : std::optional(whole<int>(each));
  });
  setup.policy = policy_from_json(json.at("policy"));
  check_sizes(setup);
  return setup;
}

std::string_view word(Outcome outcome) { return word(kOutcomes, outcome); }

std::string log_line(const DispatcherInput& input, const Answer& answer) {
  std::string line;
  const auto out = std::back_inserter(line);
  fmt::format_to(out, R"({{"in":"{}","at":{})", word(kInputs, input.kind), input.now.count());
  if (names_firing(input.kind, answer.taken)) {
    fmt::format_to(out, R"(,"firing":{})", input.firing);
  }
  if (input.kind == Kind::kSubmit) {
    if (input.tasks.empty()) line += R"(,"tasks":[])";
    add_list("tasks", input.tasks, line, [&](const Task& each) { add_task(each, line); });
    fmt::format_to(out, R"(,"ids":[{}])", fmt::join(answer.submitted, ","));
  }
  if (names_task(input.kind)) fmt::format_to(out, R"(,"task":{})", input.task);
  if (names_unit(input.kind)) fmt::format_to(out, R"(,"unit":{})", input.unit);
  if (input.kind == Kind::kComplete) {
    fmt::format_to(out, R"(,"outcome":"{}")", word(kOutcomes, input.outcome));
  }
  if (input.kind == Kind::kSetUnit) {
    fmt::format_to(out, R"(,"state":"{}")", word(kUnitStates, input.state));
  }
  if (!answer.taken) line += R"(,"refused":true)";
  add_decisions(answer, line);
  line += '}';
  return line;
}

namespace {

/// None where there is no such key.
template <typename Read>
auto list_from_json(const Json& json, const char* key, const Read& read) {
  return json.contains(key) ? list_of(json.at(key), read) : decltype(list_of(json, read))();
}

void add_task_from_json(const Json& json, LogEntry& entry) {
  Task& task = entry.tasks.emplace_back();
  const auto& kind = json.at("class");
  task.kind = {.workload = whole<WorkloadId>(kind.at(0)),
               .eligible = whole<UnitMask>(kind.at(1)),
               .real_time = kind.at(2).get<bool>(),
               .image_input = kind.at(3).get<bool>(),
               .entry = whole<std::uint32_t>(kind.at(4))};
  if (json.contains("deadline")) task.deadline = time_from_json(json.at("deadline"));
  if (json.contains("expires")) task.expires_at = time_from_json(json.at("expires"));
  if (json.contains("recall")) {
    const Json& recall = json.at("recall");
    task.recall = {Nanos(whole<std::int64_t>(recall.at(0))), whole<UnitMask>(recall.at(1))};
  }
  task.after = entry.after.emplace_back(list_from_json(json, "after", whole<TaskId>));
  task.after_own =
      entry.after_own.emplace_back(list_from_json(json, "after_own", whole<std::uint32_t>));
  if (json.contains("state")) task.state = whole<StateId>(json.at("state"));
  if (json.contains("series")) task.series = whole<SeriesId>(json.at("series"));
  task.reads = entry.reads.emplace_back(list_from_json(json, "reads", whole<SeriesId>));
}

Effects effects_from_json(const Json& json) {
  const auto sliced = [](const Json& each) {
    return Sliced{whole<TaskId>(each.at(0)), whole<UnitId>(each.at(1))};
  };
  const auto start = [](const Json& each) {
    return Start{whole<TaskId>(each.at(0)), whole<UnitId>(each.at(1)), time_from_json(each.at(2)),
                 time_from_json(each.at(3))};
  };
  const auto end = [](const Json& each) {
    return Ended{whole<TaskId>(each.at(0)),
                 value_of<TaskEnd>(kTaskEnds, each.at(1).get<std::string>())};
  };
  return {.submitted = list_from_json(json, "ids", whole<TaskId>),
          .started = list_from_json(json, "start", start),
          .ended = list_from_json(json, "end", end),
          .recalled = {},
          .suspended = list_from_json(json, "leave", sliced),
          .resumed = list_from_json(json, "resume", sliced)};
}

LogEntry entry_from_json(const Json& json) {
  LogEntry entry;
  DispatcherInput& input = entry.input;
  input.kind = value_of<Kind>(kInputs, json.at("in").get<std::string>());
  input.now = time_from_json(json.at("at"));
  entry.taken = !json.value("refused", false);
  if (names_firing(input.kind, entry.taken)) {
    input.firing = whole<FiringId>(json.at("firing"));
  }
  if (input.kind == Kind::kSubmit) {
    for (const auto& task : json.at("tasks")) add_task_from_json(task, entry);
  }
  if (names_task(input.kind)) input.task = whole<TaskId>(json.at("task"));
  if (names_unit(input.kind)) input.unit = whole<UnitId>(json.at("unit"));
  if (input.kind == Kind::kComplete) {
    input.outcome = value_of<Outcome>(kOutcomes, json.at("outcome").get<std::string>());
  }
  if (input.kind == Kind::kSetUnit) {
    input.state = value_of<UnitState>(kUnitStates, json.at("state").get<std::string>());
  }
  entry.effects = effects_from_json(json);
  return entry;
}

}  // namespace

LogEntry log_entry_from_json(const Json& json, std::size_t number) {
  try {
    return entry_from_json(json);
  } catch (const Error& error) {
    throw_bad_input(fmt::format("input {} of the log: {}", number, error.what()));
  }
}

std::string not_a_trace(const std::string& source, const JsonError& error) {
  return source + ": not a complete trace: " + error.reason() +
         "; it is cut off, or another version of pirt wrote it: write it again with this one (pirt "
         "schedule --trace, pirt run-robot --trace)";
}

}  // namespace pirt
