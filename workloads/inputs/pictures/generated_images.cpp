// Pictures made from a seed: value noise of several octaves, as surfaces have, with rectangles on
// it, which bring edges and corners.
//
// Integers only, so that every compiler makes the same pictures. Positions are in 1/8 pixel: a
// picture can be moved by less than a pixel.
#include <algorithm>
#include <array>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "workloads/base/math/pixel_index.h"
#include "workloads/base/math/random.h"
#include "workloads/inputs/pictures/images.h"

namespace pirt {
namespace {

constexpr int kLog2Subpixels = 3;
constexpr int kSubpixels = 1 << kLog2Subpixels;

/// From frame to frame of a sequence, in 1/8 pixel: right by 0.75 and up by 0.5 pixels.
struct Shift {
  int x = 0;
  int y = 0;
};
constexpr Shift kMotion = {6, -4};

/// One octave: a lattice of random values, interpolated linearly.
struct Octave {
  int log2_cell;  ///< Of the lattice's spacing in pixels.
  int weight;     ///< Amplitude; all octaves together 256.
};
constexpr std::array<Octave, 5> kOctaves = {{{6, 104}, {5, 64}, {4, 40}, {3, 28}, {2, 20}}};

/// floor(a / b), b > 0.
constexpr int floor_div(int a, int b) { return a >= 0 ? a / b : -((b - 1 - a) / b); }

/// Random value of a lattice point, 0 .. 255.
int lattice(std::uint64_t seed, int x, int y) {
  return static_cast<int>(hash_lattice(seed, y, x) >> 56);
}

/// Rows of one octave, from top to bottom: each row of the lattice is drawn once.
class OctaveRows {
 public:
  OctaveRows(const Octave& octave, std::uint64_t seed, int shift_x, int width)
      : weight_(octave.weight),
        log2_cell_(octave.log2_cell + kLog2Subpixels),
        seed_(seed),
        left_(floor_div(-shift_x, 1 << log2_cell_)),
        across_(-shift_x - (left_ << log2_cell_)) {
    const auto columns = static_cast<std::size_t>(width >> octave.log2_cell) + 3;
    upper_.resize(columns);
    lower_.resize(columns);
  }

  /// Adds the octave at height @p y (in 1/8 pixel), times its weight, to a row of sums.
  void add(int y, std::vector<int>& row) {
    const int cell = 1 << log2_cell_;
    draw(floor_div(y, cell));
    const int down = y - (*top_ << log2_cell_);
    // A column of the lattice, interpolated vertically, times cell.
    const auto column = [&](std::size_t i) { return upper_[i] * (cell - down) + lower_[i] * down; };
    int across = across_;
    int from = column(0);
    for (std::size_t x = 0, i = 1; x < row.size(); ++i) {
      const int to = column(i);
      // Both interpolations scale by cell <= 512; 255 * 512 * 512 fits.
      int value = from * (cell - across) + to * across;
      for (; across < cell && x < row.size(); across += kSubpixels, ++x) {
        row[x] += weight_ * (value >> (2 * log2_cell_));
        value += kSubpixels * (to - from);
      }
      across -= cell;
      from = to;
    }
  }

 private:
  void draw(int top) {
    if (top_ == top) return;
    const auto draw_row = [&](int y, std::vector<int>& row) {
      int x = left_;
      for (int& value : row) value = lattice(seed_, x++, y);
    };
    if (top_ && *top_ + 1 == top) {
      std::swap(upper_, lower_);
    } else {
      draw_row(top, upper_);
    }
    draw_row(top + 1, lower_);
    top_ = top;
  }

