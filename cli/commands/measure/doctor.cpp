// pirt doctor: what would spoil a measurement on this machine, and what to do about it.
#include "characterize/doctor/doctor.h"

#include <fmt/core.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <memory>

#include "characterize/machine/inherited.h"
#include "characterize/worker/job_runner.h"
#include "characterize/worker/scratch.h"
#include "cli/commands.h"
#include "cli/options/files.h"
#include "cli/options/output.h"
#include "cli/options/shipped.h"
#include "cli/options/values.h"
#include "reports/tools/doctor_report.h"
#include "workloads/backends/registry.h"
#include "workloads/base/error.h"
#include "workloads/base/text/json.h"

namespace pirt::cli {
namespace {

struct DoctorFlags {
  std::string platform = "host";
  double seconds = 1;
  std::optional<std::string> root;
  Output json;
};

/// A recorded machine: its files, nothing of this one.
DoctorInput recorded(const std::filesystem::path& root) {
  if (!std::filesystem::is_directory(root / "proc")) {
    throw_bad_input(
        fmt::format("--root '{}' has no folder proc; record a machine with: mkdir m && cp -r "
                    "--parents /proc/cpuinfo /proc/stat /sys/devices/system/cpu m",
                    root.string()));
  }
  DoctorInput input;
  input.root = root;
  input.cores = recorded_cores(root);
  input.before = read_doctor_snapshot(input.cores, root);
  return input;
}

DoctorInput this_machine(const DoctorFlags& options) {
  const Platform platform = load_platform(options.platform);
  DoctorInput input;
  input.cores = usable_cores();
  input.units = probe_units(platform, "/proc/self/exe");
  std::error_code removed;
  for (const auto& folder : {scratch_base(), std::filesystem::current_path(removed)}) {
    if (!folder.empty()) input.disks.push_back(free_space(folder));
  }
  input.inherited = inherited_environment();
  input.no_new_code = no_new_code(scratch_base());
  input.before = read_doctor_snapshot(input.cores);
  // Steal is counted of cores that want to compute only: so they do.
  input.jitter = measure_jitter(input.cores, Nanos(std::llround(options.seconds * 1e9)));
  input.after = read_doctor_snapshot(input.cores);
  input.devices = probe_backend("/proc/self/exe", find_backend("opencl")).devices;
  input.nvml = read_nvml();  // Last, since a board's driver may open it, with threads of its own.
  return input;
}

int doctor(const DoctorFlags& options) {
  DoctorInput input = options.root ? recorded(*options.root) : this_machine(options);
  input.build = build_environment();
  input.readable = [](const std::filesystem::path& path) {
    return ::access(path.c_str(), R_OK) == 0;
  };
  const auto findings = diagnose(input);
  auto json = doctor_json(findings);
  json["schema_version"] = 1;
  emit(render(doctor_document(findings), Format::kText), json, options.json);
  switch (verdict(findings)) {
    case Level::kBlocks:
      return kExitEnvironment;
    case Level::kSpoils:
      return kExitCheckFailed;
    default:
      return 0;
  }
}

}  // namespace

void add_doctor(CLI::App& app, Action& action) {
  auto options = std::make_shared<DoctorFlags>();
  Command command(app, "doctor",
                  "Say what would spoil a measurement on this machine, and what to do about it");
  add_input(command, "--platform", &options->platform,
            "Whose units are tried: a name of `pirt list platforms`, or a YAML file",
            FileUse::kReadIfFile)
      .offers(offer_platforms())
      .shows_default();
  add_value(command, "--seconds", &options->seconds, "NUMBER", not_within(1e-6, 3600.0),
            "How long load, steal, jitter and throttling are watched, in seconds; the cores "
            "compute meanwhile")
      .shows_default();
  add_input(command, "--root", &options->root,
            "Judge a recorded machine: a folder with copies of its /proc and /sys")
      .excludes(command.option("--platform"))
      .excludes(command.option("--seconds"));
  add_json(command, options->json);
  command.footer(
      "Exit codes: 0 nothing spoils a measurement, 1 something does, 4 no unit can be measured.\n"
      "Example: pirt doctor");
  command.runs(action, [options] { return doctor(*options); });
}

}  // namespace pirt::cli
