// The vision workloads that the device computes entirely: arguments and extents of their kernels,
// each in a .cl file of its name and, where the device has local memory of its own, in tiles.cl.
#include <array>
#include <vector>

#include "workloads/backends/opencl/kernels/gradients.h"
#include "workloads/backends/opencl/kernels/packing.h"
#include "workloads/backends/opencl/kernels/strips.h"
#include "workloads/backends/opencl/kernels/tiles.h"
#include "workloads/backends/opencl/plan/kernel_table.h"
#include "workloads/vision/pyramid.h"
#include "workloads/vision/vision.h"

namespace pirt::opencl {
namespace {

PictureTiles tiles_of(PlanBuilder& builder, const char* kernel, Parameter rows, int reach,
                      const vision::ImageOperation& op) {
  return {builder, kernel, builder.session().value(rows), reach, op};
}

Strips strips_of(const PlanBuilder& builder, Parameter rows, const vision::ImageOperation& op) {
  return {builder.session().value(rows), op};
}

void append_gaussian_blur(PlanBuilder& builder, const Workload& workload, std::span<const Tensor>,
                          std::span<const DeviceTensor> inputs,
                          std::span<const DeviceTensor> outputs) {
  const auto& op = operation_as<vision::GaussianBlur>(workload);
  if (!builder.session().is_cpu) {
    const auto tiles = tiles_of(builder, "gaussian_blur_tile", Parameter::kBlurStripRows, 2, op);
    builder.step("tiles.cl", "gaussian_blur_tile", tiles.extent, inputs[0], outputs[0], op.width,
                 op.height, tiles.rows, tiles.memory);
    return;
  }
  const Strips strips = strips_of(builder, Parameter::kBlurStripRows, op);
  builder.step("gaussian_blur.cl", "gaussian_blur", strips.extent, inputs[0], outputs[0], op.width,
               op.height, strips.rows);
}

void append_filter7x7(PlanBuilder& builder, const Workload& workload,
                      std::span<const Tensor> parameters, std::span<const DeviceTensor> inputs,
                      std::span<const DeviceTensor> outputs) {
  static_assert(vision::Filter7x7::kSize == 7, "filter7x7.cl has it as a constant");
  const auto& op = operation_as<vision::Filter7x7>(workload);
  std::vector<float> weights;
  for (const std::int16_t weight : parameters[0].as<std::int16_t>()) {
    weights.push_back(static_cast<float>(weight) / (1 << vision::Filter7x7::kShift));
  }
  const auto constant = builder.constant(std::as_bytes(std::span(weights)));
  if (!builder.session().is_cpu) {
    const auto tiles = tiles_of(builder, "filter7x7_tile", Parameter::kFilterStripRows, 3, op);
    builder.step("tiles.cl", "filter7x7_tile", tiles.extent, inputs[0], outputs[0], constant,
                 op.width, op.height, tiles.rows, tiles.memory);
    return;
  }
  const Strips strips = strips_of(builder, Parameter::kFilterStripRows, op);
  builder.step("filter7x7.cl", "filter7x7", strips.extent, inputs[0], outputs[0], constant,
               op.width, op.height, strips.rows);
}

void append_sobel(PlanBuilder& builder, const Workload& workload, std::span<const Tensor>,
                  std::span<const DeviceTensor> inputs, std::span<const DeviceTensor> outputs) {
  append_gradients(builder, "sobel.cl", operation_as<vision::Sobel>(workload), inputs[0],
                   outputs[0].buffer, outputs[1].buffer);
}

void append_optical_flow(PlanBuilder& builder, const Workload& workload, std::span<const Tensor>,
                         std::span<const DeviceTensor> inputs,
                         std::span<const DeviceTensor> outputs) {
  static_assert(vision::OpticalFlow::kWindow == 52, "flow.cl has it as a constant");
  constexpr int kSums = 5;  // xx, xy, yy, xt, yt
  constexpr int kColumnsPerItem = 8;
  const auto& op = operation_as<vision::OpticalFlow>(workload);
  const auto run = [&](Parameter parameter, int whole) {
    const int tuned = builder.session().value(parameter);
    return tuned == kWholeRun ? whole : tuned;
  };
  const int run_x = run(Parameter::kFlowRunX, op.width);
  const int run_y = run(Parameter::kFlowRunY, op.height);
  const auto pitch = blocks(op.width, kColumnsPerItem) * kColumnsPerItem;
  const std::int64_t numbers = std::int64_t{kSums} * op.height * pitch;
  check_countable("optical_flow's sums", numbers);
  const cl::Buffer sums = builder.scratch(numbers * std::int64_t{sizeof(cl_int)});
  builder.step("flow.cl", "flow_row_sums", {blocks(op.width, run_x), op.height}, inputs[0],
               inputs[1], sums, op.width, op.height, pitch, run_x);
  builder.step("flow.cl", "flow_solve", {pitch / kColumnsPerItem, blocks(op.height, run_y)}, sums,
               outputs[0], op.width, op.height, pitch, run_y);
}

void append_background_model(PlanBuilder& builder, const Workload& workload,
                             std::span<const Tensor>, std::span<const DeviceTensor> inputs,
                             std::span<const DeviceTensor> outputs) {
  static_assert(
      vision::BackgroundModel::kThreshold == 24 && vision::BackgroundModel::kMaxShift == 4,
      "background.cl has them as constants");
  constexpr int kPixelsPerItem = 16;
  const auto& op = operation_as<vision::BackgroundModel>(workload);
  const int pixels = op.width * op.height;
  builder.step("background.cl", "background_model", {blocks(pixels, kPixelsPerItem), 1}, inputs[0],
               builder.current(0), builder.current(1), outputs[0], builder.next(0), builder.next(1),
               pixels);
}

void append_track_features(PlanBuilder& builder, const Workload& workload, std::span<const Tensor>,
                           std::span<const DeviceTensor> inputs,
                           std::span<const DeviceTensor> outputs) {
  using Op = vision::TrackFeatures;
  constexpr slam::TrackOptions kOptions;
  static_assert(Op::kLevels == 4 && Op::kRadius == 7 && kOptions.iterations == 12 &&
                    kOptions.enough == 0.01 && kOptions.most_error == 14.0 &&
                    kOptions.least_corner == 4.0 && kOptions.back == 0.8,
                "track.cl has them as constants");
  const auto& op = operation_as<Op>(workload);
  const auto levels = op.levels();
  const auto pyramid = [&](const DeviceTensor& image) {
    std::array<cl::Buffer, Op::kLevels> all = {image.buffer};
    for (std::size_t i = 1; i < levels.size(); ++i) {
      const auto& [width, height] = levels[i];
      all[i] = builder.scratch(std::int64_t{width} * height);
      builder.step("track.cl", "next_level", {width, height}, all[i - 1], all[i],
                   levels[i - 1].width, levels[i - 1].height, width, height);
    }
    return all;
  };
  const auto previous = pyramid(inputs[0]);
  const auto next = pyramid(inputs[1]);
  builder.step("track.cl", "track_points", {Op::kMaxPoints, 1}, previous[0], previous[1],
               previous[2], previous[3], next[0], next[1], next[2], next[3], inputs[2],
               inputs[2].rows, outputs[0], outputs[0].rows, outputs[1], outputs[1].rows, op.width,
               op.height, Op::kMaxPoints);
}

constexpr std::array kVisionKernels = {
    OpenclKernelEntry{.kernel = "gaussian_blur", .append = append_gaussian_blur},
    OpenclKernelEntry{.kernel = "filter7x7", .append = append_filter7x7},
    OpenclKernelEntry{.kernel = "sobel", .append = append_sobel},
    OpenclKernelEntry{.kernel = "undistort", .append = append_undistort},
    OpenclKernelEntry{.kernel = "feature_detect", .make = make_feature_detect},
    OpenclKernelEntry{.kernel = "optical_flow", .append = append_optical_flow},
    OpenclKernelEntry{.kernel = "extract_features", .make = make_extract_features},
    OpenclKernelEntry{.kernel = "track_features", .append = append_track_features},
    OpenclKernelEntry{.kernel = "background_model", .append = append_background_model},
};

}  // namespace

void append_gradients(PlanBuilder& builder, std::string_view source,
                      const vision::ImageOperation& op, const DeviceTensor& image,
                      const cl::Buffer& gx, const cl::Buffer& gy) {
  if (!builder.session().is_cpu) {
    const auto tiles = tiles_of(builder, "sobel_tile", Parameter::kSobelStripRows, 1, op);
    builder.step("tiles.cl", "sobel_tile", tiles.extent, image, gx, gy, op.width, op.height,
                 tiles.rows, tiles.memory);
    return;
  }
  const Strips strips = strips_of(builder, Parameter::kSobelStripRows, op);
  builder.step(source, "sobel", strips.extent, image, gx, gy, op.width, op.height, strips.rows);
}

std::span<const OpenclKernelEntry> vision_kernels() { return kVisionKernels; }

}  // namespace pirt::opencl
