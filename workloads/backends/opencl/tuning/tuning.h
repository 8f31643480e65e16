// The free parameters of the kernels in one table: what may be chosen for a device, between which
// values, and what a device gets that was never tuned. `pirt tune` searches them
// (characterize/tune); tuning_file.h keeps what it found. Nothing here needs OpenCL.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace pirt::opencl {

enum class Parameter : std::uint8_t {
  kLocalX,
  kBlurStripRows,
  kFilterRows,
  kFilterStripRows,
  kSobelStripRows,
  kUndistortPixels,
  kFeaturePixels,
  kFlowRunX,
  kFlowRunY,
  kConvChannels,
  kConvPixels,
  kFcRows,
  kProductGroups,
};
inline constexpr std::size_t kParameters = 13;

/// Value of flow_run_x and flow_run_y: one run goes over the whole picture.
inline constexpr int kWholeRun = 0;
/// Value of conv_channels and conv_pixels: what suits the device's vectors (for_vectors).
inline constexpr int kByVectors = 0;

/// What a parameter may be on one kind of device; its kernels are right with each of them.
struct ParameterRange {
  int standard = 0;                 ///< Without tuning; one of the candidates.
  std::span<const int> candidates;  ///< Ascending; one where there is nothing to search.
};

struct ParameterInfo {
  Parameter parameter;
  std::string_view name;     ///< In files and tables: "conv_pixels".
  std::string_view meaning;  ///< One clause, with the unit that it counts.
  /// Workload::kernel of those whose launches depend on it; empty = of all. A sequence depends on
  /// what its layers do, and is not listed.
  std::vector<std::string_view> kernels;
  ParameterRange cpu;  ///< Devices that compute on the host's cores: few, long work items.
  ParameterRange gpu;  ///< All others: thousands of work items.
  /// Compile-time parameters: what the sources call it, and which ones do. Empty = an argument or
  /// an extent of the launch.
  std::string_view definition = {};
  std::vector<std::string_view> sources = {};

  [[nodiscard]] const ParameterRange& range(bool is_cpu) const { return is_cpu ? cpu : gpu; }
  /// Whether the launches of a workload with that kernel depend on it.
  [[nodiscard]] bool concerns(std::string_view kernel) const;
};

/// In the order of Parameter.
[[nodiscard]] std::span<const ParameterInfo> parameter_table();
[[nodiscard]] const ParameterInfo& info_of(Parameter parameter);
/// Null if there is none of that name.
[[nodiscard]] const ParameterInfo* find_parameter(std::string_view name);

/// A value for each parameter, for one kind of device.
class Tuning {
 public:
  /// The defaults.
  explicit Tuning(bool is_cpu);

  [[nodiscard]] bool is_cpu() const { return is_cpu_; }
  [[nodiscard]] int operator[](Parameter parameter) const {
    return values_[static_cast<std::size_t>(parameter)];
  }
  void set(Parameter parameter, int value) { values_[static_cast<std::size_t>(parameter)] = value; }

  [[nodiscard]] bool is_default(Parameter parameter) const;
  /// "default", or what differs from it in the table's order: "local_x=16, fc_rows=2".
  [[nodiscard]] std::string describe() const;
  friend bool operator==(const Tuning&, const Tuning&) = default;

 private:
  bool is_cpu_;
  std::array<int, kParameters> values_{};
};

/// The tuning with values in the place of kByVectors.
/// @param lanes  Floats of one of the device's vectors.
[[nodiscard]] Tuning for_vectors(Tuning tuning, int lanes);

/// Build options, each with a blank before it, of the parameters that @p source has as definitions:
/// " -DCONV_PIXELS=6". Sources that have none share their binaries whatever the tuning.
[[nodiscard]] std::string definitions_of(const Tuning& tuning, std::string_view source);

}  // namespace pirt::opencl
