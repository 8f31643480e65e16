#include "workloads/backends/opencl/tuning/tuning_file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <string_view>

#include "workloads/base/error.h"
#include "workloads/base/text/json.h"
#include "workloads/base/text/text.h"

namespace pirt::opencl {
namespace {

constexpr int kSchemaVersion = 1;
constexpr const char* kVariable = "PIRT_TUNING";
constexpr const char* kNone = "none";

std::string variable(const char* name) {
  const char* value = std::getenv(name);
  return value == nullptr ? "" : value;
}

[[noreturn]] void refuse(const std::filesystem::path& path, const std::string& what) {
  throw_bad_input(fmt::format(
      "{}: {}; delete the file and run `pirt tune` again, or set PIRT_TUNING=none for the defaults",
      path.string(), what));
}

bool is_of(const TunedDevice& entry, const std::string& device, const std::string& platform,
           const std::string& version) {
  return entry.device == device && entry.platform == platform && entry.version == version;
}

int decode_value(const std::filesystem::path& path, const ParameterInfo& info, bool is_cpu,
                 const Json& value) {
  const auto& candidates = info.range(is_cpu).candidates;
  const bool known = value.is_number_integer() &&
                     std::ranges::find(candidates, value.get<std::int64_t>()) != candidates.end();
  if (!known) {
    refuse(path, fmt::format("{} is {}, which is none of {}", info.name, json_text(value),
                             fmt::join(candidates, ", ")));
  }
  return value.get<int>();
}

Tuning decode_parameters(const std::filesystem::path& path, bool is_cpu, const Json& values) {
  Tuning tuning(is_cpu);
  if (!values.is_object()) refuse(path, "\"parameters\" is no object");
  for (const auto& [name, value] : values.items()) {
    const ParameterInfo* info = find_parameter(name);
    if (info == nullptr) {
      std::vector<std::string> names;
      for (const ParameterInfo& known : parameter_table()) names.emplace_back(known.name);
      refuse(path, fmt::format("there is no parameter \"{}\"{}", name, suggestion(name, names)));
    }
    tuning.set(info->parameter, decode_value(path, *info, is_cpu, value));
  }
  return tuning;
}

TunedDevice decode_device(const std::filesystem::path& path, const Json& j) {
  TunedDevice entry;
  entry.device = j.at("device").get<std::string>();
  entry.platform = j.at("platform").get<std::string>();
  entry.version = j.at("version").get<std::string>();
  entry.pirt_version = j.at("pirt_version").get<std::string>();
  entry.date = j.at("date").get<std::string>();
  entry.tuning = decode_parameters(path, j.at("is_cpu").get<bool>(), j.at("parameters"));
  return entry;
}

/// Only what differs from the defaults: those of a later version then reach the device too.
Json encode(const TunedDevice& entry) {
  Json values = Json::object();
  for (const ParameterInfo& info : parameter_table()) {
    if (!entry.tuning.is_default(info.parameter)) {
      values[std::string(info.name)] = entry.tuning[info.parameter];
    }
  }
  return {{"device", entry.device},
          {"platform", entry.platform},
          {"version", entry.version},
          {"is_cpu", entry.tuning.is_cpu()},
          {"pirt_version", entry.pirt_version},
          {"date", entry.date},
          {"parameters", values}};
}

}  // namespace

const TunedDevice* TuningFile::find(const DeviceInfo& device) const {
  const auto it = std::ranges::find_if(devices, [&](const TunedDevice& entry) {
    return is_of(entry, device.name, device.platform, device.version);
  });
  return it == devices.end() ? nullptr : &*it;
}

void TuningFile::put(TunedDevice entry) {
  std::erase_if(devices, [&](const TunedDevice& old) {
    return is_of(old, entry.device, entry.platform, entry.version);
  });
  devices.push_back(std::move(entry));
}

std::optional<std::filesystem::path> tuning_path() {
  if (const std::string set = variable(kVariable); !set.empty()) {
    return set == kNone ? std::nullopt : std::optional<std::filesystem::path>(set);
  }
  // Relative folders are to be ignored, says the XDG Base Directory Specification.
  const std::filesystem::path config = variable("XDG_CONFIG_HOME");
  const std::filesystem::path in_folder = "pirt/opencl-tuning.json";
  if (config.is_absolute()) return config / in_folder;
  const std::filesystem::path home = variable("HOME");
  if (home.is_absolute()) return home / ".config" / in_folder;
  return std::nullopt;
}

TuningFile parse_tuning(const std::filesystem::path& path, const std::string& text) {
  try {
    const Json j = parse_json(text);
    // Compared as it is written: 1.5 would become 1, and 1e300 anything.
    if (const Json& version = j.at("schema_version"); version != kSchemaVersion) {
      refuse(path, fmt::format("it has schema version {}, and this pirt knows {}",
                               json_text(version), kSchemaVersion));
    }
    TuningFile file;
    if (!j.at("devices").is_array()) refuse(path, "\"devices\" is no list");
    for (const Json& entry : j.at("devices")) {
      TunedDevice device = decode_device(path, entry);
      if (std::ranges::any_of(file.devices, [&](const TunedDevice& other) {
            return is_of(other, device.device, device.platform, device.version);
          })) {
        refuse(path, fmt::format("it has \"{}\" twice", device.device));
      }
      file.devices.push_back(std::move(device));
    }
    return file;
  } catch (const JsonError& error) {
    refuse(path, fmt::format("it is no whole file of tuned parameters ({})", error.reason()));
  }
}

std::string tuning_text(const TuningFile& file) {
  Json devices = Json::array();
  for (const TunedDevice& entry : file.devices) devices.push_back(encode(entry));
  const Json j = {{"schema_version", kSchemaVersion}, {"devices", devices}};
  // Drivers' texts need not be UTF-8.
  return json_text(j, 2) + "\n";
}

TuningFile load_tuning(const std::filesystem::path& path) {
  std::error_code failed;
  const auto status = std::filesystem::status(path, failed);
  if (status.type() == std::filesystem::file_type::not_found) return {};
  if (failed || ::faccessat(AT_FDCWD, path.c_str(), R_OK, AT_EACCESS) != 0) {
    throw_bad_input(
        fmt::format("cannot read the tuned parameters in {}: {}; make it readable (HOME may be "
                    "another user's), "
                    "or set PIRT_TUNING to a file of yours, or to none for the defaults",
                    path.string(), failed ? failed.message() : std::strerror(errno)));
  }
  return parse_tuning(path, read_text(path));
}

TuningFile load_tuning() {
  const auto path = tuning_path();
  if (!path) return {};
  std::error_code failed;
  if (!variable(kVariable).empty() && !std::filesystem::exists(*path, failed) && !failed) {
    throw_bad_input(fmt::format(
        "PIRT_TUNING names {}, which is not there; make it with: pirt tune --output {}, or set "
        "PIRT_TUNING=none for the defaults",
        path->string(), path->string()));
  }
  return load_tuning(*path);
}

Tuning tuning_for(const DeviceInfo& device) {
  const TuningFile file = load_tuning();
  const TunedDevice* entry = file.find(device);
  if (entry == nullptr) return Tuning(device.is_cpu);
  if (entry->tuning.is_cpu() != device.is_cpu) {
    refuse(tuning_path().value_or(""),
           fmt::format("\"is_cpu\" of \"{}\" is not what the device says", device.name));
  }
  return entry->tuning;
}

}  // namespace pirt::opencl
