#include "workloads/backends/opencl/tuning/tuning.h"

#include <fmt/core.h>

#include <algorithm>
#include <cassert>

#include "workloads/base/text/text.h"

namespace pirt::opencl {
namespace {

constexpr std::array kLocalCpu = {4, 8, 16, 32};
constexpr std::array kLocalGpu = {32, 64, 128, 256};
constexpr std::array kStripsCpu = {8, 16, 32, 64, 128};
constexpr std::array kStripsGpu = {1, 2, 4, 8, 16};
constexpr std::array kFilterAtOnce = {1, 2, 4, 8};
constexpr std::array kUndistortCpu = {4, 8, 16};
constexpr std::array kUndistortGpu = {1, 2, 4, 8, 16};
constexpr std::array kFeatureCpu = {8, 16, 32, 64};
constexpr std::array kFeatureGpu = {8, 16, 32};
constexpr std::array kRunsCpu = {kWholeRun, 64, 128, 256};
constexpr std::array kRunsGpu = {8, 16, 32, 64, 128};
constexpr std::array kChannels = {kByVectors, 4, 8, 16, 32};
constexpr std::array kPixels = {kByVectors, 2, 4, 6, 8, 12, 13};
// GPUs have the tiles of product.cl, and these where a group does not fit them: nothing to search.
constexpr std::array kChannelsGpu = {16};
constexpr std::array kPixelsGpu = {6};
constexpr std::array kFcRowsCandidates = {1, 2, 4, 8};
constexpr std::array kNoGroups = {1};
constexpr std::array kGroups = {1, 2, 3, 4, 6, 8};

}  // namespace

std::span<const ParameterInfo> parameter_table() {
  static const std::array<ParameterInfo, kParameters> kTable = {{
      // PoCL vectorizes over the items of a group: 8 are enough work for one core. GPUs run 32 or
      // 64 items in step.
      {.parameter = Parameter::kLocalX,
       .name = "local_x",
       .meaning = "work items of a work group of each kernel that takes so many",
       .kernels = {},
       .cpu = {8, kLocalCpu},
       .gpu = {64, kLocalGpu}},
      // Long strips share more between their rows, short ones are more work items.
      {.parameter = Parameter::kBlurStripRows,
       .name = "blur_strip_rows",
       .meaning = "rows that a work item of gaussian_blur slides down, a GPU's tile has",
       .kernels = {"gaussian_blur"},
       .cpu = {32, kStripsCpu},
       .gpu = {4, kStripsGpu}},
      {.parameter = Parameter::kFilterRows,
       .name = "filter_rows",
       .meaning = "rows whose sums a work item of filter7x7 holds at once",
       .kernels = {"filter7x7"},
       .cpu = {4, kFilterAtOnce},
       .gpu = {4, kFilterAtOnce},
       .definition = "FILTER_ROWS",
       .sources = {"filter7x7.cl", "tiles.cl"}},
      {.parameter = Parameter::kFilterStripRows,
       .name = "filter_strip_rows",
       .meaning = "rows that a work item of filter7x7 slides down, a GPU's tile has",
       .kernels = {"filter7x7"},
       .cpu = {32, kStripsCpu},
       .gpu = {4, kStripsGpu}},
      {.parameter = Parameter::kSobelStripRows,
       .name = "sobel_strip_rows",
       .meaning = "rows that a work item of sobel slides down",
       .kernels = {"sobel", "feature_detect"},
       .cpu = {32, kStripsCpu},
       .gpu = {16, kStripsGpu}},
      {.parameter = Parameter::kUndistortPixels,
       .name = "undistort_pixels",
       .meaning = "neighbouring pixels of a work item of undistort, a vector's width or 1",
       .kernels = {"undistort"},
       .cpu = {16, kUndistortCpu},
       .gpu = {4, kUndistortGpu},
       .definition = "UNDISTORT_PIXELS",
       .sources = {"undistort.cl"}},
      {.parameter = Parameter::kFeaturePixels,
       .name = "feature_pixels",
       .meaning = "neighbouring pixels of a work item of the corner responses and candidates",
       .kernels = {"feature_detect"},
       .cpu = {8, kFeatureCpu},
       .gpu = {8, kFeatureGpu}},
      // A CPU slides along whole rows and columns, the least work; other devices want thousands of
      // work items and pay one window's filling (52 steps) for each 16 steps.
      {.parameter = Parameter::kFlowRunX,
       .name = "flow_run_x",
       .meaning = "columns that a work item of optical_flow slides along, 0 = the whole row",
       .kernels = {"optical_flow"},
       .cpu = {kWholeRun, kRunsCpu},
       .gpu = {16, kRunsGpu}},
      {.parameter = Parameter::kFlowRunY,
       .name = "flow_run_y",
       .meaning = "rows that a work item of optical_flow slides down, 0 = the whole column",
       .kernels = {"optical_flow"},
       .cpu = {kWholeRun, kRunsCpu},
       .gpu = {16, kRunsGpu}},
      {.parameter = Parameter::kConvChannels,
       .name = "conv_channels",
       .meaning = "output channels of a work item of conv2d_relu, 0 = by the device's vectors",
       .kernels = {"conv2d_relu"},
       .cpu = {kByVectors, kChannels},
       .gpu = {16, kChannelsGpu},
       .definition = "CONV_CHANNELS",
       .sources = {"dnn.cl"}},
      {.parameter = Parameter::kConvPixels,
       .name = "conv_pixels",
       .meaning = "output pixels of a work item of conv2d_relu, 0 = by the device's vectors",
       .kernels = {"conv2d_relu"},
       .cpu = {kByVectors, kPixels},
       .gpu = {6, kPixelsGpu},
       .definition = "CONV_PIXELS",
       .sources = {"dnn.cl"}},
      {.parameter = Parameter::kFcRows,
       .name = "fc_rows",
       .meaning = "output rows of a work item of fully_connected, of a group on a GPU",
       .kernels = {"fully_connected"},
       .cpu = {8, kFcRowsCandidates},
       .gpu = {2, kFcRowsCandidates},
       .definition = "FC_ROWS",
       .sources = {"dnn.cl", "tiles.cl"}},
      {.parameter = Parameter::kProductGroups,
       .name = "product_groups",
       .meaning = "work groups a compute unit that conv2d_relu's sums are cut into",
       .kernels = {"conv2d_relu"},
       .cpu = {1, kNoGroups},
       .gpu = {3, kGroups}},
  }};
  return kTable;
}

bool ParameterInfo::concerns(std::string_view kernel) const {
  return kernels.empty() || std::ranges::find(kernels, kernel) != kernels.end();
}

const ParameterInfo& info_of(Parameter parameter) {
  const ParameterInfo& info = parameter_table()[static_cast<std::size_t>(parameter)];
  assert(info.parameter == parameter && "the table is in the order of the enumeration");
  return info;
}

const ParameterInfo* find_parameter(std::string_view name) {
  const auto table = parameter_table();
  const auto it = std::ranges::find(table, name, &ParameterInfo::name);
  return it == table.end() ? nullptr : &*it;
}

Tuning::Tuning(bool is_cpu) : is_cpu_(is_cpu) {
  for (const ParameterInfo& info : parameter_table()) {
    set(info.parameter, info.range(is_cpu).standard);
  }
}

bool Tuning::is_default(Parameter parameter) const {
  return (*this)[parameter] == info_of(parameter).range(is_cpu_).standard;
}

std::string Tuning::describe() const {
  std::vector<std::string> parts;
  for (const ParameterInfo& info : parameter_table()) {
    if (is_default(info.parameter)) continue;
    parts.push_back(fmt::format("{}={}", info.name, (*this)[info.parameter]));
  }
  return parts.empty() ? "default" : join(parts, ", ");
}

Tuning for_vectors(Tuning tuning, int lanes) {
  // Two vectors of channels by as many pixels as leave registers for what is loaded: AVX-512 has 32
  // registers of 16 lanes, AVX2 16 of 8, NEON 32 of 4.
  const bool is_wide = lanes >= 16;
  if (tuning[Parameter::kConvChannels] == kByVectors) {
    tuning.set(Parameter::kConvChannels, is_wide ? 32 : 16);
  }
  if (tuning[Parameter::kConvPixels] == kByVectors) {
    tuning.set(Parameter::kConvPixels, is_wide ? 13 : 6);
  }
  return tuning;
}

std::string definitions_of(const Tuning& tuning, std::string_view source) {
  std::string options;
  for (const ParameterInfo& info : parameter_table()) {
    if (std::ranges::find(info.sources, source) == info.sources.end()) continue;
    options += fmt::format(" -D{}={}", info.definition, tuning[info.parameter]);
  }
  return options;
}

}  // namespace pirt::opencl
