// extract_features: contrast, candidates, blur, refining and descriptors on the device; the best of
// each cell, which is sequential, on the host within execute().
#include <algorithm>
#include <array>
#include <cstring>
#include <utility>

#include "workloads/backends/opencl/kernels/packing.h"
#include "workloads/backends/opencl/plan/kernel_table.h"
#include "workloads/backends/opencl/plan/plan_kernel.h"
#include "workloads/vision/features.h"
#include "workloads/vision/vision.h"

namespace pirt::opencl {
namespace {

/// What the device found, and what the host chose of it.
struct FeatureBuffers {
  cl::Buffer count;       ///< i32 [1] of candidates.
  cl::Buffer candidates;  ///< i32 [pixels,4]: index, xx, xy, yy.
  cl::Buffer chosen;      ///< ChosenCorners.
};

/// As describe_corners of extract.cl reads them.
struct ChosenCorners {
  cl_int count = 0;
  std::array<cl_int, vision::ExtractFeatures::kMost> indices;
  std::array<cl_float, vision::ExtractFeatures::kMost> scores;
};

class ExtractFeaturesKernel final : public PlanKernel {
 public:
  /// @param find  Ends with the candidates. @param describe  Begins with the chosen.
  ExtractFeaturesKernel(DeviceSession session, const Workload& workload, Plan find, Plan describe,
                        FeatureBuffers buffers)
      : PlanKernel(std::move(session), workload.name, std::move(find)),
        operation_(operation_as<vision::ExtractFeatures>(workload)),
        describe_(std::move(describe)),
        buffers_(std::move(buffers)) {}

  [[nodiscard]] std::int64_t device_memory_bytes() const override {
    return PlanKernel::device_memory_bytes() + static_cast<std::int64_t>(describe_.size_bytes);
  }

 private:
  void compute(Launches& launches) override {
    session().queue.enqueueFillBuffer(buffers_.count, cl_int{0}, 0, sizeof(cl_int), nullptr,
                                      launches.next());
    enqueue(session(), plan(), launches);
    choose(transfers().read({.count = buffers_.count,
                             .list = buffers_.candidates,
                             .entry_bytes = sizeof(Candidate),
                             .most = std::int64_t{operation_.width} * operation_.height,
                             .of = "candidates"}));
    session().queue.enqueueWriteBuffer(buffers_.chosen, CL_FALSE, 0, sizeof(chosen_), &chosen_);
    enqueue(session(), describe_, launches);
  }

  /// Index, xx, xy, yy.
  using Candidate = std::array<cl_int, 4>;

  void choose(std::span<const std::byte> candidates) {
    found_.clear();
    for (std::size_t at = 0; at < candidates.size(); at += sizeof(Candidate)) {
      Candidate candidate;
      std::memcpy(candidate.data(), &candidates[at], sizeof(candidate));
      const auto& [index, xx, xy, yy] = candidate;
      found_.push_back(
          {index % operation_.width, index / operation_.width, slam::corner_score(xx, xy, yy)});
    }
    const auto best = slam::best_corners(found_, operation_.width, operation_.height,
                                         {.most = vision::ExtractFeatures::kMost,
                                          .cell = vision::ExtractFeatures::kCell,
                                          .threshold = vision::ExtractFeatures::kThreshold});
    chosen_.count = static_cast<cl_int>(best.size());
    for (std::size_t i = 0; i < best.size(); ++i) {
      chosen_.indices[i] = best[i].y * operation_.width + best[i].x;
      chosen_.scores[i] = best[i].score;
    }
  }

  vision::ExtractFeatures operation_;
  Plan describe_;
  FeatureBuffers buffers_;
  std::vector<slam::FastCorner> found_;
  ChosenCorners chosen_;  ///< The device may read it until the call's end.
};

constexpr int kSegment = 16;  // Pixels of a work item.

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
  static_assert(vision::ExtractFeatures::kMost == 400 && slam::kFeatureRim == 20 &&
                    slam::kFeatureScoreHalf == 3 && slam::kFeatureWindowHalf == 7 &&
                    slam::kFeatureRefineSteps == 3 && slam::kFeatureFarthest == 4.0F,
                "extract.cl has them as constants");
  const auto& op = operation_as<vision::ExtractFeatures>(workload);
  const std::int64_t area = std::int64_t{op.width} * op.height;
  PlanBuilder builder(session);
  const DeviceTensor image = builder.resident(workload.inputs[0]);
  const auto outputs = builder.residents(workload.outputs);
  const DeviceTensor &pixels = outputs[0], &scores = outputs[1], &descriptors = outputs[2];
  const cl::Buffer contrast = builder.zeroed(static_cast<std::size_t>(area));
  const cl::Buffer rows = builder.scratch(area * std::int64_t{sizeof(cl_ushort)});
  const cl::Buffer blurred = builder.scratch(area);
  const FeatureBuffers buffers{.count = builder.scratch(std::int64_t{sizeof(cl_int)}),
                               .candidates = builder.scratch(area * std::int64_t{sizeof(cl_int4)}),
                               .chosen = builder.scratch(std::int64_t{sizeof(ChosenCorners)})};
  const auto weights = builder.constant(std::as_bytes(std::span(slam::kFeatureBlur)));
  const auto offsets = offsets_of_pattern(op.width);
  const auto pattern = builder.constant(std::as_bytes(std::span(offsets)));
  // What is left of a picture without its rim.
  const int columns = op.width - 2 * slam::kFeatureRim;
  const int lines = op.height - 2 * slam::kFeatureRim;
  if (columns > 0 && lines > 0) {
    // From column 16 on, with a pixel at each side of what is left.
    builder.step("extract.cl", "fast_contrast", {blocks(columns + 5, kSegment), lines + 2}, image,
                 contrast, op.width, op.height, vision::ExtractFeatures::kThreshold);
    builder.step("extract.cl", "fast_candidates", {blocks(columns + 4, kSegment), lines}, image,
                 contrast, buffers.count, buffers.candidates, op.width, op.height);
    builder.step("extract.cl", "blur_rows", {blocks(op.width - 6, kSegment), op.height}, image,
                 rows, weights, op.width);
    builder.step("extract.cl", "blur_columns", {blocks(op.width - 6, kSegment), op.height - 6},
                 rows, blurred, weights, op.width);
  }
  Plan find = builder.finish({image}, outputs);
  PlanBuilder second(session);
  second.step("extract.cl", "describe_corners", {vision::ExtractFeatures::kMost, 1}, image, blurred,
              buffers.chosen, pattern, pixels, pixels.rows, scores, scores.rows, descriptors,
              descriptors.rows, op.width);
  return std::make_unique<ExtractFeaturesKernel>(session, workload, std::move(find),
                                                 second.finish({}, {}), buffers);
}

}  // namespace pirt::opencl
