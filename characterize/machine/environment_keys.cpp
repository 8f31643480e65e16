#include "characterize/machine/environment_keys.h"

#include <algorithm>
#include <array>

namespace pirt {
namespace {

constexpr auto kIdentity = FactKind::kIdentity;
constexpr auto kInformation = FactKind::kInformation;
constexpr std::string_view kUnknown = "_unknown";
constexpr std::string_view kUnitPrefix = "unit.";

// Identity is what decides how fast unchanged code runs. What describes the moment (load, heat) or
// the program under test (commit) must be free to differ: it is what runs are compared across.
constexpr std::array kKeys = {
    // The run's own fields and its units.
    EnvironmentKey{"platform", kIdentity, "it says which units there are and which cores they own"},
    EnvironmentKey{"seed", kIdentity, "inputs and weights are made from it"},
    EnvironmentKey{"unit.*.backend", kIdentity, "another backend computes with other kernels"},
    EnvironmentKey{"unit.*.device", kIdentity, "it is what was measured"},
    EnvironmentKey{"unit.*.cores", kIdentity, "the unit computes on them"},
    EnvironmentKey{"unit.*.platform", kIdentity, "another driver is another implementation"},
    EnvironmentKey{"unit.*.version", kIdentity, "drivers and libraries bring the kernels' speed"},
    EnvironmentKey{"unit.*.tuning", kIdentity,
                   "other parameters make other launches of the kernels"},
    EnvironmentKey{"unit.*.options", kIdentity, "the backend computes its figures with them"},
    EnvironmentKey{"unit.*.cache_bytes", kIdentity, "it decides which data stay near the unit"},
    // The machine.
    EnvironmentKey{"cpu_model", kIdentity, "it executes the host's part of every unit"},
    EnvironmentKey{"cpu_flags", kIdentity, "libraries choose their kernels by them"},
    EnvironmentKey{"cores_online", kIdentity, "units own shares of them"},
    EnvironmentKey{"smt", kIdentity, "siblings share a core's arithmetic"},
    EnvironmentKey{"l2_cache_kb", kIdentity, "virtual machines show one model with several sizes"},
    EnvironmentKey{"last_cache_kb", kIdentity,
                   "virtual machines show one model with several sizes"},
    EnvironmentKey{"cpu_max_mhz", kIdentity, "a lowered limit slows everything down"},
    EnvironmentKey{"governor", kIdentity, "it decides the clock"},
    EnvironmentKey{"energy_preference", kIdentity, "it decides the clock under some drivers"},
    EnvironmentKey{"turbo", kIdentity, "it decides the clock"},
    EnvironmentKey{"hypervisor", kIdentity, "a guest's page tables and interrupts cost more"},
    EnvironmentKey{"cpu_quota", kIdentity, "a group that has used its share waits"},
    EnvironmentKey{"huge_pages", kIdentity, "they decide what address translation costs"},
    EnvironmentKey{"kernel", kIdentity, "it holds drivers, the clock's control and mitigations"},
    EnvironmentKey{"power_mode.*", kIdentity, "a board of 15 W and one of 30 W are two machines"},
    EnvironmentKey{"unit.*.power_limit_w", kIdentity, "a board slows down at its limit"},
    EnvironmentKey{"unit.*.core_mhz", kIdentity, "somebody set the board's clock"},
    EnvironmentKey{"unit.*.memory_mhz", kIdentity, "somebody set the clock of its memory"},
    EnvironmentKey{"unit.*.ecc", kIdentity, "it takes a part of the memory's rate"},
    // What the process has from who started it; absent where that is nothing.
    EnvironmentKey{"env.*", kIdentity, "libraries and drivers choose kernels and threads by it"},
    EnvironmentKey{"scheduling", kIdentity, "it decides when the process gets a core"},
    // The build.
    EnvironmentKey{"compiler", kIdentity, "it made the machine code of the same source"},
    EnvironmentKey{"compiler_flags", kIdentity, "they change the machine code of the same source"},
    EnvironmentKey{"build_type", kIdentity, "an unoptimized build is slower by itself"},
    EnvironmentKey{"sanitizers", kIdentity, "instrumented code is slower by itself"},
    // The inputs.
    EnvironmentKey{"images_hash", kIdentity, "some workloads' work depends on the data"},
    EnvironmentKey{"precision", kIdentity, "it decides how sure a median has to be"},

    EnvironmentKey{"unit.*.own_cache_bytes", kInformation,
                   "what rows of cold_cache found full of other bytes"},
    EnvironmentKey{"unit.*.last_cache_bytes", kInformation, "the same of rows of cold_memory"},
    EnvironmentKey{"unit.*.pci", kInformation, "the slot is not the device"},
    EnvironmentKey{"images", kInformation,
                   "where the pictures lie; images_hash says what they are"},
    EnvironmentKey{"pirt_version", kInformation, "versions are what one compares"},
    EnvironmentKey{"git_commit", kInformation, "commits are what one compares"},
    EnvironmentKey{"git_dirty", kInformation, "as git_commit"},
    EnvironmentKey{"program_hash", kInformation, "programs are what one compares"},
    EnvironmentKey{"platform_hash", kInformation, "what decides of it has keys of its own"},
    EnvironmentKey{"sqlite_version", kInformation, "nothing is stored while something is timed"},
    EnvironmentKey{"libc_version", kInformation, "kernels hardly call it"},
    EnvironmentKey{"machine", kInformation, "the board's name; its parts have keys of their own"},
    EnvironmentKey{"os", kInformation, "kernel and libraries have keys of their own"},
    EnvironmentKey{"clock_source", kInformation, "clock_cost_ns says what it comes to"},
    EnvironmentKey{"clock_cost_ns", kInformation, "samples are long enough not to show it"},
    EnvironmentKey{"clock_resolution_ns", kInformation, "samples are long enough not to show it"},
    EnvironmentKey{"memory_mb", kInformation, "workloads use a small part; it varies with kernels"},
    EnvironmentKey{"swap_used_mb", kInformation, "it describes the moment"},
    EnvironmentKey{"cpufreq_driver", kInformation, "governor and turbo say what it does"},
    EnvironmentKey{"cores_usable", kInformation, "a unit's cores have a key of their own"},
    EnvironmentKey{"cores_remark", kInformation, "a unit's cores have a key of their own"},
    EnvironmentKey{"load_1m", kInformation, "it describes the moment"},
    EnvironmentKey{"temperature_c", kInformation, "it describes the moment"},
    EnvironmentKey{"steal_percent", kInformation, "since the machine started"},
    EnvironmentKey{"end.load_1m", kInformation, "it describes the moment, after the last cell"},
    EnvironmentKey{"end.temperature_c", kInformation,
                   "it describes the moment, after the last cell"},
    EnvironmentKey{"run.steal_percent", kInformation, "of the run itself"},
    EnvironmentKey{"run.quota_wait_ms", kInformation, "of the run itself"},
    EnvironmentKey{"run.heat_events", kInformation, "of the run itself"},
    EnvironmentKey{"run.spent_s", kInformation, "of the run itself, until its last process"},
    EnvironmentKey{"mode", kInformation, "it decides how long one samples, not what"},
    EnvironmentKey{"filter", kInformation, "it decides which cells there are"},
    EnvironmentKey{"command", kInformation, "what of it matters is a fact of its own"},
    EnvironmentKey{"meter.*", kInformation, "each energy says its own source and domain"},
    EnvironmentKey{"assumptions", kInformation, "each energy says what it was computed from"},
};

/// Whether @p key is @p pattern, whose '*' stands for one or more characters.
bool matches(std::string_view pattern, std::string_view key) {
  const auto star = pattern.find('*');
  if (star == std::string_view::npos) return pattern == key;
  const auto head = pattern.substr(0, star);
  const auto tail = pattern.substr(star + 1);
  return key.size() > head.size() + tail.size() && key.starts_with(head) && key.ends_with(tail);
}

}  // namespace

std::string_view to_string(FactKind kind) { return kind == kIdentity ? "identity" : "information"; }

std::span<const EnvironmentKey> environment_keys() { return kKeys; }

std::string_view without_unknown(std::string_view key) {
  if (key.ends_with(kUnknown)) key.remove_suffix(kUnknown.size());
  return key;
}

const EnvironmentKey* find_environment_key(std::string_view key) {
  const std::string_view fact = without_unknown(key);
  const auto* found =
      std::ranges::find_if(kKeys, [&](const EnvironmentKey& k) { return matches(k.key, fact); });
  return found == kKeys.end() ? nullptr : found;
}

FactKind fact_kind(std::string_view key) {
  const auto* found = find_environment_key(key);
  return found == nullptr ? kInformation : found->kind;
}

std::string unit_of_key(std::string_view key) {
  if (!key.starts_with(kUnitPrefix)) return "";
  key.remove_prefix(kUnitPrefix.size());
  return std::string(key.substr(0, key.rfind('.')));
}

}  // namespace pirt