  int weight_;
  int log2_cell_;  ///< Of the lattice's spacing in 1/8 pixel.
  std::uint64_t seed_;
  int left_, across_;  ///< Of the first pixel: its column of the lattice, and how far from there.
  std::optional<int> top_;
  std::vector<int> upper_, lower_;  ///< Rows of the lattice at top_ and below it.
};

/// Edges in 1/8 pixel.
struct Rectangle {
  int left, top, right, bottom;
  int level;  ///< 0 .. 255.
};

std::vector<Rectangle> make_rectangles(std::uint64_t seed, int width, int height) {
  constexpr std::int64_t kPixelsPerRectangle = 6'000;
  const auto count = std::int64_t{width} * height / kPixelsPerRectangle;
  Random random(derive_seed(seed, "rectangles"));
  const auto below = [&](int n) {
    return static_cast<int>(random.below(static_cast<std::uint64_t>(n)));
  };
  // One draw a statement: the order of calls within an expression is the compiler's.
  const auto extent = [&] {
    const int pixels = 8 + below(56);
    return pixels * kSubpixels + below(kSubpixels);
  };
  std::vector<Rectangle> rectangles;
  for (std::int64_t i = 0; i < count; ++i) {
    Rectangle r{};
    r.left = below(width * kSubpixels);
    r.top = below(height * kSubpixels);
    r.right = r.left + extent();
    r.bottom = r.top + extent();
    r.level = below(256);
    rectangles.push_back(r);
  }
  return rectangles;
}

/// How much of the pixel @p at lies between two edges, in 1/8.
int coverage(int at, int low, int high) {
  const int begin = at * kSubpixels;
  return std::max(0, std::min(high, begin + kSubpixels) - std::max(low, begin));
}

/// Paints three quarters opaque, so that the texture stays visible.
void paint(const Rectangle& r, const Shift& shift, int width, int height,
           std::span<std::uint8_t> pixels) {
  const auto clip = [](int edge, int limit) {
    return std::clamp(floor_div(edge, kSubpixels), 0, limit);
  };
  const int left = r.left + shift.x, right = r.right + shift.x;
  const int top = r.top + shift.y, bottom = r.bottom + shift.y;
  for (int y = clip(top, height); y < clip(bottom + kSubpixels - 1, height); ++y) {
    for (int x = clip(left, width); x < clip(right + kSubpixels - 1, width); ++x) {
      auto& pixel = pixels[pixel_index(x, y, width)];
      const int share = coverage(x, left, right) * coverage(y, top, bottom);  // of 64
      pixel = static_cast<std::uint8_t>(pixel + (r.level - pixel) * share * 3 / (64 * 4));
    }
  }
}

/// Renders one grey plane whose content is moved by @p shift.
void render(std::uint64_t seed, const Shift& shift, int width, int height,
            std::span<std::uint8_t> pixels) {
  std::vector<int> row(static_cast<std::size_t>(width));
  std::vector<OctaveRows> octaves;
  for (std::size_t i = 0; i < kOctaves.size(); ++i) {
    octaves.emplace_back(kOctaves[i], hash_u64(seed, i), shift.x, width);
  }
  auto* out = pixels.data();
  for (int y = 0; y < height; ++y) {
    std::ranges::fill(row, 0);
    for (OctaveRows& octave : octaves) octave.add(y * kSubpixels - shift.y, row);
    for (const int sum : row) {
      // Averages of random values crowd around the middle: stretch by 1.5.
      const int level = sum / 256;
      *out++ = static_cast<std::uint8_t>(std::clamp(128 + (level - 128) * 3 / 2, 0, 255));
    }
  }
  for (const auto& rectangle : make_rectangles(seed, width, height)) {
    paint(rectangle, shift, width, height, pixels);
  }
}

class GeneratedImages : public ImageSource {
 public:
  explicit GeneratedImages(std::uint64_t seed) : seed_(seed) {}

  Picture gray(int index, int width, int height) const override {
    return moved(index, width, height, {});
  }

  Picture rgb(int index, int width, int height) const override {
    const Picture luma = gray(index, width, height);
    Picture picture{Tensor({"image", Element::kU8, {3, height, width}}), {}};
    const auto light = luma.pixels.as<std::uint8_t>();
    const auto planes = picture.pixels.as<std::uint8_t>();
    for (std::size_t channel = 0; channel < 3; ++channel) {
      const auto plane = planes.subspan(channel * light.size(), light.size());
      render(hash_u64(picture_seed(index), channel), {}, width, height, plane);
      // Channels of real pictures have most of their structure in common.
      for (std::size_t i = 0; i < light.size(); ++i) {
        plane[i] = static_cast<std::uint8_t>((3 * light[i] + plane[i]) / 4);
      }
    }
    return picture;
  }

  Picture gray_frame(int index, int frame, int width, int height) const override {
    return moved(index, width, height, {kMotion.x * frame, kMotion.y * frame});
  }

  std::string describe() const override { return "generated, seed " + std::to_string(seed_); }

  std::uint64_t content_hash() const override { return derive_seed(seed_, "generated pictures 1"); }

 private:
  std::uint64_t picture_seed(int index) const {
    return hash_u64(derive_seed(seed_, "picture"), static_cast<std::uint64_t>(index));
  }

  Picture moved(int index, int width, int height, const Shift& shift) const {
    Picture picture{Tensor({"image", Element::kU8, {height, width}}), {}};
    render(picture_seed(index), shift, width, height, picture.pixels.as<std::uint8_t>());
    return picture;
  }

  std::uint64_t seed_;
};

}  // namespace

std::unique_ptr<ImageSource> generated_images(std::uint64_t seed) {
  return std::make_unique<GeneratedImages>(seed);
}

}  // namespace pirt
