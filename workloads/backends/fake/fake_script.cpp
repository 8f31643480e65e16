#include "workloads/backends/fake/fake_script.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <functional>
#include <limits>

#include "workloads/base/error.h"
#include "workloads/base/text/numbers.h"
#include "workloads/base/text/printable.h"
#include "workloads/base/text/text.h"

namespace pirt::fake {
namespace {

constexpr double kMinFactor = 1e-3;
constexpr double kMaxFactor = 1e3;
// In 1e9 a second; at the least of them, as many repeats as an int holds fit int64 nanoseconds.
constexpr double kMinRate = 1e-3;
constexpr double kMaxRate = 1e9;
constexpr std::int64_t kMaxCacheKb = 1'000'000'000;
constexpr std::int64_t kMaxCalls = 1'000'000'000'000;
constexpr std::uint64_t kMaxSeed = std::numeric_limits<std::uint64_t>::max();

[[noreturn]] void fail(const YAML::Node& node, const std::string& message) {
  throw ScriptError(node, message);
}

std::string text_of(const YAML::Node& node, const char* wanted) {
  if (!node.IsScalar()) fail(node, fmt::format("expected {}", wanted));
  const auto found = find_unprintable(node.Scalar());
  if (found) fail(node, fmt::format("{} must be one line of text", wanted));
  return node.Scalar();
}

/// @param read  Of the node's text.
template <typename T>
T number_of(const YAML::Node& node, const char* what, const NumberRead<T>& read) {
  if (!node.IsScalar() || node.Tag() == "!") fail(node, fmt::format("expected {}", what));
  if (!read.value) fail(node, fmt::format("{} {}", what, read.problem));
  return *read.value;
}

template <typename T>
T whole(const YAML::Node& node, const char* what, T low, T high) {
  return number_of(node, what, whole_number(node.Scalar(), low, high));
}

double decimal(const YAML::Node& node, const char* what, double low, double high) {
  return number_of(node, what, decimal_number(node.Scalar(), low, high));
}

Nanos duration(const YAML::Node& node) {
  return number_of(node, "a duration in ms", milliseconds(node.Scalar(), 0, kLongestMs));
}

const YAML::Node& sequence(const YAML::Node& node) {
  if (!node.IsSequence()) fail(node, "expected a list in [ ]");
  return node;
}

const YAML::Node& map(const YAML::Node& node) {
  if (!node.IsMap()) fail(node, "expected a map in { }");
  return node;
}

std::set<std::string> names(const YAML::Node& node) {
  std::set<std::string> result;
  for (const auto& item : sequence(node)) result.insert(text_of(item, "a name"));
  return result;
}

Phase stage_phase(const YAML::Node& node) {
  const std::vector<std::string> known = {"upload", "launch", "execute", "download"};
  const auto name = text_of(node, "a stage name");
  const auto phase = phase_from_string(name);
  if (!phase || std::ranges::find(known, name) == known.end()) {
    fail(node, fmt::format("stage '{}' of a fake unit{}", name, suggestion(name, known)));
  }
  return *phase;
}

void read_times(const YAML::Node& ms, ScriptedStage& result) {
  if (!ms.IsMap()) {
    result.low = result.high = duration(ms);
    return;
  }
  const YAML::Node uniform = ms["uniform"];
  if (ms.size() != 1 || !uniform || !uniform.IsSequence() || uniform.size() != 2) {
    fail(ms, "expected ms: 1.5 or ms: {uniform: [low, high]}");
  }
  result.low = duration(uniform[0]);
  result.high = duration(uniform[1]);
  if (result.high < result.low) fail(uniform, "uniform: [low, high] has high below low");
}

ScriptedStage stage(const YAML::Node& node) {
  ScriptedStage result;
  std::optional<YAML::Node> ms;
  for (const auto& entry : map(node)) {
    const auto key = text_of(entry.first, "a key");
    if (key == "name") {
      result.phase = stage_phase(entry.second);
    } else if (key == "ms") {
      ms.emplace(entry.second);
    } else if (key == "bound_ms") {
      result.bound = duration(entry.second);
    } else {
      fail(entry.first,
           fmt::format("unknown key '{}' of a stage (known: name, ms, bound_ms)", key));
    }
  }
  if (!ms) fail(node, "a stage needs ms");
  read_times(*ms, result);
  if (result.bound.value_or(Nanos(0)) > result.low) fail(node, "bound_ms is above ms");
  return result;
}

void read_prepare(const YAML::Node& node, Script& script) {
  if (node.IsScalar()) {
    script.prepare_cold = script.prepare_warm = duration(node);
    return;
  }
  for (const auto& entry : map(node)) {
    const auto key = text_of(entry.first, "a key");
    if (key != "cold" && key != "warm") {
      fail(entry.first, fmt::format("unknown key '{}' of prepare_ms (known: cold, warm)", key));
    }
    (key == "cold" ? script.prepare_cold : script.prepare_warm) = duration(entry.second);
  }
}

void read_peaks(const YAML::Node& node, Script& script) {
  std::vector<std::string> known;
  for (const PeakKind kind : kAllPeakKinds) known.emplace_back(to_string(kind));
  for (const auto& entry : map(node)) {
    const auto key = text_of(entry.first, "a key");
    const auto kind = peak_kind_from_string(key);
    if (!kind) {
      fail(entry.first,
           fmt::format("unknown key '{}' of peaks_g_s{}", key, suggestion(key, known)));
    }
    script.peaks[*kind] = 1e9 * decimal(entry.second, "a rate in 1e9 a second", kMinRate, kMaxRate);
  }
}

/// Reads a map from workload names to lists of @p item.
template <typename T>
std::map<std::string, std::vector<T>> lists(const YAML::Node& node, T (*item)(const YAML::Node&)) {
  std::map<std::string, std::vector<T>> result;
  for (const auto& entry : map(node)) {
    auto& list = result[text_of(entry.first, "a workload's name")];
    for (const auto& element : sequence(entry.second)) list.push_back(item(element));
    if (list.empty()) fail(entry.second, "expected at least one entry");
  }
  return result;
}

void read_factors(const YAML::Node& node, Script& script) {
  for (const auto& element : sequence(node)) {
    script.process_factors.push_back(decimal(element, "a factor", kMinFactor, kMaxFactor));
  }
}

Accounting account(const YAML::Node& node) {
  if (node.IsMap()) {
    const YAML::Node why = node["unknown"];
    if (node.size() != 1 || !why) fail(node, "expected {unknown: why}");
    return {Provenance::kMeasured, text_of(why, "a reason")};
  }
  std::vector<std::string> known;
  for (const Provenance each : kAllProvenances) known.emplace_back(to_string(each));
  const auto word = text_of(node, "a provenance");
  const auto provenance = provenance_from_string(word);
  if (!provenance) {
    fail(node, fmt::format("there is no provenance '{}'{}", word, suggestion(word, known)));
  }
  return {*provenance};
}

void read_accounts(const YAML::Node& node, Script& script) {
  std::vector<std::string> known;
  for (const Phase phase : kAllPhases) {
    if (phase != Phase::kCall) known.emplace_back(to_string(phase));
  }
  for (const auto& entry : map(node)) {
    const auto key = text_of(entry.first, "a phase");
    const auto phase = phase_from_string(key);
    if (!phase || phase == Phase::kCall) {
      fail(entry.first,
           fmt::format("there is no phase '{}' to account for{}", key, suggestion(key, known)));
    }
    script.accounts[*phase] = account(entry.second);
  }
}

bool truth(const YAML::Node& node) {
  const auto word = text_of(node, "true or false");
  if (word != "true" && word != "false") fail(node, "expected true or false");
  return word == "true";
}

void read_clock(const YAML::Node& node, Script& script) {
  const std::vector<std::string> known = {"simulated", "wall"};
  const auto clock = text_of(node, "a clock");
  if (std::ranges::find(known, clock) == known.end()) {
    fail(node, fmt::format("there is no clock '{}'{}", clock, suggestion(clock, known)));
  }
  script.wall_clock = clock == "wall";
}

using Reader = std::function<void(const YAML::Node&, Script&)>;

Reader name_list(std::set<std::string> Script::*member) {
  return [member](const YAML::Node& node, Script& script) { script.*member = names(node); };
}

Reader text(std::string Script::*member) {
  return
      [member](const YAML::Node& node, Script& script) { script.*member = text_of(node, "text"); };
}

std::map<std::string, Reader> readers() {
  return {
      {"device", text(&Script::device)},
      {"reference_folder", text(&Script::reference_folder)},
      {"device_init_ms", [](const auto& n, Script& s) { s.device_init = duration(n); }},
      {"prepare_ms", read_prepare},
      {"stages", [](const auto& n, Script& s) { s.stages = lists<ScriptedStage>(n, stage); }},
      {"samples_ms", [](const auto& n, Script& s) { s.samples = lists<Nanos>(n, duration); }},
      {"process_factors", read_factors},
      {"peaks_g_s", read_peaks},
      {"cache_kb",
       [](const auto& n, Script& s) {
         s.cache_bytes = whole(n, "a size in kB", std::int64_t{1}, kMaxCacheKb) * 1024;
       }},
      {"clock", read_clock},
      {"accounts", read_accounts},
      {"deterministic", [](const auto& n, Script& s) { s.deterministic = truth(n); }},
      {"machine_ms", [](const auto& n, Script& s) { s.machine = duration(n); }},
      {"seed",
       [](const auto& n, Script& s) { s.seed = whole(n, "a seed", std::uint64_t{0}, kMaxSeed); }},
      {"fail_open", [](const auto& n, Script& s) { s.fail_open = text_of(n, "text"); }},
      {"wrong_output_after",
       [](const auto& n, Script& s) {
         for (const auto& entry : map(n)) {
           s.wrong_output_after[text_of(entry.first, "a workload's name")] =
               whole(entry.second, "a number of calls", std::int64_t{0}, kMaxCalls);
         }
       }},
      {"unsupported", name_list(&Script::unsupported)},
      {"wrong_output", name_list(&Script::wrong_output)},
      {"nan_output", name_list(&Script::nan_output)},
      {"fail_prepare", name_list(&Script::fail_prepare)},
      {"fail_execute", name_list(&Script::fail_execute)},
      {"crash", name_list(&Script::crash)},
      {"hang", name_list(&Script::hang)},
  };
}

[[noreturn]] void fail_at(const YAML::Mark& mark, const std::string& message) {
  throw_bad_input(fmt::format("fake script:{}: {}", mark.line + 1, message));
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

Script read_script(const YAML::Node& root) {
  Script script;
  if (root.IsNull()) return script;
  const auto known = readers();
  for (const auto& entry : map(root)) {
    const auto key = text_of(entry.first, "a key");
    const auto it = known.find(key);
    if (it == known.end()) {
      std::vector<std::string> keys;
      keys.reserve(known.size());
      for (const auto& reader : known) keys.push_back(reader.first);
      fail(entry.first, fmt::format("unknown key '{}'{}", key, suggestion(key, keys)));
    }
    it->second(entry.second, script);
  }
  if (script.wall_clock && !script.accounts.empty()) {
    fail(root, "with clock: wall all phases are told by that clock; leave out accounts");
  }
  return script;
}

Script parse_script(const std::string& yaml) {
  try {
    return read_script(YAML::Load(yaml));
  } catch (const ScriptError& error) {
    fail_at(error.node().Mark(), error.what());
  } catch (const YAML::Exception& error) {
    fail_at(error.mark, error.msg);
  }
}

}  // namespace pirt::fake
