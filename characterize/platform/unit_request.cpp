#include "characterize/platform/unit_request.h"

#include <fmt/core.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <array>

#include "workloads/base/error.h"

namespace pirt {
namespace {

constexpr std::string_view kFake = "fake";

/// Six decimals of a millisecond are a nanosecond: nothing is lost.
std::string ms_text(Nanos t) { return fmt::format("{:.6f}", to_ms(t)); }

YAML::Node stage_node(const Stage& stage, const std::string& where) {
  constexpr std::array<std::string_view, 4> kPhases = {"upload", "launch", "execute", "download"};
  const std::string name = stage.name.empty() ? "execute" : stage.name;
  if (std::ranges::find(kPhases, name) == kPhases.end()) {
    throw_bad_input(
        fmt::format("{}: stage '{}' of a fake unit is no phase; call it upload, launch, "
                    "execute or download",
                    where, name));
  }
  YAML::Node node;
  node["name"] = name;
  if (stage.time.kind == Distribution::Kind::kConstant) {
    node["ms"] = ms_text(stage.time.low);
  } else {
    node["ms"]["uniform"].push_back(ms_text(stage.time.low));
    node["ms"]["uniform"].push_back(ms_text(stage.time.high));
  }
  return node;
}

/// The unit's script with the platform's stages for it.
std::string fake_script(const Platform& platform, const UnitModel& unit,
                        const std::string& reference_folder) {
  YAML::Node script;
  try {
    script = YAML::Load(unit.script);
    if (script.IsNull()) script = YAML::Node(YAML::NodeType::Map);
    for (const auto& [workload, model] : platform.workloads) {
      const auto stages = model.stages.find(unit.name);
      if (stages == model.stages.end() || (script["stages"] && script["stages"][workload]))
        continue;
      const std::string where =
          fmt::format("platform {}: {}.{}", platform.name, workload, unit.name);
      for (const Stage& stage : stages->second) {
        script["stages"][workload].push_back(stage_node(stage, where));
      }
    }
    if (!reference_folder.empty()) script["reference_folder"] = reference_folder;
    return YAML::Dump(script);
  } catch (const YAML::Exception& error) {
    throw_bad_input(fmt::format("platform {}: units.{}.script: {}; give a map", platform.name,
                                unit.name, error.what()));
  }
}

}  // namespace

UnitRequest make_unit_request(const Platform& platform, const UnitModel& unit,
                              const std::string& reference_folder) {
  UnitRequest request{unit.name, unit.cores, unit.device, unit.script, unit.options};
  if (unit.backend == kFake) request.script = fake_script(platform, unit, reference_folder);
  return request;
}

}  // namespace pirt
