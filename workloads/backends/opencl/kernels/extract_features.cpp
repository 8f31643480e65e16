// extract_features: contrast, candidates, blur, refining and descriptors on the device; the best of
// each cell, which is sequential, on the host within execute().
#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <utility>

#include "workloads/backends/opencl/plan/kernel_table.h"
#include "workloads/backends/opencl/plan/plan_kernel.h"
#include "workloads/vision/features.h"
#include "workloads/vision/vision.h"

namespace pirt::opencl {
namespace {

/// Buffers that the host part resets, reads and fills.
struct FeatureBuffers {
  cl::Buffer count;       ///< i32 [1] of candidates.
  cl::Buffer candidates;  ///< i32 [pixels,4]: index, xx, xy, yy.
  cl::Buffer corners;     ///< i32 [400]: indices of the selected.
};

class ExtractFeaturesKernel final : public PlanKernel {
 public:
  /// @param find  Ends with the candidates. @param describe  Begins with the selected.
  ExtractFeaturesKernel(DeviceSession session, const Workload& workload, Plan find, Plan describe,
                        FeatureBuffers buffers)
      : PlanKernel(std::move(session), workload.name, std::move(find)),
        operation_(operation_as<vision::ExtractFeatures>(workload)),
        describe_(std::move(describe)),
        buffers_(std::move(buffers)) {}

  std::optional<Nanos> execute(int repeats) override {
    return translated(fmt::format("executing {}", workload()), [&] {
      LaunchTimes times(session().has_clock);
      for (int i = 0; i < repeats; ++i) {
        find_candidates(times);
        hand_over(slam::best_corners(found_, operation_.width, operation_.height,
                                     {.most = vision::ExtractFeatures::kMost,
                                      .cell = vision::ExtractFeatures::kCell,
                                      .threshold = vision::ExtractFeatures::kThreshold}));
        enqueue(session(), describe_, times);
      }
      return times.finish();
    });
  }

 private:
  void find_candidates(LaunchTimes& times) {
    const cl::CommandQueue& queue = session().queue;
    cl::Event reset;
    queue.enqueueFillBuffer(buffers_.count, cl_int{0}, 0, sizeof(cl_int), nullptr, &reset);
    times.add(std::move(reset));
    enqueue(session(), plan(), times);
    cl_int count = 0;
    queue.enqueueReadBuffer(buffers_.count, CL_TRUE, 0, sizeof(count), &count);
    const std::int64_t most = std::int64_t{operation_.width} * operation_.height;
    candidates_.resize(static_cast<std::size_t>(checked_count(count, most, "candidates")));
    if (count > 0) {
      queue.enqueueReadBuffer(buffers_.candidates, CL_TRUE, 0,
                              candidates_.size() * sizeof(candidates_[0]), candidates_.data());
    }
    found_.clear();
    for (const auto& [index, xx, xy, yy] : candidates_) {
      found_.push_back(
          {index % operation_.width, index / operation_.width, slam::corner_score(xx, xy, yy)});
    }
  }

  /// The selected to the device, with how many rows all outputs have.
  void hand_over(const std::vector<slam::FastCorner>& best) {
    const cl::CommandQueue& queue = session().queue;
    const auto rows = static_cast<cl_int>(best.size());
    for (const DeviceTensor& output : plan().outputs) {
      queue.enqueueWriteBuffer(output.rows, CL_TRUE, 0, sizeof(rows), &rows);
    }
    if (best.empty()) return;
    std::vector<cl_int> corners;
    std::vector<cl_float> scores;
    for (const auto& corner : best) {
      corners.push_back(corner.y * operation_.width + corner.x);
      scores.push_back(corner.score);
    }
    queue.enqueueWriteBuffer(buffers_.corners, CL_TRUE, 0, corners.size() * sizeof(cl_int),
                             corners.data());
    queue.enqueueWriteBuffer(plan().outputs[1].buffer, CL_TRUE, 0, scores.size() * sizeof(cl_float),
                             scores.data());
  }

