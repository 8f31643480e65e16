#include "workloads/fake/fake_script.h"

#include <fmt/format.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cmath>
#include <functional>

#include "workloads/base/error.h"
#include "workloads/base/text.h"

namespace pirt::fake {
namespace {

constexpr double kLongestMs = 86'400'000;  // a day: longer is a slip of the pen

[[noreturn]] void fail(const YAML::Mark& mark, const std::string& message) {
  throw_bad_input(fmt::format("fake script:{}: {}", mark.line + 1, message));
}

[[noreturn]] void fail(const YAML::Node& node, const std::string& message) {
  fail(node.Mark(), message);
}

template <typename T>
T scalar(const YAML::Node& node, const char* wanted) {
  if (!node.IsScalar()) fail(node, fmt::format("expected {}", wanted));
  try {
    return node.as<T>();
  } catch (const YAML::Exception&) {
    fail(node, fmt::format("'{}' is not {}", node.Scalar(), wanted));
  }
}

Nanos duration(const YAML::Node& node) {
  const auto ms = scalar<double>(node, "a duration in ms");
  if (!std::isfinite(ms) || ms < 0 || ms > kLongestMs) {
    fail(node, fmt::format("'{}' ms is not within 0 and {} ms", node.Scalar(), kLongestMs));
  }
  return from_ms(ms);
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
  for (const auto& item : sequence(node)) result.insert(scalar<std::string>(item, "a name"));
  return result;
}

Phase stage_phase(const YAML::Node& node) {
  const std::vector<std::string> known = {"upload", "launch", "execute", "download"};
  const auto name = scalar<std::string>(node, "a stage name");
  const auto phase = phase_from_string(name);
  if (!phase || std::ranges::find(known, name) == known.end()) {
    fail(node, fmt::format("stage '{}' of a fake unit{}", name, suggestion(name, known)));
  }
  return *phase;
}

ScriptedStage stage(const YAML::Node& node) {
  ScriptedStage result;
  std::optional<YAML::Node> ms;
  for (const auto& entry : map(node)) {
    const auto key = scalar<std::string>(entry.first, "a key");
    if (key == "name") {
      result.phase = stage_phase(entry.second);
    } else if (key == "ms") {
      ms.emplace(entry.second);
    } else {
      fail(entry.first, fmt::format("unknown key '{}' of a stage (known: name, ms)", key));
    }
  }
  if (!ms) fail(node, "a stage needs ms");
  if (!ms->IsMap()) {
    result.low = result.high = duration(*ms);
    return result;
  }
  const YAML::Node uniform = (*ms)["uniform"];
  if (ms->size() != 1 || !uniform || !uniform.IsSequence() || uniform.size() != 2) {
    fail(*ms, "expected ms: 1.5 or ms: {uniform: [low, high]}");
  }
  result.low = duration(uniform[0]);
  result.high = duration(uniform[1]);
  if (result.high < result.low) fail(uniform, "uniform: [low, high] has high below low");
  return result;
}

void read_prepare(const YAML::Node& node, Script& script) {
  if (node.IsScalar()) {
    script.prepare_cold = script.prepare_warm = duration(node);
    return;
  }
  for (const auto& entry : map(node)) {
    const auto key = scalar<std::string>(entry.first, "a key");
    if (key != "cold" && key != "warm") {
      fail(entry.first, fmt::format("unknown key '{}' of prepare_ms (known: cold, warm)", key));
    }
    (key == "cold" ? script.prepare_cold : script.prepare_warm) = duration(entry.second);
  }
}

/// Reads a map from workload names to lists of @p item.
template <typename T>
std::map<std::string, std::vector<T>> lists(const YAML::Node& node, T (*item)(const YAML::Node&)) {
  std::map<std::string, std::vector<T>> result;
  for (const auto& entry : map(node)) {
    auto& list = result[scalar<std::string>(entry.first, "a workload's name")];
    for (const auto& element : sequence(entry.second)) list.push_back(item(element));
    if (list.empty()) fail(entry.second, "expected at least one entry");
  }
  return result;
}

void read_factors(const YAML::Node& node, Script& script) {
  for (const auto& element : sequence(node)) {
    const auto factor = scalar<double>(element, "a factor");
    if (!(factor > 0 && factor <= 1000)) fail(element, "expected a factor above 0, at most 1000");
    script.process_factors.push_back(factor);
  }
}

using Reader = std::function<void(const YAML::Node&, Script&)>;

Reader name_list(std::set<std::string> Script::*member) {
  return [member](const YAML::Node& node, Script& script) { script.*member = names(node); };
}

Reader text(std::string Script::*member) {
  return [member](const YAML::Node& node, Script& script) {
    script.*member = scalar<std::string>(node, "text");
  };
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
      {"seed", [](const auto& n, Script& s) { s.seed = scalar<std::uint64_t>(n, "a seed"); }},
      {"fail_open", [](const auto& n, Script& s) { s.fail_open = scalar<std::string>(n, "text"); }},
      {"wrong_output_after",
       [](const auto& n, Script& s) {
         for (const auto& entry : map(n)) {
           s.wrong_output_after[scalar<std::string>(entry.first, "a workload's name")] =
               scalar<std::int64_t>(entry.second, "a number of calls");
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

YAML::Node load(const std::string& yaml) {
  try {
    return YAML::Load(yaml);
  } catch (const YAML::Exception& error) {
    fail(error.mark, error.msg);
  }
}

}  // namespace

const std::vector<ScriptedStage>& Script::stages_of(const std::string& workload) const {
  static const std::vector<ScriptedStage> kDefault = {
      {Phase::kUpload, from_ms(0.1), from_ms(0.1)},
      {Phase::kLaunch, from_ms(0.01), from_ms(0.01)},
      {Phase::kExecute, from_ms(1), from_ms(1)},
      {Phase::kDownload, from_ms(0.1), from_ms(0.1)}};
  const auto it = stages.find(workload);
  return it == stages.end() ? kDefault : it->second;
}

Script parse_script(const std::string& yaml) {
  Script script;
  const YAML::Node root = load(yaml);
  if (root.IsNull()) return script;
  const auto known = readers();
  for (const auto& entry : map(root)) {
    const auto key = scalar<std::string>(entry.first, "a key");
    const auto it = known.find(key);
    if (it == known.end()) {
      std::vector<std::string> keys;
      keys.reserve(known.size());
      for (const auto& reader : known) keys.push_back(reader.first);
      fail(entry.first, fmt::format("unknown key '{}'{}", key, suggestion(key, keys)));
    }
    it->second(entry.second, script);
  }
  return script;
}

}  // namespace pirt::fake
