// The platform file: its keys, their ranges and what refers to what. Semantics of the values are
// the scheduler's business.
#include "characterize/platform/platform_file.h"

#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <string>
#include <utility>

#include "characterize/platform/platform_cores.h"
#include "workloads/backends/backend_list.h"
#include "workloads/backends/fake/fake_script.h"
#include "workloads/base/error.h"
#include "workloads/base/text/text.h"
#include "workloads/catalog/specs.h"

namespace pirt {

const std::vector<std::string>& workload_keys() {
  static const std::vector<std::string> names = {"call_j", "provenance", "source"};
  return names;
}

namespace {

constexpr double kMaxWatts = 1e6;
constexpr double kMaxPicojoules = 1e12;
constexpr double kMaxJoules = 1e9;
constexpr double kMaxMegabytes = 1e7;
constexpr double kMaxScale = 1e3;
constexpr std::int64_t kMaxServers = 1'000'000;
constexpr std::int64_t kMaxWeight = 1'000'000;

/// Names are parts of `--set unit.key`, `--weights unit=n` and `unit.stage`, which must stay
/// readable by machine.
std::string checked_name(const YamlNode& node, const std::string& name) {
  const auto allowed = [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' ||
           c == '-';
  };
  if (name.empty() || !std::ranges::all_of(name, allowed)) {
    node.fail("a name is made of letters, digits, '_' and '-', got '" + name + "'");
  }
  return name;
}

std::string text_or_empty(const YamlNode& node, std::string_view key) {
  return node.has(key) ? node.at(key).text() : "";
}

std::string paragraph_or_empty(const YamlNode& node, std::string_view key) {
  return node.has(key) ? node.at(key).paragraph() : "";
}

double number_or_zero(const YamlNode& node, std::string_view key, double high) {
  return node.has(key) ? node.at(key).number(0, high) : 0;
}

Distribution read_distribution(const YamlNode& node) {
  const auto [low, high] = node.time_range();
  using Kind = Distribution::Kind;
  return {.kind = node.is_map() ? Kind::kUniform : Kind::kConstant, .low = low, .high = high};
}

/// Whether read_distribution is meant, and no list of stages.
bool is_time(const YamlNode& node) {
  return node.is_map() ? node.has("uniform") : !node.is_sequence();
}

using Machine = std::span<const PhysicalCore>;

std::vector<int> read_cores(const YamlNode& node, Machine machine) {
  if (!node.is_sequence()) return cores_of_part(node.one_of(core_parts()), machine);
  std::vector<int> cores;
  for (const auto& item : node.items()) {
    const int core = static_cast<int>(item.integer(0, 65535));
    if (std::ranges::find(cores, core) != cores.end()) item.fail("core given twice");
    cores.push_back(core);
  }
  if (cores.empty()) node.fail("must name at least one core");
  return cores;
}

bool is_workload(const std::string& name) { return is_foreign(name) || try_find_spec(name); }

void check_workload(const YamlNode& node, const std::string& name) {
  if (is_workload(name)) return;
  node.fail("there is no workload '" + name + "'" + suggestion(name, workload_names()));
}

/// The backend reads it again when it opens the unit; only here are file, line and catalog known.
void check_fake_script(const YamlNode& script) {
  static_cast<void>(fake::read_script(script));
  for (const std::string& key : script.keys()) {
    if (!fake::names_workloads(key)) continue;
    const YamlNode named = script.at(key);
    if (named.is_map()) {
      for (const std::string& name : named.keys()) check_workload(named.at(name), name);
    } else {
      for (const YamlNode& item : named.items()) check_workload(item, item.text());
    }
  }
}

void refuse_gone(const YamlNode& node) {
  for (const std::string& key : node.keys()) {
    if (const std::string why = gone_setting(key); !why.empty()) node.at(key).fail(why);
  }
}

/// Names and ranges are the backend's.
void read_options(const YamlNode& node, UnitModel& unit) {
  refuse_gone(node);
  const auto specs = options_of(unit.backend);
  std::vector<std::string> known;
  for (const OptionSpec& spec : specs) known.push_back(spec.name);
  for (const std::string& name : node.keys()) {
    const auto spec = std::ranges::find(specs, name, &OptionSpec::name);
    if (spec == specs.end()) {
      node.at(name).fail("backend " + unit.backend + " has no option '" + name + "'" +
                         (known.empty() ? "; it has none" : suggestion(name, known)));
    }
    unit.options[name] = node.at(name).number(spec->low, spec->high);
  }
}

/// Texts for the backend. What they mean it says when it opens the unit.
void read_settings(const YamlNode& node, UnitModel& unit) {
  const auto own = settings_of(unit.backend);
  YAML::Node settings;
  for (const std::string& backend : backend_names()) {
    for (const std::string& name : settings_of(backend)) {
      if (!node.has(name)) continue;
      if (std::ranges::find(own, name) == own.end()) {
        node.at(name).fail("only a unit with `backend: " + backend + "` has that");
      }
      settings[name] = node.at(name).text();
    }
  }
  if (settings.size() > 0) unit.script = YAML::Dump(settings);
}

std::map<std::string, std::vector<std::string>> read_programs(const YamlNode& node) {
  std::map<std::string, std::vector<std::string>> programs;
  std::map<std::string, std::string> known;
  for (const auto& name : node.keys()) {
    for (const YamlNode& item : node.at(name).items()) {
      const std::string workload = item.text();
      check_workload(item, workload);
      const auto [first, added] = known.emplace(workload, name);
      if (!added) item.fail(workload + " is in program " + first->second + " already");
      programs[name].push_back(workload);
    }
  }
  return programs;
}

void read_contexts(const YamlNode& node, UnitModel& unit) {
  node.check_keys({"prepare_ms", "programs"});
  unit.contexts.emplace();
  if (node.has("programs")) unit.contexts->programs = read_programs(node.at("programs"));
  if (node.has("prepare_ms")) unit.contexts->prepare = node.at("prepare_ms").milliseconds(0);
  if (unit.servers != 1) {
    node.fail("a unit with contexts has one server, and this one has " +
              std::to_string(unit.servers) + "; take `contexts` or `servers` out");
  }
  if (unit.slots.value_or(1) != 1) {
    node.fail("a unit with contexts takes one task at a time; take `slots` out, or set it to 1");
  }
  unit.slots = 1;
}

Nanos read_spin(const YamlNode& node) { return from_ms(node.number(0, to_us(kMostSpin)) / 1e3); }

void read_backend(const YamlNode& node, Machine machine, UnitModel& unit) {
  if (node.has("backend")) {
    unit.backend = node.at("backend").one_of(backend_names());
  }
  for (const char* key : {"cores", "device", "script", "meter", "options", "spin_us"}) {
    if (node.has(key) && unit.backend.empty()) node.at(key).fail("needs a `backend:` beside it");
  }
  if (node.has("cores")) unit.cores = read_cores(node.at("cores"), machine);
  if (node.has("spin_us")) unit.spin = read_spin(node.at("spin_us"));
  unit.device = text_or_empty(node, "device");
  unit.meter = text_or_empty(node, "meter");
  if (node.has("options")) read_options(node.at("options"), unit);
  read_settings(node, unit);
  if (node.has("script")) {
    const auto script = node.at("script");
    if (unit.backend != "fake") script.fail("only backend fake takes a script");
    check_fake_script(script);
    unit.script = script.dump();
  }
}

UnitModel read_unit(const YamlNode& node, const std::string& name, Machine machine) {
  std::vector<std::string> known = {"servers", "discipline", "slots",  "active_w", "idle_w",
                                    "role",    "energy",     "link",   "backend",  "cores",
                                    "device",  "script",     "meter",  "options",  "contexts",
                                    "memory",  "spin_us",    "held_w", "watts_of", "memory_mb"};
  for (const std::string& backend : backend_names()) {
    for (const std::string& key : settings_of(backend)) known.push_back(key);
  }
  refuse_gone(node);
  node.check_keys(known);
  UnitModel unit;
  unit.name = checked_name(node, name);
  unit.role = role_from_string(name).value_or(Role::kOther);
  if (std::ranges::find(workload_keys(), name) != workload_keys().end()) {
    node.fail("'" + name + "' is a key of workload entries and cannot name a unit");
  }
  if (node.has("role")) unit.role = *role_from_string(node.at("role").one_of(role_names()));
  if (node.has("servers"))
    unit.servers = static_cast<int>(node.at("servers").integer(1, kMaxServers));
  if (node.has("discipline") &&
      node.at("discipline").one_of({"fifo", "processor_sharing"}) == "processor_sharing") {
    unit.discipline = Discipline::kProcessorSharing;
  }
  if (node.has("slots")) unit.slots = static_cast<int>(node.at("slots").integer(1, kMaxServers));
  unit.active_w = number_or_zero(node, "active_w", kMaxWatts);
  unit.idle_w = number_or_zero(node, "idle_w", kMaxWatts);
  unit.held_w = number_or_zero(node, "held_w", kMaxWatts);
  unit.watts_of_host_cores =
      node.has("watts_of") && node.at("watts_of").one_of({"device", "host_cores"}) == "host_cores";
  if (node.has("energy")) {
    const auto energy = node.at("energy");
    energy.check_keys({"op_pj", "byte_pj", "call_j", "provenance", "source"});
    unit.op_pj = number_or_zero(energy, "op_pj", kMaxPicojoules);
    unit.byte_pj = number_or_zero(energy, "byte_pj", kMaxPicojoules);
    unit.call_j = number_or_zero(energy, "call_j", kMaxJoules);
    if (energy.has("provenance")) {
      unit.energy_provenance =
          *provenance_from_string(energy.at("provenance").one_of({"modelled", "fitted"}));
    }
    unit.energy_source = paragraph_or_empty(energy, "source");
  }
  unit.link = text_or_empty(node, "link");
  unit.memory = text_or_empty(node, "memory");
  if (node.has("memory_mb")) {
    unit.memory_limit_bytes = std::llround(node.at("memory_mb").number(1e-3, kMaxMegabytes) * 1e6);
  }
  read_backend(node, machine, unit);
  if (node.has("contexts")) read_contexts(node.at("contexts"), unit);
  return unit;
}

void mark_shared_cores(std::vector<UnitModel>& units) {
  for (auto& unit : units) {
    for (const auto& other : units) {
      if (&unit == &other) continue;
      unit.shares_cores |= std::ranges::find_first_of(unit.cores, other.cores) != unit.cores.end();
    }
  }
}

void read_units(const YamlNode& node, Machine machine, Platform& platform) {
  for (const auto& name : node.keys()) {
    platform.units.push_back(read_unit(node.at(name), name, machine));
  }
  if (platform.units.empty()) node.fail("a platform has at least one unit");
  mark_shared_cores(platform.units);
}

void read_links(const YamlNode& node, Platform& platform) {
  for (const auto& name : node.keys()) {
    const auto entry = node.at(name);
    entry.check_keys({"mbit_s", "latency_ms", "active_w"});
    Link link;
    link.name = checked_name(entry, name);
    link.mbit_s = entry.at("mbit_s").number(1e-6, 1e9);
    if (entry.has("latency_ms")) link.latency = read_distribution(entry.at("latency_ms"));
    link.active_w = number_or_zero(entry, "active_w", kMaxWatts);
    platform.links.emplace(name, link);
  }
}

void check_links(const YamlNode& units, const Platform& platform) {
  std::vector<std::string> known;
  for (const auto& [name, link] : platform.links) known.push_back(name);
  for (const auto& unit : platform.units) {
    if (unit.link.empty() || platform.links.contains(unit.link)) continue;
    units.at(unit.name).at("link").fail("no link '" + unit.link + "' under `links:`" +
                                        suggestion(unit.link, known));
  }
}

/// The key must be a unit of the platform.
void check_unit(const YamlNode& node, const std::string& unit, const Platform& platform) {
  if (platform.find_unit(unit) != nullptr) return;
  node.fail("no unit '" + unit + "' on this platform" + suggestion(unit, platform.unit_names()));
}

Stage read_stage(const YamlNode& node, const Platform& platform) {
  node.check_keys({"on", "ms", "delay_ms", "name"});
  Stage stage;
  if (node.has("delay_ms")) {
    if (node.has("on") || node.has("ms")) node.fail("is either `on` with `ms`, or `delay_ms`");
    stage.time = read_distribution(node.at("delay_ms"));
    stage.name = "delay";
  } else {
    stage.on = node.at("on").text();
    check_unit(node.at("on"), stage.on, platform);
    stage.time = read_distribution(node.at("ms"));
    stage.name = "execute";
  }
  if (node.has("name")) stage.name = checked_name(node.at("name"), node.at("name").text());
  return stage;
}

WorkloadModel read_workload(const YamlNode& node, const Platform& platform) {
  WorkloadModel model;
  auto allowed = platform.unit_names();
  allowed.insert(allowed.end(), workload_keys().begin(), workload_keys().end());
  node.check_keys(allowed);
  for (const auto& unit : platform.unit_names()) {
    if (!node.has(unit)) continue;
    auto& stages = model.stages[unit];
    const YamlNode entry = node.at(unit);
    if (is_time(entry)) {
      stages.push_back({.name = "execute", .on = unit, .time = read_distribution(entry)});
      continue;
    }
    for (const auto& stage : entry.items()) stages.push_back(read_stage(stage, platform));
    if (stages.empty()) entry.fail("must list at least one stage");
  }
  if (node.has("call_j")) {
    const auto call_j = node.at("call_j");
    for (const auto& unit : call_j.keys()) {
      check_unit(call_j.at(unit), unit, platform);
      model.call_j[unit] = call_j.at(unit).number(0, kMaxJoules);
    }
  }
  if (node.has("provenance")) {
    const std::vector<std::string> known = {"measured", "counted", "modelled", "fitted",
                                            "published"};
    model.provenance = *provenance_from_string(node.at("provenance").one_of(known));
  }
  model.source = paragraph_or_empty(node, "source");
  return model;
}

void read_workloads(const YamlNode& node, Platform& platform) {
  auto known = workload_names();
  for (const auto& name : node.keys()) {
    if (is_workload(name)) known.push_back(name);
  }
  node.check_keys(known);
  for (const auto& name : node.keys()) {
    platform.workloads.emplace(name, read_workload(node.at(name), platform));
  }
}

/// All "unit.stage" of the platform: what `stage_scale` may name.
std::vector<std::string> stage_names(const Platform& platform) {
  std::set<std::string> names;
  for (const auto& [workload, model] : platform.workloads) {
    for (const auto& [unit, stages] : model.stages) {
      for (const auto& stage : stages) names.insert(unit + "." + stage.name);
    }
  }
  return {names.begin(), names.end()};
}

ModeDefaults read_mode(const YamlNode& node, const Platform& platform) {
  node.check_keys({"weights", "in_flight", "stage_scale"});
  ModeDefaults mode;
  if (node.has("weights")) {
    const auto weights = node.at("weights");
    bool any = false;
    for (const auto& unit : weights.keys()) {
      check_unit(weights.at(unit), unit, platform);
      mode.weights[unit] = static_cast<int>(weights.at(unit).integer(0, kMaxWeight));
      any |= mode.weights[unit] > 0;
    }
    if (!any) weights.fail("all weights are 0; give one unit at least 1");
  }
  if (node.has("in_flight")) {
    mode.in_flight = static_cast<int>(node.at("in_flight").integer(1, kMaxWeight));
  }
  if (node.has("stage_scale")) {
    const auto scales = node.at("stage_scale");
    scales.check_keys(stage_names(platform));
    for (const auto& stage : scales.keys()) {
      mode.stage_scale[stage] = scales.at(stage).number(1 / kMaxScale, kMaxScale);
    }
  }
  return mode;
}

}  // namespace

Platform read_platform(const YamlNode& document, std::span<const PhysicalCore> machine) {
  document.check_keys(
      {"platform", "description", "assumptions", "units", "links", "workloads", "modes"});
  Platform platform;
  platform.name = checked_name(document.at("platform"), document.at("platform").text());
  platform.description = paragraph_or_empty(document, "description");
  platform.assumptions = paragraph_or_empty(document, "assumptions");
  read_units(document.at("units"), machine, platform);
  if (document.has("links")) read_links(document.at("links"), platform);
  check_links(document.at("units"), platform);
  if (document.has("workloads")) read_workloads(document.at("workloads"), platform);
  if (document.has("modes")) {
    const auto modes = document.at("modes");
    for (const auto& name : modes.keys()) {
      platform.modes.emplace(checked_name(modes.at(name), name),
                             read_mode(modes.at(name), platform));
    }
  }
  return platform;
}

}  // namespace pirt
