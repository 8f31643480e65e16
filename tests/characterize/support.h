// What the tests of characterize/ share: a temporary folder, small cells to store, fake platforms
// to measure.
#pragma once

#include <gtest/gtest.h>
#include <stdlib.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "characterize/campaign/campaign.h"
#include "characterize/platform/platform.h"
#include "characterize/profile/records.h"
#include "workloads/base/error.h"

namespace pirt::test {

class TemporaryFolder {
 public:
  TemporaryFolder() {
    std::string name = (std::filesystem::temp_directory_path() / "pirt-test-XXXXXX").string();
    if (::mkdtemp(name.data()) == nullptr) throw std::runtime_error("cannot make " + name);
    path_ = name;
  }
  ~TemporaryFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;
  [[nodiscard]] std::filesystem::path operator/(const std::string& name) const {
    return path_ / name;
  }
  [[nodiscard]] const std::filesystem::path& path() const { return path_; }
  [[nodiscard]] std::vector<std::string> entries() const {
    std::vector<std::string> names;
    for (const auto& entry : std::filesystem::directory_iterator(path_)) {
      names.push_back(entry.path().filename().string());
    }
    std::ranges::sort(names);
    return names;
  }

 private:
  std::filesystem::path path_;
};

inline std::string read_bytes(const std::filesystem::path& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
}

inline void write_bytes(const std::filesystem::path& path, const std::string& bytes) {
  std::ofstream(path, std::ios::binary) << bytes;
}

/// The message of the Error that @p action throws, which must have @p code.
template <typename Action>
std::string error_of(ErrorCode code, Action action) {
  try {
    static_cast<void>(action());
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), code) << error.what();
    return error.what();
  }
  ADD_FAILURE() << "no error was thrown";
  return "";
}

inline std::vector<Nanos> ramp(std::int64_t first, std::int64_t count) {
  std::vector<Nanos> samples;
  for (std::int64_t i = 0; i < count; ++i) samples.emplace_back(first + i);
  return samples;
}

inline RunHeader small_run(const std::string& platform = "board") {
  return {
      "2024-01-02T03:04:05Z",
      platform,
      18'446'744'073'709'551'615U,  // the largest seed: must survive
      {{"cpu_model", "test cpu"}},
      {{"cpu", "fake", "fake device", true, {0, 1}}, {"gpu", "fake", "other device", false, {}}}};
}

/// Rows prepare cold and call steady with samples from @p first_ns on.
inline CellRecord small_cell(const std::string& workload, const std::string& unit,
                             std::int64_t first_ns = 1000) {
  CellRecord cell{workload, unit, 42, 1000, "before timing: equal", {}, {}};
  cell.phases.push_back(
      {Phase::kPrepare, State::kCold, Provenance::kModelled, {}, {}, ramp(first_ns, 2)});
  cell.phases.push_back(
      {Phase::kCall, State::kSteady, Provenance::kModelled, {}, {"bimodal"}, ramp(first_ns, 20)});
  cell.energy = EnergyRecord{0.5, Provenance::kModelled, "model: active_w 1 W x call", {}};
  return cell;
}

/// A platform of fake units, each with its script.
inline Platform fake_platform(const std::vector<std::pair<std::string, std::string>>& scripts) {
  Platform platform;
  platform.name = "scripted";
  for (const auto& [name, script] : scripts) {
    UnitModel unit;
    unit.name = name;
    unit.role = role_from_string(name).value_or(Role::kOther);
    unit.backend = "fake";
    unit.active_w = 2;
    unit.script = script;
    platform.units.push_back(unit);
  }
  return platform;
}

}  // namespace pirt::test
