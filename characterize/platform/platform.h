// The units of one board: how fast, how many, how much power, what lies between them.
//
// A unit is either measured (it names a backend; its service times come from a profile database) or
// modelled (the platform file gives its service times as stages). Platform files are YAML; their
// semantics are exact and other tools check against them.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "characterize/statistics/distribution.h"
#include "workloads/base/text/yaml.h"
#include "workloads/base/time.h"
#include "workloads/model/phase.h"

namespace pirt {

/// One step of a unit's service: work on some unit's servers, or a pure delay.
struct Stage {
  std::string name;   ///< "host_setup", "kernel"; scaled by `stage_scale: {unit.name: x}`.
  std::string on;     ///< Unit whose servers it occupies; empty = delay.
  Distribution time;  ///< Server time at rate 1.
};

enum class Discipline : std::uint8_t {
  kFifo,              ///< Each server takes one job at a time, in order of arrival.
  kProcessorSharing,  ///< n jobs share k servers: each runs at rate min(1, k/n).
};

struct Link {
  std::string name;
  double mbit_s = 0;
  Distribution latency;
  double active_w = 0;
};

/// What Algorithms 1 to 4 speak of. A unit of another name than these is kOther unless the file
/// says what it is.
enum class Role : std::uint8_t { kCpu, kGpu, kDsp, kFpga, kCloud, kOther };
/// "cpu", "gpu", "dsp", "fpga", "cloud", "other".
[[nodiscard]] std::string_view to_string(Role role);
[[nodiscard]] std::optional<Role> role_from_string(std::string_view text);
[[nodiscard]] std::vector<std::string> role_names();

/// Of a unit that holds one program (a bitstream, a loaded module) at a time: a call of another one
/// than the last prepares it anew.
struct Contexts {
  std::optional<Nanos> prepare;  ///< What that takes; absent = the profile's warm `prepare`.
  /// Workloads of one program, by its name; each other one is a program of its own.
  std::map<std::string, std::vector<std::string>> programs = {};

  /// Which of `programs` has the workload; absent = one of its own.
  [[nodiscard]] std::optional<std::size_t> program_of(const std::string& workload) const;
};

/// The longest that a unit stays awake for its next call: less than waking up takes.
inline constexpr Nanos kMostSpin = std::chrono::microseconds(20);

struct UnitModel {
  std::string name;
  Role role = Role::kOther;
  int servers = 1;
  Discipline discipline = Discipline::kFifo;
  std::optional<int>
      slots;  ///< Tasks started and not complete; absent = 1 for one that computes, else no limit.
  double active_w = 0;               ///< Per busy server.
  double idle_w = 0;                 ///< Whether a run uses it or not.
  double held_w = 0;                 ///< Besides, while a run holds its device open.
  bool watts_of_host_cores = false;  ///< Of another device these figures say nothing; on_device.
  /// Which of these and of `energy` the user set: they are of whatever device it has.
  bool active_set = false, energy_set = false, idle_set = false, held_set = false;
  double op_pj = 0;    ///< Additional energy per operation of the workload.
  double byte_pj = 0;  ///< Additional energy per byte of the workload.
  double call_j = 0;   ///< Additional energy per call, whatever the workload.
  Provenance energy_provenance = Provenance::kModelled;  ///< Of these figures and active_w.
  std::string energy_source;  ///< Where they come from; empty = the platform's assumptions.
  std::string link;  ///< Name of the link that inputs and outputs travel over; empty = none.
  /// Units that name the same memory share it, with its bandwidth; empty = it shares none.
  std::string memory;
  /// What the workloads that are prepared on it may have together; absent = no limit.
  std::optional<std::int64_t> memory_limit_bytes = {};

  std::string backend;  ///< Measured unit: the backend's name; empty = modelled.
  std::vector<int>
      cores;  ///< Host cores that it owns; resolved to numbers when the platform is read.
  bool shares_cores = false;  ///< Another unit owns one of them too (one-core machines).
  std::string device;         ///< Which device of the backend, as choose_device() takes it.
  std::string script;  ///< Fake backend: its script, as YAML text; of others, their settings.
  std::map<std::string, double> options;  ///< Of the backend, those that the file gives.
  std::optional<Contexts> contexts;       ///< With one server and one slot; absent = holds all.
  /// Meters that its energy is read from: a name of `pirt list meters` or a sum "A + B"; "none" =
  /// the model; empty = the widest one that the machine has (energy/choice.h).
  std::string meter;
  Nanos spin = kMostSpin;  ///< How long it stays awake for the next call when it runs live.