  vision::ExtractFeatures operation_;
  Plan describe_;
  FeatureBuffers buffers_;
  std::vector<std::array<cl_int, 4>> candidates_;
  std::vector<slam::FastCorner> found_;
};

/// Work items of 16 pixels.
std::int64_t segments(int pixels) { return (pixels + 15) / 16; }

/// Where the two pixels of each bit are, from the corner's, in a picture of this width.
std::array<std::array<cl_int, 2>, 256> offsets_of_pattern(int width) {
  std::array<std::array<cl_int, 2>, 256> offsets{};
  std::ranges::transform(slam::descriptor_pattern(), offsets.begin(), [&](const auto& pair) {
    return std::array<cl_int, 2>{pair.ay * width + pair.ax, pair.by * width + pair.bx};
  });
  return offsets;
}

}  // namespace

std::unique_ptr<Kernel> make_extract_features(const DeviceSession& session,
                                              const Workload& workload,
                                              std::span<const Tensor> /*parameters*/) {
  static_assert(slam::kFeatureRim == 20 && slam::kFeatureScoreHalf == 3 &&
                    slam::kFeatureWindowHalf == 7 && slam::kFeatureRefineSteps == 3 &&
                    slam::kFeatureFarthest == 4.0F,
                "extract.cl has them as constants");
  const auto& op = operation_as<vision::ExtractFeatures>(workload);
  const std::int64_t area = std::int64_t{op.width} * op.height;
  PlanBuilder builder(session);
  const DeviceTensor image = builder.resident(workload.inputs[0]);
  const DeviceTensor pixels = builder.resident(workload.outputs[0]);
  const DeviceTensor scores = builder.resident(workload.outputs[1]);
  const DeviceTensor descriptors = builder.resident(workload.outputs[2]);
  const cl::Buffer contrast = builder.zeroed(static_cast<std::size_t>(area));
  const cl::Buffer rows = builder.scratch(area * std::int64_t{sizeof(cl_ushort)});
  const cl::Buffer blurred = builder.scratch(area);
  const FeatureBuffers buffers{
      .count = builder.scratch(std::int64_t{sizeof(cl_int)}),
      .candidates = builder.scratch(area * std::int64_t{sizeof(cl_int4)}),
      .corners = builder.scratch(vision::ExtractFeatures::kMost * std::int64_t{sizeof(cl_int)})};
  const auto weights = builder.constant(std::as_bytes(std::span(slam::kFeatureBlur)));
  const auto offsets = offsets_of_pattern(op.width);
  const auto pattern = builder.constant(std::as_bytes(std::span(offsets)));
  // What is left of a picture without its rim.
  const int columns = op.width - 2 * slam::kFeatureRim;
  const int lines = op.height - 2 * slam::kFeatureRim;
  if (columns > 0 && lines > 0) {
    // From column 16 on, with a pixel at each side of what is left.
    builder.step("extract.cl", "fast_contrast", {segments(columns + 5), lines + 2}, image, contrast,
                 op.width, op.height, vision::ExtractFeatures::kThreshold);
    builder.step("extract.cl", "fast_candidates", {segments(columns + 4), lines}, image, contrast,
                 buffers.count, buffers.candidates, op.width, op.height);
    builder.step("extract.cl", "blur_rows", {segments(op.width - 6), op.height}, image, rows,
                 weights, op.width);
    builder.step("extract.cl", "blur_columns", {segments(op.width - 6), op.height - 6}, rows,
                 blurred, weights, op.width);
  }
  Plan find = builder.finish({image}, {pixels, scores, descriptors});
  PlanBuilder second(session);
  second.step("extract.cl", "describe_corners", {vision::ExtractFeatures::kMost, 1}, image, blurred,
              buffers.corners, pixels.rows, pattern, pixels, descriptors, op.width);
  return std::make_unique<ExtractFeaturesKernel>(session, workload, std::move(find),
                                                 second.finish({}, {}), buffers);
}

}  // namespace pirt::opencl
