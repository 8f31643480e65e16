#include "characterize/campaign/run_facts.h"

#include <fmt/chrono.h>
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <ctime>
#include <vector>

#include "characterize/energy/nvml.h"
#include "characterize/machine/inherited.h"
#include "characterize/profile/profile.h"
#include "characterize/worker/measure.h"
#include "workloads/backends/backend_list.h"
#include "workloads/base/hash.h"
#include "workloads/base/system/affinity.h"
#include "workloads/base/system/caches.h"
#include "workloads/base/system/module.h"
#include "workloads/base/text/text.h"

namespace pirt {
namespace {

/// All that the backend has, given or not: "clock_mhz=500, launch_us=300"; empty if it has none.
std::string describe_options(const UnitModel& unit) {
  UnitRequest request;
  request.options = unit.options;
  std::vector<std::string> parts;
  for (const OptionSpec& option : options_of(unit.backend)) {
    parts.push_back(fmt::format("{}={}", option.name, request.option(option)));
  }
  return join(parts, ", ");
}

/// Of what the program computes with: what a commit does not say of what was built with changes.
std::string program_hash(const std::filesystem::path& program) {
  Hash64 hash;
  for (const auto& file : program_files(program)) hash.add(read_file(file, kAnySize));
  return fmt::format("{:016x}", hash.value());
}

}  // namespace

std::string utc_now() {
  return fmt::format("{:%Y-%m-%dT%H:%M:%SZ}", fmt::gmtime(std::time(nullptr)));
}

Environment run_facts(const Platform& platform, const ImageSource& images,
                      const std::filesystem::path& program) {
  Environment facts = host_environment();
  facts.merge(build_environment());
  facts.merge(inherited_environment());
  facts["cores_usable"] = fmt::format("{}", fmt::join(usable_cores(), ","));
  const ClockQuality clock = measure_clock(MachineClock());
  facts["clock_cost_ns"] = fmt::format("{:.1f}", clock.cost_ns);
  facts["clock_resolution_ns"] = std::to_string(clock.resolution.count());
  facts["images"] = images.describe();
  facts["images_hash"] = fmt::format("{:016x}", images.content_hash());
  facts["program_hash"] = program_hash(program);
  facts["platform_hash"] = platform_hash(platform);
  if (!platform.assumptions.empty()) facts["assumptions"] = platform.assumptions;
  return facts;
}

UnitRecord unit_record(const UnitModel& unit, const DeviceInfo& device) {
  return {unit.name, unit.backend, device.name.empty() ? "unnamed" : device.name, device.is_cpu,
          unit.cores};
}

Environment unit_facts(const UnitModel& unit, const DeviceInfo& device) {
  Environment facts;
  const std::string prefix = "unit." + unit.name + ".";
  if (!device.platform.empty()) facts[prefix + "platform"] = device.platform;
  if (!device.version.empty()) facts[prefix + "version"] = device.version;
  if (!device.tuning.empty()) facts[prefix + "tuning"] = device.tuning;
  if (!device.remark.empty()) facts[prefix + "remark"] = device.remark;
  if (!device.pci.empty()) {
    facts[prefix + "pci"] = device.pci;
    for (const auto& [name, value] : board_settings(device.pci)) facts[prefix + name] = value;
  }
  const std::string options = describe_options(unit);
  if (!options.empty()) facts[prefix + "options"] = options;
  if (device.cache_bytes) facts[prefix + "cache_bytes"] = std::to_string(*device.cache_bytes);
  if (device.is_cpu) {
    const auto cores = cores_or_usable(unit.cores);
    const auto put = [&](std::string_view fact, const std::optional<std::int64_t>& bytes) {
      if (bytes) facts[prefix + std::string(fact)] = std::to_string(*bytes);
    };
    put(kOwnCacheBytes, own_cache_bytes(cores));
    put(kLastCacheBytes, reached_cache_bytes(cores));
  }
  return facts;
}

}  // namespace pirt
