// The vision workloads: each a streaming core.
#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>

#include "workloads/backends/fpga/core.h"
#include "workloads/backends/fpga/kernels.h"
#include "workloads/vision/corners.h"
#include "workloads/vision/vision.h"

namespace pirt::fpga {
namespace {

constexpr std::string_view kVision = "vision";

std::string picture_fault(const FpgaKernelEntry& entry, const Workload& workload) {
  const CoreType& core = find_core(entry.core);
  const auto& op = operation_as<vision::ImageOperation>(workload);
  constexpr int kMaxHeight = 2047;  // of the cores' counters, and of the SDRAM's banks
  if (op.width > core.max_width || op.height > kMaxHeight) {
    return fmt::format("backend fpga has '{}' for pictures of at most {}x{} pixels", entry.core,
                       core.max_width, kMaxHeight);
  }
  if (op.width < core.min_width || op.height < core.min_height) {
    return fmt::format("backend fpga has '{}' for pictures of at least {}x{} pixels", entry.core,
                       core.min_width, core.min_height);
  }
  return "";
}

/// A call whose lanes are the workload's tensors.
Call picture_call(std::string_view core, const Workload& workload) {
  const auto& op = operation_as<vision::ImageOperation>(workload);
  Call call{.core = core, .width = op.width, .height = op.height};
  const std::int64_t pixels = std::int64_t{op.width} * op.height;
  for (const TensorSpec& spec : workload.inputs) {
    const auto size_bytes = static_cast<std::size_t>(spec.size_bytes());
    call.in.push_back({.bytes = static_cast<int>(spec.size_bytes() / pixels),
                       .memory = std::vector<std::byte>(size_bytes),
                       .call_bytes = size_bytes});
  }
  for (const TensorSpec& spec : workload.outputs) {
    call.out.push_back({.bytes = static_cast<int>(spec.size_bytes() / pixels),
                        .size_bytes = static_cast<std::size_t>(spec.size_bytes())});
  }
  return call;
}

Call make_gaussian_blur(const Workload& workload, std::span<const Tensor>) {
  return picture_call("gaussian_blur", workload);
}

Call make_sobel(const Workload& workload, std::span<const Tensor>) {
  return picture_call("sobel", workload);
}

Call make_convolution(const Workload& workload, std::span<const Tensor> parameters) {
  static_assert(vision::Filter7x7::kSize == 7 && vision::Filter7x7::kShift == 8,
                "convolution.v has them as constants");
  Call call = picture_call("convolution", workload);
  for (const std::int16_t weight : parameters[0].as<std::int16_t>()) {
    if (weight < -128 || weight > 127) {
      throw_environment(fmt::format(
          "'{}' has a weight of {}, and backend fpga computes with 8 bits (-128 to 127)",
          workload.name, weight));
    }
    call.parameters.push_back(static_cast<std::uint8_t>(weight));
  }
  return call;
}

Call make_optical_flow(const Workload& workload, std::span<const Tensor>) {
  static_assert(vision::OpticalFlow::kWindow == 52, "optical_flow.v has it as a constant");
  return picture_call("optical_flow", workload);
}

constexpr std::int64_t kStraight = 32;  ///< Of a position: 1/32 pixel.
constexpr int kKeptRows = 128;          ///< Of undistort.v.

/// Rows that the picture goes ahead of the map: what a position needs has been there for a row, and
/// is still kept.
int lead_of(const Workload& workload, std::span<const vision::MapEntry> map) {
  const auto& op = operation_as<vision::Undistort>(workload);
  int most = 0, least = 0;
  for (std::size_t i = 0; i < map.size(); ++i) {
    const int row = static_cast<int>(i) / op.width;
    const int y = map[i].y >> 5;
    if (y + 1 < 0 || y >= op.height) continue;  // outside: nothing is read
    most = std::max(most, y + 1 - row);
    least = std::min(least, y - row);
  }
  const int lead = most + 2;
  if (lead - least >= kKeptRows) {
    throw_environment(fmt::format(
        "the lens of '{}' bends lines over {} rows, and backend fpga keeps {} of a picture",
        workload.name, most - least, kKeptRows));
  }
  return lead;
}

std::uint8_t difference(std::int64_t value, std::int64_t expected, const Workload& workload) {
  const std::int64_t by = value - expected;
  if (by < -128 || by > 127) {
    throw_environment(
        fmt::format("the map of '{}' moves by {}/32 pixel from one pixel to the next, and backend "
                    "fpga has 8 bits for that",
                    workload.name, by));
  }
  return static_cast<std::uint8_t>(by);
}

/// The map as undistort.v takes it: see there.
Call make_undistort(const Workload& workload, std::span<const Tensor>) {
  const auto& op = operation_as<vision::Undistort>(workload);
  const auto map = vision::undistort_map(op);
  const int lead = lead_of(workload, map);
  Call call = picture_call("undistort", workload);
  const std::size_t ahead = static_cast<std::size_t>(lead) * static_cast<std::size_t>(op.width);
  call.in[0].memory.resize(map.size() + ahead);
  const std::int64_t above_x = map[0].x, above_y = map[0].y - kStraight;
  for (const std::int64_t value : {above_x, above_y}) {
    for (int i = 0; i < 3; ++i)
      call.parameters.push_back(static_cast<std::uint8_t>(value >> (8 * i) & 0xff));
  }
  call.parameters.push_back(static_cast<std::uint8_t>(lead & 0xff));
  call.parameters.push_back(static_cast<std::uint8_t>(lead >> 8));
  std::vector<std::byte> lane(2 * ahead);  // rows before the map's
  std::int64_t begin_x = above_x, begin_y = above_y, x = 0, y = 0;
  for (std::size_t i = 0; i < map.size(); ++i) {
    const bool begins = i % static_cast<std::size_t>(op.width) == 0;
    lane.push_back(std::byte{difference(map[i].x, begins ? begin_x : x + kStraight, workload)});
    lane.push_back(std::byte{difference(map[i].y, begins ? begin_y + kStraight : y, workload)});
    x = map[i].x;
    y = map[i].y;
    if (begins) begin_x = x, begin_y = y;
  }
  const std::size_t size_bytes = lane.size();
  call.in.push_back({.bytes = 2, .memory = std::move(lane), .loaded_bytes = size_bytes});
  return call;
}

/// Corners of a map of scores, by the rules of feature_detect.
double finish_features(const vision::FeatureDetect& op,
                       std::span<const std::vector<std::byte>> lanes, std::span<Tensor> outputs) {
  const auto width = static_cast<std::size_t>(op.width);
  std::vector<std::uint32_t> scores(lanes[0].size() / sizeof(std::uint32_t));
  std::memcpy(scores.data(), lanes[0].data(), lanes[0].size());
  const double threshold = vision::FeatureDetect::kQuality * *std::ranges::max_element(scores);
  std::vector<std::uint64_t> candidates;
  std::int64_t above = 0;
  for (std::size_t y = 1; y + 1 < static_cast<std::size_t>(op.height); ++y) {
    for (std::size_t x = 1; x + 1 < width; ++x) {
      const std::size_t at = y * width + x;
      const std::uint32_t score = scores[at];
      if (score <= threshold) continue;
      ++above;
      bool largest = true;
      for (const std::size_t row : {at - width, at, at + width}) {
        for (const std::size_t near : {row - 1, row, row + 1}) {
          largest = largest && score >= scores[near];
        }
      }
      if (largest) candidates.push_back(std::uint64_t{score} << 32 | at);
    }
  }
  const auto count = static_cast<double>(candidates.size());
  vision::write_corners(vision::select_corners(candidates, op), outputs[0]);
  // A load and a comparison for the largest score and again for the threshold, eight neighbours of
  // what is above it, comparisons of a sort with what they cost when they are mispredicted, nine
  // cells a candidate. Cycles of an in-order estimate: assumptions.
  constexpr double kPixel = 2 * 3, kAbove = 8 * 3, kCompare = 12, kCandidate = 9 * 20;
  return kPixel * static_cast<double>(scores.size()) + kAbove * static_cast<double>(above) +
         kCompare * count * std::log2(std::max(count, 2.0)) + kCandidate * count;
}

Call make_feature_detect(const Workload& workload, std::span<const Tensor>) {
  static_assert(vision::FeatureDetect::kBlock == 3, "feature_score.v has it as a constant");
  const auto& op = operation_as<vision::FeatureDetect>(workload);
  const auto pixels = static_cast<std::size_t>(op.width) * static_cast<std::size_t>(op.height);
  Call call{.core = "feature_score", .width = op.width, .height = op.height};
  call.in.push_back({.bytes = 1, .memory = std::vector<std::byte>(pixels), .call_bytes = pixels});
  call.out.push_back({.bytes = 4, .size_bytes = 4 * pixels});
  call.finish = [op](std::span<const std::vector<std::byte>> lanes, std::span<Tensor> outputs) {
    return finish_features(op, lanes, outputs);
  };
  return call;
}

constexpr std::array kVisionKernels = {
    FpgaKernelEntry{"gaussian_blur", "gaussian_blur", kVision, picture_fault, make_gaussian_blur},
    FpgaKernelEntry{"filter7x7", "convolution", kVision, picture_fault, make_convolution},
    FpgaKernelEntry{"sobel", "sobel", kVision, picture_fault, make_sobel},
    FpgaKernelEntry{"undistort", "undistort", kVision, picture_fault, make_undistort},
    FpgaKernelEntry{"feature_detect", "feature_score", kVision, picture_fault, make_feature_detect},
    FpgaKernelEntry{"optical_flow", "optical_flow", kVision, picture_fault, make_optical_flow},
};

}  // namespace

std::span<const FpgaKernelEntry> vision_kernels() { return kVisionKernels; }

const FpgaKernelEntry* find_kernel(std::string_view kernel) {
  for (const auto table : {vision_kernels(), layer_kernels()}) {
    const auto it = std::ranges::find(table, kernel, &FpgaKernelEntry::kernel);
    if (it != table.end()) return &*it;
  }
  return nullptr;
}

}  // namespace pirt::fpga
