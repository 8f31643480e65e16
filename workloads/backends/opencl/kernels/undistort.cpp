// undistort: the map as tables of where each pixel's neighbours are and what they weigh, so that
// all pixels of a work item go the same way, at the picture's border too.
#include <algorithm>
#include <array>
#include <vector>

#include "workloads/backends/opencl/kernels/packing.h"
#include "workloads/backends/opencl/plan/kernel_table.h"
#include "workloads/vision/vision.h"

namespace pirt::opencl {
namespace {

/// Two neighbours along a row or a column.
struct Pair {
  int first = 0;  ///< Where the earlier one is; both are in the picture if it has two.
  cl_uchar weight = 0, next_weight = 0;  ///< In 1/32.
};

/// @param position  In 1/32 pixel. @param size  Pixels that there are.
Pair pair_at(int position, int size) {
  constexpr int kOne = 32;
  const int first = position >> 5, fraction = position & 31;
  const auto weight_of = [&](int pixel) {
    return static_cast<cl_uchar>(pixel == first       ? kOne - fraction
                                 : pixel == first + 1 ? fraction
                                                      : 0);
  };
  Pair pair{.first = std::clamp(first, 0, std::max(size - 2, 0))};
  pair.weight = weight_of(pair.first);
  pair.next_weight = size > 1 ? weight_of(pair.first + 1) : cl_uchar{0};
  return pair;
}

/// What kernel undistort reads: see there.
struct Tables {
  std::vector<cl_int> offsets;
  std::vector<cl_uchar> weights;
};

Tables tables_of(const vision::Undistort& op, int pixels) {
  const auto map = vision::undistort_map(op);
  const auto lanes = static_cast<std::size_t>(pixels);
  const auto columns = static_cast<std::size_t>(op.width);
  const auto in_a_row = static_cast<std::size_t>(blocks(op.width, pixels));
  Tables tables;
  tables.offsets.resize(static_cast<std::size_t>(op.height) * in_a_row * lanes);
  tables.weights.resize(4 * tables.offsets.size());
  for (std::size_t i = 0; i < map.size(); ++i) {
    const Pair across = pair_at(map[i].x, op.width), down = pair_at(map[i].y, op.height);
    const std::size_t x = i % columns;
    const std::size_t block = i / columns * in_a_row + x / lanes;
    tables.offsets[block * lanes + x % lanes] = down.first * op.width + across.first;
    cl_uchar* const weights = &tables.weights[4 * block * lanes + x % lanes];
    weights[0] = across.weight;
    weights[lanes] = across.next_weight;
    weights[2 * lanes] = down.weight;
    weights[3 * lanes] = down.next_weight;
  }
  return tables;
}

}  // namespace

void append_undistort(PlanBuilder& builder, const Workload& workload, std::span<const Tensor>,
                      std::span<const DeviceTensor> inputs, std::span<const DeviceTensor> outputs) {
  const auto& op = operation_as<vision::Undistort>(workload);
  const int pixels = builder.session().value(Parameter::kUndistortPixels);
  check_countable("undistort's tables",
                  std::int64_t{std::max(pixels, 4)} * op.height * blocks(op.width, pixels));
  const Tables tables = tables_of(op, pixels);
  const int below = op.height > 1 ? op.width : 0;
  builder.step("undistort.cl", "undistort", {blocks(op.width, pixels), op.height}, inputs[0],
               outputs[0], builder.constant(std::as_bytes(std::span(tables.offsets))),
               builder.constant(std::as_bytes(std::span(tables.weights))), op.width, below);
}

}  // namespace pirt::opencl
