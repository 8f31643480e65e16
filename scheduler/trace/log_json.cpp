#include "scheduler/trace/log_json.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <iterator>
#include <string_view>

#include "workloads/base/error.h"

namespace pirt {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::array<std::string_view, 5> kInputs = {"submit", "complete", "cancel", "set_unit",
                                                     "wake"};
constexpr std::array<std::string_view, 2> kOutcomes = {"completed", "failed"};
constexpr std::array<std::string_view, 3> kUnitStates = {"up", "draining", "down"};
constexpr std::array<std::string_view, 2> kEndings = {"dropped", "expired"};

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

Json times_json(const std::vector<std::vector<std::optional<ServiceTime>>>& times) {
  Json rows = Json::array();
  for (const auto& workload : times) {
    Json& row = rows.emplace_back(Json::array());
    for (const auto& time : workload) {
      row.push_back(time ? Json{time->total.count(), time->occupied.count()} : Json());
    }
  }
  return rows;
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
  const auto& [roles, servers, times, plan, weights, literal_overflow, basic] = setup;
  return {{"roles", roles},          {"servers", servers}, {"times_ns", times_json(times)},
          {"plan", plan_json(plan)}, {"weights", weights}, {"literal_overflow", literal_overflow},
          {"basic", basic}};
}

PolicySetup policy_from_json(const nlohmann::json& json) {
  PolicySetup setup;
  setup.roles = json.at("roles").get<std::vector<std::string>>();
  setup.servers = json.at("servers").get<std::vector<int>>();
  for (const auto& workload : json.at("times_ns")) {
    auto& row = setup.times.emplace_back();
    for (const auto& time : workload) {
      row.emplace_back();
      if (!time.is_null()) {
        row.back() = {Nanos(time.at(0).get<std::int64_t>()), Nanos(time.at(1).get<std::int64_t>())};
      }
    }
  }
  for (const auto& entry : json.at("plan").at("entries")) {
    setup.plan.entries.push_back({entry.at(0).get<UnitId>(), Nanos(entry.at(1).get<std::int64_t>()),
                                  Nanos(entry.at(2).get<std::int64_t>()), std::nullopt});
    if (!entry.at(3).is_null()) {
      setup.plan.entries.back().previous = entry.at(3).get<std::uint32_t>();
    }
  }
  setup.plan.makespan = Nanos(json.at("plan").at("makespan_ns").get<std::int64_t>());
  setup.weights = json.at("weights").get<WeightTable>();
  setup.literal_overflow = json.at("literal_overflow").get<bool>();
  setup.basic = json.at("basic").get<std::string>();
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
  require(std::ranges::all_of(policy.times, of_units), "times");
  const PolicyInfo& mode = find_policy(setup.mode);
  const auto has_role = [&](const PolicyInfo& info) {
    return info.needs_role.empty() ||
           std::ranges::find(policy.roles, info.needs_role) != policy.roles.end();
  };
  const PolicyInfo& basic = mode.has_basic() ? find_basic_policy(policy.basic) : mode;
  require(has_role(mode) && has_role(basic), "roles");
  const bool weighed = basic.rule != WeightRule::kNone;
  require(policy.weights.size() == (weighed ? policy.times.size() : 0) &&
              std::ranges::all_of(policy.weights, of_units),
          "weights");
  for (const auto& entry : policy.plan.entries) {
    require(entry.unit < units && entry.previous.value_or(0) < policy.plan.entries.size(),
            "entries of the plan");
  }
}

void add_task(const Task& task, std::string& line) {
  const auto out = std::back_inserter(line);
  const TaskClass& kind = task.kind;
  fmt::format_to(out, R"(,"class":[{},{},{},{},{}])", kind.workload, kind.eligible, kind.real_time,
                 kind.image_input, kind.entry);
  if (task.deadline) fmt::format_to(out, R"(,"deadline":{})", task.deadline->count());
  if (task.expires_at) fmt::format_to(out, R"(,"expires":{})", task.expires_at->count());
  if (!task.after.empty()) fmt::format_to(out, R"(,"after":[{}])", fmt::join(task.after, ","));
}

}  // namespace

nlohmann::ordered_json to_json(const DispatcherSetup& setup) {
  Json slots = Json::array();
  for (const auto& each : setup.slots) slots.push_back(each ? Json(*each) : Json());
  return {{"schema_version", DispatcherSetup::kSchemaVersion},
          {"mode", setup.mode},
          {"units", setup.units},
          {"slots", slots},
          {"policy", policy_json(setup.policy)}};
}

