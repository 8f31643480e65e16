// undistort on the DSP: the map is cut into tiles in `prepare`, by the host.
#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <limits>

#include "workloads/backends/dsp/kernels.h"
#include "workloads/backends/dsp/undistort_plan.h"
#include "workloads/base/math/pixel_index.h"
#include "workloads/vision/vision.h"

namespace pirt::dsp {
namespace {

using vision::MapEntry;

/// Zeros around the source: two columns and rows are enough for what is outside, the rest for a
/// window that begins anywhere.
constexpr int kMargin = 2;
constexpr int kTilesAcross = PIRT_DSP_ALIGNMENT / PIRT_DSP_TILE_WIDTH;
constexpr int kPixels = PIRT_DSP_TILE_WIDTH * PIRT_DSP_TILE_HEIGHT;
constexpr std::size_t kMargins = 2 * std::size_t{kMargin};
constexpr std::size_t kVectorBytes = 3 * std::size_t{kPixels};

struct Position {
  int x = 0, y = 0;    ///< Pixel of the source.
  int fx = 0, fy = 0;  ///< In 1/32.
};

/// What is farther outside than the margin is as much zero at the margin.
Position position_of(MapEntry entry, const vision::Undistort& op) {
  const Position exact{entry.x >> 5, entry.y >> 5, entry.x & 31, entry.y & 31};
  return {std::clamp(exact.x, -kMargin, op.width), std::clamp(exact.y, -kMargin, op.height),
          exact.fx, exact.fy};
}

struct PlannedTile {
  PirtDspTile tile;
  std::array<std::uint8_t, kVectorBytes> vectors;  ///< Index; fx; fy with flags.
};

PlannedTile plan_tile(const std::vector<MapEntry>& map, const vision::Undistort& op, int left,
                      int top, int source_stride) {
  std::array<Position, kPixels> positions;
  int x0 = std::numeric_limits<int>::max();
  int y0 = x0;
  int x1 = std::numeric_limits<int>::min();
  int y1 = x1;
  for (int i = 0; i < kPixels; ++i) {
    // Beyond the picture's edge its last pixels are computed once more.
    const int x = std::min(left + i % PIRT_DSP_TILE_WIDTH, op.width - 1);
    const int y = std::min(top + i / PIRT_DSP_TILE_WIDTH, op.height - 1);
    Position& p = positions[static_cast<std::size_t>(i)];
    p = position_of(map[pixel_index(x, y, op.width)], op);
    x0 = std::min(x0, p.x);
    y0 = std::min(y0, p.y);
    x1 = std::max(x1, p.x + 1);
    y1 = std::max(y1, p.y + 1);
  }
  if (x1 - x0 >= PIRT_DSP_WINDOW_WIDTH || y1 - y0 >= PIRT_DSP_WINDOW_HEIGHT) {
    throw_environment(fmt::format(
        "undistort {}x{}: {}x{} pixels at ({}, {}) come from {}x{} of the source, and backend dsp "
        "has windows of {}x{}",
        op.width, op.height, PIRT_DSP_TILE_WIDTH, PIRT_DSP_TILE_HEIGHT, left, top, x1 - x0 + 1,
        y1 - y0 + 1, PIRT_DSP_WINDOW_WIDTH, PIRT_DSP_WINDOW_HEIGHT));
  }
  PlannedTile planned{{(y0 + kMargin) * source_stride + x0 + kMargin, y1 - y0 + 1}, {}};
  for (std::size_t i = 0; i < kPixels; ++i) {
    const Position& p = positions[i];
    const int row = p.y - y0;
    planned.vectors[i] = static_cast<std::uint8_t>(row % 8 * PIRT_DSP_WINDOW_WIDTH + p.x - x0);
    planned.vectors[kPixels + i] = static_cast<std::uint8_t>(p.fx);
    planned.vectors[std::size_t{2} * kPixels + i] = static_cast<std::uint8_t>(
        p.fy | (row >= 8 ? PIRT_DSP_FLAG_HERE : 0) | (row + 1 >= 8 ? PIRT_DSP_FLAG_BELOW : 0));
  }
  return planned;
}

std::vector<PlannedTile> plan_tiles(const vision::Undistort& op, int source_stride) {
  const auto map = vision::undistort_map(op);
  std::vector<PlannedTile> tiles;
  const int across = kTilesAcross * PIRT_DSP_TILE_WIDTH;
  for (int y = 0; y < op.height; y += PIRT_DSP_TILE_HEIGHT) {
    for (int group = 0; group < op.width; group += across) {
      for (int x = group; x < group + across; x += PIRT_DSP_TILE_WIDTH) {
        tiles.push_back(plan_tile(map, op, x, y, source_stride));
      }
    }
  }
  return tiles;
}

/// Room for the source within its margin, all zeros; the picture lies inside.
std::pair<Buffer, MappedTensor> make_source(ProgramSession& session, const vision::Undistort& op) {
  const auto width = static_cast<std::size_t>(op.width);
  const auto height = static_cast<std::size_t>(op.height);
  // Windows reach beyond the last rows; what they load there is not looked up.
  const std::size_t pitch = width + kMargins + PIRT_DSP_WINDOW_WIDTH;
  const std::size_t rows = height + kMargins + PIRT_DSP_WINDOW_HEIGHT;
  const Buffer whole = session.allocate(rows * pitch, "the source of undistort");
  const auto bytes = session.bytes(whole);
  std::memset(bytes.data(), 0, bytes.size());
  Buffer inside = whole;
  inside.offset += static_cast<std::uint32_t>(kMargin * pitch + kMargin);
  inside.bytes = static_cast<std::uint32_t>(height * pitch);
  return {whole, {inside, height, width, pitch}};
}

}  // namespace

Call make_undistort(ProgramSession& session, const Workload& workload, std::span<const Tensor>) {
  const auto& op = operation_as<vision::Undistort>(workload);
  Call call;
  call.kernel = PIRT_DSP_undistort;
  call.name = workload.name;
  const auto [whole, source] = make_source(session, op);
  call.inputs.push_back(source);
  call.outputs.push_back(make_picture(session, workload.outputs[0]));
  const auto source_stride = static_cast<std::int32_t>(source.pitch_bytes);
  const auto tiles = plan_tiles(op, source_stride);
  const Buffer headers = session.allocate(tiles.size() * sizeof(PirtDspTile), "undistort's tiles");
  const Buffer vectors = session.allocate(tiles.size() * kVectorBytes, "undistort's map");
  for (std::size_t i = 0; i < tiles.size(); ++i) {
    std::memcpy(session.bytes(headers).data() + i * sizeof(PirtDspTile), &tiles[i].tile,
                sizeof(PirtDspTile));
    std::memcpy(session.bytes(vectors).data() + i * kVectorBytes, tiles[i].vectors.data(),
                kVectorBytes);
  }
  call.buffers = {whole, call.outputs[0].buffer, headers, vectors};
  call.loaded = {headers, vectors};
  call.values = {op.height, static_cast<std::int32_t>(call.outputs[0].pitch_bytes), source_stride};
  return call;
}

}  // namespace pirt::dsp
