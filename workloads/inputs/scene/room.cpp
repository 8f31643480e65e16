// The room's geometry and its textures.
#include "workloads/inputs/scene/room.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>

#include "workloads/base/math/gaussian.h"
#include "workloads/base/math/pixel_index.h"
#include "workloads/base/math/random.h"

namespace pirt {
namespace {

constexpr int kLevels = 5;

float lattice(std::uint64_t seed, int x, int y) {
  return static_cast<float>(hash_lattice(seed, x, y) >> 40U) * 0x1p-24F;
}

/// Adds value noise with cells of @p cell texels.
void add_octave(std::vector<float>& texture, int width, int height, int cell, float amplitude,
                std::uint64_t seed) {
  const int columns = width / cell + 2;
  const int rows = height / cell + 2;
  std::vector<float> grid(static_cast<std::size_t>(columns) * static_cast<std::size_t>(rows));
  for (int y = 0; y < rows; ++y) {
    for (int x = 0; x < columns; ++x) {
      grid[pixel_index(x, y, columns)] = lattice(seed, x, y) - 0.5F;
    }
  }
  const auto smooth = [](float t) { return t * t * (3 - 2 * t); };
  for (int y = 0; y < height; ++y) {
    const float fy = smooth(static_cast<float>(y % cell) / static_cast<float>(cell));
    const float* top = &grid[pixel_index(0, y / cell, columns)];
    const float* low = top + columns;
    for (int x = 0; x < width; ++x) {
      const float fx = smooth(static_cast<float>(x % cell) / static_cast<float>(cell));
      const int k = x / cell;
      const float a = top[k] + (top[k + 1] - top[k]) * fx;
      const float b = low[k] + (low[k + 1] - low[k]) * fx;
      texture[pixel_index(x, y, width)] += amplitude * (a + (b - a) * fy);
    }
  }
}

/// Rectangles and discs of all sizes: pictures, tiles, stains; their rims are two texels soft.
void add_shapes(std::vector<float>& texture, int width, int height, std::uint64_t seed) {
  Random random(seed);
  const int count = width * height / 1600;
  for (int i = 0; i < count; ++i) {
    const auto cx = static_cast<float>(random.uniform(0, width));
    const auto cy = static_cast<float>(random.uniform(0, height));
    const auto rx = static_cast<float>(3.0 * std::exp(random.uniform(0, 2.2)));
    const float ry = rx * static_cast<float>(random.uniform(0.5, 2.0));
    const auto turn = static_cast<float>(random.uniform(0, std::numbers::pi));
    const auto level = static_cast<float>(random.uniform(-90, 90));
    const bool disc = random.uniform() < 0.3;
    const float c = std::cos(turn);
    const float s = std::sin(turn);
    const int reach = static_cast<int>(1.5F * std::max(rx, ry)) + 2;
    for (int y = std::max(0, static_cast<int>(cy) - reach);
         y < std::min(height, static_cast<int>(cy) + reach); ++y) {
      for (int x = std::max(0, static_cast<int>(cx) - reach);
           x < std::min(width, static_cast<int>(cx) + reach); ++x) {
        const float dx = static_cast<float>(x) - cx;
        const float dy = static_cast<float>(y) - cy;
        const float a = c * dx + s * dy;
        const float b = c * dy - s * dx;
        const float inside =
            disc ? (1 - std::sqrt(a * a / (rx * rx) + b * b / (ry * ry))) * std::min(rx, ry)
                 : std::min(rx - std::abs(a), ry - std::abs(b));
        const float cover = std::clamp(0.5F + 0.5F * inside, 0.0F, 1.0F);
        float& texel = texture[pixel_index(x, y, width)];
        texel += cover * (128 + level - texel) * 0.8F;
      }
    }
  }
}

/// At least 2x2: what lies between texels needs a neighbour in both directions.
GreyImage halved(const GreyImage& image) {
  GreyImage half{std::max(2, image.width / 2), std::max(2, image.height / 2), {}};
  half.pixels.resize(static_cast<std::size_t>(half.width) * static_cast<std::size_t>(half.height));
  for (int y = 0; y < half.height; ++y) {
    const auto* a = image.row(std::min(2 * y, image.height - 1));
    const auto* b = image.row(std::min(2 * y + 1, image.height - 1));
    for (int x = 0; x < half.width; ++x) {
      const int l = std::min(2 * x, image.width - 1);
      const int r = std::min(2 * x + 1, image.width - 1);
      half.row(y)[x] = static_cast<std::uint8_t>((a[l] + a[r] + b[l] + b[r] + 2) / 4);
    }
  }
  return half;
}

std::vector<GreyImage> make_texture(double u_m, double v_m, std::uint64_t seed) {
  const int width = std::max(8, static_cast<int>(std::ceil(u_m * kTexelsPerMetre)));
  const int height = std::max(8, static_cast<int>(std::ceil(v_m * kTexelsPerMetre)));
  std::vector<float> values(static_cast<std::size_t>(width) * static_cast<std::size_t>(height),
                            128.0F);
  add_octave(values, width, height, 96, 60, hash_u64(seed, 0));
  add_shapes(values, width, height, hash_u64(seed, 1));
  add_octave(values, width, height, 24, 40, hash_u64(seed, 2));
  add_octave(values, width, height, 7, 36, hash_u64(seed, 3));
  add_octave(values, width, height, 4, 24, hash_u64(seed, 4));
  GreyImage image{width, height, {}};
  for (const float value : values) {
    image.pixels.push_back(static_cast<std::uint8_t>(std::clamp(value, 8.0F, 247.0F)));
  }
  std::vector<GreyImage> levels = {std::move(image)};
  while (levels.size() < kLevels) levels.push_back(halved(levels.back()));
  return levels;
}

void add_faces(const Box& box, std::uint64_t seed, std::vector<Face>& faces) {
  const Eigen::Vector3d size = box.high - box.low;
  for (int axis = 0; axis < 3; ++axis) {
    for (int side = 0; side < 2; ++side) {
      const int a = axis == 0 ? 1 : 0;
      const int b = axis == 2 ? 1 : 2;
      Face face;
      face.origin = box.low;
      if (side == 1) face.origin(axis) = box.high(axis);
      face.u = Eigen::Vector3d::Unit(a);
      face.v = Eigen::Vector3d::Unit(b);
      face.n = Eigen::Vector3d::Unit(axis);
      face.levels = make_texture(size(a), size(b), hash_u64(seed, faces.size()));
      faces.push_back(std::move(face));
    }
  }
}

/// One block in the middle, the others along the walls, where paths do not come.
std::vector<Box> make_furniture(std::uint64_t seed) {
  Random random(seed);
  std::vector<Box> boxes;
  boxes.push_back({{3.6, 3.6, 0}, {4.4, 4.4, random.uniform(0.7, 1.1)}});
  for (int wall = 0; wall < 4; ++wall) {
    for (const double middle : {1.4, 3.6, 6.2}) {
      const double along = middle + random.uniform(-0.4, 0.4);
      const double half = random.uniform(0.25, 0.6);
      const double depth = random.uniform(0.2, 0.6);
      const double height = random.uniform(0.5, 2.6);
      Box box;
      const int axis = wall / 2;
      box.low(1 - axis) = along - half;
      box.high(1 - axis) = along + half;
      box.low(axis) = wall % 2 == 0 ? 0.0 : kRoomSide_m - depth;
      box.high(axis) = wall % 2 == 0 ? depth : kRoomSide_m;
      box.low(2) = 0;
      box.high(2) = height;
      boxes.push_back(box);
    }
  }
  return boxes;
}

/// What the ring leads around, and cupboards along both of its walls, of which none stands in a
/// corner.
std::vector<Box> make_cupboards(std::uint64_t seed) {
  Random random(seed);
  constexpr double kInner = kCorridorSide_m - kCorridorWidth_m;
  std::vector<Box> boxes;
  boxes.push_back({{kCorridorWidth_m, kCorridorWidth_m, 0}, {kInner, kInner, kCorridorHeight_m}});
  for (int wall = 0; wall < 8; ++wall) {
    const int axis = wall / 2 % 2;
    const bool outer = wall < 4;
    const bool low = wall % 2 == 0;
    constexpr double kFirst = 5.5, kStep = 3.5;
    for (double middle = outer ? kFirst : kFirst + kStep / 2;
         middle < kCorridorSide_m - kFirst + 0.1; middle += kStep) {
      const double along = middle + random.uniform(-0.6, 0.6);
      const double half = random.uniform(0.25, 0.7);
      const double depth = random.uniform(0.12, 0.35);
      Box box;
      box.low(1 - axis) = along - half;
      box.high(1 - axis) = along + half;
      // From the wall into the corridor.
      double from = low ? 0.0 : kCorridorSide_m - depth;
      if (!outer) from = low ? kCorridorWidth_m - depth : kInner;
      box.low(axis) = from;
      box.high(axis) = from + depth;
      box.low(2) = 0;
      box.high(2) = random.uniform(0.6, 2.4);
      boxes.push_back(box);
    }
  }
  return boxes;
}

}  // namespace

Room::Room(std::uint64_t seed, RoomKind kind)
    : size_(size_of(kind)),
      furniture_(kind == RoomKind::kRoom ? make_furniture(derive_seed(seed, "furniture"))
                                         : make_cupboards(derive_seed(seed, "furniture"))) {
  const auto texture_seed = derive_seed(seed, "textures");
  add_faces({{0, 0, 0}, size_}, texture_seed, faces_);
  for (const auto& box : furniture_) add_faces(box, texture_seed, faces_);
}

int Room::face_seen(const Eigen::Vector3f& from, const Eigen::Vector3f& direction) const {
  const Eigen::Vector3f inverse = direction.cwiseInverse();
  // Out of the room: the nearest of its planes that lies ahead.
  float nearest = std::numeric_limits<float>::max();
  int seen = 0;
  const Eigen::Vector3f room = size_.cast<float>();
  for (int axis = 0; axis < 3; ++axis) {
    const bool high = direction(axis) > 0;
    const float way = ((high ? room(axis) : 0.0F) - from(axis)) * inverse(axis);
    if (way < nearest) nearest = way, seen = 2 * axis + (high ? 1 : 0);
  }
  for (std::size_t b = 0; b < furniture_.size(); ++b) {
    float enter = 0;
    float leave = nearest;
    int side = -1;
    for (int axis = 0; axis < 3; ++axis) {
      const float low = (static_cast<float>(furniture_[b].low(axis)) - from(axis)) * inverse(axis);
      const float high =
          (static_cast<float>(furniture_[b].high(axis)) - from(axis)) * inverse(axis);
      const bool forward = low < high;
      const float in = forward ? low : high;
      leave = std::min(leave, forward ? high : low);
      if (in > enter) enter = in, side = 2 * axis + (forward ? 0 : 1);
    }
    if (side < 0 || enter >= leave) continue;
    nearest = enter;
    seen = 6 + 6 * static_cast<int>(b) + side;
  }
  return seen;
}

void add_noise(GreyImage& image, double sigma, std::uint64_t seed) {
  if (sigma <= 0) return;
  // Pixels draw from a table: a Gaussian of their own for each would take longer than the picture.
  constexpr std::size_t kTable = 1U << 14U;
  constexpr int kShift = 6;
  static const std::array<double, kTable> normal = [] {
    Gaussian gaussian(derive_seed(0, "noise table"));
    std::array<double, kTable> values{};
    for (double& value : values) value = gaussian.next();
    return values;
  }();
  std::vector<int> table(kTable);
  std::ranges::transform(normal, table.begin(), [&](double value) {
    return static_cast<int>(std::lround(value * sigma * (1 << kShift)));
  });
  std::uint64_t state = hash_u64(seed, 0) | 1U;
  for (std::size_t i = 0; i < image.pixels.size();) {
    // xorshift64 (Marsaglia, 2003): four draws of 14 bits each.
    state ^= state << 13U;
    state ^= state >> 7U;
    state ^= state << 17U;
    for (unsigned k = 0; k < 4 && i < image.pixels.size(); ++k, ++i) {
      const int noise = table[(state >> (14U * k)) & (kTable - 1)];
      const int value =
          ((static_cast<int>(image.pixels[i]) << kShift) + noise + (1 << 5)) >> kShift;
      image.pixels[i] = static_cast<std::uint8_t>(std::clamp(value, 0, 255));
    }
  }
}

}  // namespace pirt
