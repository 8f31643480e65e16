#include "workloads/backends/fake/fake_script.h"

#include <array>
#include <functional>
#include <limits>
#include <tuple>

#include "workloads/base/text/yaml.h"

namespace pirt::fake {
namespace {

constexpr double kMinFactor = 1e-3;
constexpr double kMaxFactor = 1e3;
// In 1e9 a second; at the least of them, as many repeats as an int holds fit int64 nanoseconds.
constexpr double kMinRate = 1e-3;
constexpr double kMaxRate = 1e9;
constexpr std::int64_t kMaxCacheKb = 1'000'000'000;
constexpr std::int64_t kMaxCalls = 1'000'000'000'000;

Nanos duration(const YamlNode& node) { return node.milliseconds(0); }

template <typename Values>
std::vector<std::string> words_of(const Values& values) {
  std::vector<std::string> words;
  for (const auto value : values) words.emplace_back(to_string(value));
  return words;
}

ScriptedStage stage(const YamlNode& node) {
  node.check_keys({"name", "ms", "bound_ms"});
  ScriptedStage result;
  if (node.has("name")) {
    result.phase =
        *phase_from_string(node.at("name").one_of({"upload", "launch", "execute", "download"}));
  }
  std::tie(result.low, result.high) = node.at("ms").time_range();
  if (node.has("bound_ms")) {
    result.bound = duration(node.at("bound_ms"));
    if (*result.bound > result.low) node.fail("bound_ms is above ms");
  }
  return result;
}

void read_prepare(const YamlNode& node, Script& script) {
  if (!node.is_map()) {
    script.prepare_cold = script.prepare_warm = duration(node);
    return;
  }
  node.check_keys({"cold", "warm"});
  if (node.has("cold")) script.prepare_cold = duration(node.at("cold"));
  if (node.has("warm")) script.prepare_warm = duration(node.at("warm"));
}

void read_peaks(const YamlNode& node, Script& script) {
  node.check_keys(words_of(kAllPeakKinds));
  for (const std::string& key : node.keys()) {
    script.peaks[*peak_kind_from_string(key)] = 1e9 * node.at(key).number(kMinRate, kMaxRate);
  }
}

/// Reads a map from workload names to lists of @p item.
template <typename T>
std::map<std::string, std::vector<T>> lists(const YamlNode& node, T (*item)(const YamlNode&)) {
  std::map<std::string, std::vector<T>> result;
  for (const std::string& name : node.keys()) {
    auto& list = result[name];
    for (const YamlNode& each : node.at(name).items()) list.push_back(item(each));
    if (list.empty()) node.at(name).fail("must have at least one entry");
  }
  return result;
}

void read_factors(const YamlNode& node, Script& script) {
  for (const YamlNode& item : node.items()) {
    script.process_factors.push_back(item.number(kMinFactor, kMaxFactor));
  }
}

Accounting account(const YamlNode& node) {
  if (!node.is_map()) return {*provenance_from_string(node.one_of(words_of(kAllProvenances)))};
  node.check_keys({"unknown"});
  return {Provenance::kMeasured, node.at("unknown").text()};
}

void read_accounts(const YamlNode& node, Script& script) {
  auto phases = words_of(kAllPhases);
  std::erase(phases, to_string(Phase::kCall));
  node.check_keys(phases);
  for (const std::string& key : node.keys()) {
    script.accounts[*phase_from_string(key)] = account(node.at(key));
  }
}

void read_calls(const YamlNode& node, Script& script) {
  for (const std::string& name : node.keys()) {
    script.wrong_output_after[name] = node.at(name).integer(0, kMaxCalls);
  }
}

using NameList = std::set<std::string> Script::*;

const std::map<std::string, NameList, std::less<>>& name_lists() {
  static const std::map<std::string, NameList, std::less<>> all = {
      {"unsupported", &Script::unsupported},
      {"wrong_output", &Script::wrong_output},
      {"nan_output", &Script::nan_output},
      {"fail_prepare", &Script::fail_prepare},
      {"fail_execute", &Script::fail_execute},
      {"crash", &Script::crash},
      {"hang", &Script::hang}};
  return all;
}

using Reader = std::function<void(const YamlNode&, Script&)>;

Reader reader_of(NameList list) {
  return [list](const YamlNode& node, Script& script) {
    for (const YamlNode& item : node.items()) (script.*list).insert(item.text());
  };
}

std::map<std::string, Reader> readers() {
  std::map<std::string, Reader> all = {
      {"device", [](const auto& n, Script& s) { s.device = n.text(); }},
      {"reference_folder", [](const auto& n, Script& s) { s.reference_folder = n.text(); }},
      {"device_init_ms", [](const auto& n, Script& s) { s.device_init = duration(n); }},
      {"prepare_ms", read_prepare},
      {"stages", [](const auto& n, Script& s) { s.stages = lists<ScriptedStage>(n, stage); }},
      {"samples_ms", [](const auto& n, Script& s) { s.samples = lists<Nanos>(n, duration); }},
      {"process_factors", read_factors},
      {"peaks_g_s", read_peaks},
      {"cache_kb",
       [](const auto& n, Script& s) { s.cache_bytes = n.integer(1, kMaxCacheKb) * 1024; }},
      {"clock",
       [](const auto& n, Script& s) {
         s.wall_clock = n.one_of({"simulated", "wall"}) == "wall";
       }},
      {"accounts", read_accounts},
      {"deterministic", [](const auto& n, Script& s) { s.deterministic = n.boolean(); }},
      {"machine_ms", [](const auto& n, Script& s) { s.machine = duration(n); }},
      {"seed",
       [](const auto& n, Script& s) {
         s.seed =
             static_cast<std::uint64_t>(n.integer(0, std::numeric_limits<std::int64_t>::max()));
       }},
      {"fail_open", [](const auto& n, Script& s) { s.fail_open = n.text(); }},
      {"wrong_output_after", read_calls},
  };
  for (const auto& [key, list] : name_lists()) all.emplace(key, reader_of(list));
  return all;
}

}  // namespace

std::span<const ScriptedStage> Script::stages_of(const std::string& workload) const {
  // An array: a unit that hangs may still read it while the process ends.
  static const std::array<ScriptedStage, 4> kDefault = {
      {{Phase::kUpload, from_ms(0.1), from_ms(0.1)},
       {Phase::kLaunch, from_ms(0.01), from_ms(0.01)},
       {Phase::kExecute, from_ms(1), from_ms(1)},
       {Phase::kDownload, from_ms(0.1), from_ms(0.1)}}};
  const auto it = stages.find(workload);
  if (it == stages.end()) return kDefault;
  return it->second;
}

Script read_script(const YamlNode& node) {
  Script script;
  const auto known = readers();
  std::vector<std::string> keys;
  for (const auto& reader : known) keys.push_back(reader.first);
  node.check_keys(keys);
  for (const std::string& key : node.keys()) known.at(key)(node.at(key), script);
  if (script.wall_clock && !script.accounts.empty()) {
    node.fail("with clock: wall all phases are told by that clock; leave out accounts");
  }
  return script;
}

bool names_workloads(std::string_view key) {
  return key == "stages" || key == "samples_ms" || key == "wrong_output_after" ||
         name_lists().contains(key);
}

Script parse_script(const std::string& text) {
  return text.empty() ? Script() : read_script(parse_yaml("fake script", text));
}

}  // namespace pirt::fake