  [[nodiscard]] bool measured() const { return !backend.empty(); }
  /// Drawn from a run's begin to its end.
  [[nodiscard]] double standing_w() const { return idle_w + held_w; }
};

/// What the platform file says about one workload on its modelled units.
struct WorkloadModel {
  std::map<std::string, std::vector<Stage>> stages;  ///< By unit.
  std::map<std::string, double> call_j;              ///< Joules a call, by unit.
  Provenance provenance = Provenance::kModelled;
  std::string source;
};

struct ModeDefaults {
  std::map<std::string, int> weights;  ///< By unit; empty = derive.
  std::optional<int> in_flight;        ///< Frames in flight of closed loops.
  std::map<std::string, double>
      stage_scale;  ///< "unit.stage" -> time factor; the stage's energy stays.
};

struct Platform {
  std::string name;
  std::string argument;  ///< What load_platform was given: the name, or a file. For messages.
  std::string text;      ///< The YAML that it was read from, with what was set besides.
  std::vector<std::string> settings;  ///< That: "cpu.active_w=15".
  std::string description;
  std::string assumptions;  ///< Printed beside modelled energy; e.g. where the watts come from.
  std::vector<UnitModel> units;  ///< In file order; ties between units break by it.
  std::map<std::string, Link> links;
  std::map<std::string, WorkloadModel> workloads;
  std::map<std::string, ModeDefaults> modes;
  bool watts_set = false;  ///< Some by the user: joules are an assumption, whatever the rest is.

  /// Null if there is none.
  [[nodiscard]] const UnitModel* find_unit(std::string_view unit) const;
  /// @throws Error{kBadInput} with the nearest names.
  [[nodiscard]] const UnitModel& unit(std::string_view unit) const;
  [[nodiscard]] std::vector<std::string> unit_names() const;
  /// The other units that share @p unit's memory, in file order.
  [[nodiscard]] std::vector<const UnitModel*> neighbours(const UnitModel& unit) const;
  /// Whether the file says anything of what the unit's calls draw, if only for one workload.
  [[nodiscard]] bool states_power(const UnitModel& unit) const;
};

/// The unit on the device that it turned out to have: watts of the host's cores, unless the user
/// set them or they were fitted, are none of a device of its own, and then nobody knows them.
[[nodiscard]] UnitModel on_device(UnitModel unit, bool device_is_cpu);
/// What to add where such a unit "states no power".
inline constexpr std::string_view kOfItsDevice = " of its device, only of the host's cores";

/// A shipped name, or a file if @p name contains '/' or ends in ".yaml".
/// @param overrides  Applied to `units` first: {"cpu.active_w", "15"} sets units.cpu.active_w.
/// @throws Error{kBadInput} with file:line; unknown shipped names come with the nearest ones.
[[nodiscard]] Platform load_platform(const std::string& name,
                                     const std::vector<YamlOverride>& overrides = {});
/// @param host_cores  Number of cores that "all", the halves, "all_but_two" and "last_two" are
/// taken of.
[[nodiscard]] Platform parse_platform(const std::string& file, const std::string& text,
                                      const std::vector<YamlOverride>& overrides, int host_cores);

/// What @p platform was read from with @p overrides applied, as YAML that load_platform reads again
/// (its comments are lost).
/// @throws Error{kBadInput} as load_platform.
[[nodiscard]] std::string platform_text(const Platform& platform,
                                        const std::vector<YamlOverride>& overrides);

[[nodiscard]] std::vector<std::string> shipped_platforms();
/// Of its text, which may lie anywhere.
[[nodiscard]] std::string platform_hash(const Platform& platform);
/// Cores that this process may run on.
[[nodiscard]] std::vector<int> usable_cores();
/// @p cores of a unit; all usable ones where its platform names none.
[[nodiscard]] std::vector<int> cores_or_usable(const std::vector<int>& cores);

/// "--set unit.key=value" -> override. @throws Error{kBadInput} if it is not of that form.
[[nodiscard]] YamlOverride parse_override(const std::string& text);
[[nodiscard]] std::vector<YamlOverride> parse_overrides(const std::vector<std::string>& texts);

/// Whether a command-line name means a file (contains '/' or ends in ".yaml") rather than something
/// shipped.
[[nodiscard]] bool names_a_file(std::string_view name);

}  // namespace pirt