DispatcherSetup dispatcher_setup_from_json(const nlohmann::json& json) {
  const auto version = json.at("schema_version").get<std::int64_t>();
  if (version != DispatcherSetup::kSchemaVersion) {
    throw_bad_input("schema_version " + std::to_string(version) + ", this pirt reads " +
                    std::to_string(DispatcherSetup::kSchemaVersion));
  }
  DispatcherSetup setup;
  setup.mode = json.at("mode").get<std::string>();
  setup.units = json.at("units").get<std::vector<std::string>>();
  for (const auto& each : json.at("slots")) {
    setup.slots.push_back(each.is_null() ? std::nullopt : std::optional(each.get<int>()));
  }
  setup.policy = policy_from_json(json.at("policy"));
  check_sizes(setup);
  return setup;
}

std::string log_line(const DispatcherInput& input, std::span<const Start> started,
                     std::span<const Ended> ended) {
  using Kind = DispatcherInput::Kind;
  std::string line;
  const auto out = std::back_inserter(line);
  fmt::format_to(out, R"({{"in":"{}","at":{})", word(kInputs, input.kind), input.now.count());
  const bool has_task = input.kind != Kind::kSetUnit && input.kind != Kind::kWake;
  if (has_task) fmt::format_to(out, R"(,"task":{})", input.task.id);
  if (input.kind == Kind::kSubmit) add_task(input.task, line);
  if (input.kind == Kind::kComplete) {
    fmt::format_to(out, R"(,"unit":{},"outcome":"{}")", input.unit, word(kOutcomes, input.outcome));
  }
  if (input.kind == Kind::kSetUnit) {
    fmt::format_to(out, R"(,"unit":{},"state":"{}")", input.unit, word(kUnitStates, input.state));
  }
  std::string_view separator = R"(,"start":[)";
  for (const Start& start : started) {
    fmt::format_to(out, "{}[{},{},{},{}]", separator, start.task, start.unit,
                   start.dispatched_at.count(), start.ready_at.count());
    separator = ",";
  }
  if (!started.empty()) line += ']';
  separator = R"(,"end":[)";
  for (const Ended& each : ended) {
    fmt::format_to(out, R"({}[{},"{}"])", separator, each.task, word(kEndings, each.how));
    separator = ",";
  }
  if (!ended.empty()) line += ']';
  line += '}';
  return line;
}

LogEntry log_entry_from_json(const nlohmann::json& json) {
  LogEntry entry;
  DispatcherInput& input = entry.input;
  const auto nanos = [](const nlohmann::json& value) { return Nanos(value.get<std::int64_t>()); };
  input.kind = value_of<DispatcherInput::Kind>(kInputs, json.at("in").get<std::string>());
  input.now = nanos(json.at("at"));
  using Kind = DispatcherInput::Kind;
  if (input.kind != Kind::kSetUnit && input.kind != Kind::kWake) {
    input.task.id = json.at("task").get<TaskId>();
  }
  if (input.kind == Kind::kSubmit) {
    const auto& kind = json.at("class");
    input.task.kind = {.workload = kind.at(0).get<WorkloadId>(),
                       .eligible = kind.at(1).get<UnitMask>(),
                       .real_time = kind.at(2).get<bool>(),
                       .image_input = kind.at(3).get<bool>(),
                       .entry = kind.at(4).get<std::uint32_t>()};
    if (json.contains("deadline")) input.task.deadline = nanos(json.at("deadline"));
    if (json.contains("expires")) input.task.expires_at = nanos(json.at("expires"));
    if (json.contains("after")) entry.after = json.at("after").get<std::vector<TaskId>>();
  }
  if (input.kind == Kind::kComplete) {
    input.outcome = value_of<Outcome>(kOutcomes, json.at("outcome").get<std::string>());
  }
  if (input.kind == Kind::kSetUnit) {
    input.state = value_of<UnitState>(kUnitStates, json.at("state").get<std::string>());
  }
  if (input.kind == Kind::kComplete || input.kind == Kind::kSetUnit) {
    input.unit = json.at("unit").get<UnitId>();
  }
  if (json.contains("start")) {
    for (const auto& each : json.at("start")) {
      entry.started.push_back({each.at(0).get<TaskId>(), each.at(1).get<UnitId>(),
                               nanos(each.at(2)), nanos(each.at(3))});
    }
  }
  if (json.contains("end")) {
    for (const auto& each : json.at("end")) {
      entry.ended.push_back(
          {each.at(0).get<TaskId>(), value_of<Ending>(kEndings, each.at(1).get<std::string>())});
    }
  }
  return entry;
}

}  // namespace pirt
