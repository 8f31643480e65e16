// What a camera in the room sees: for each block of pixels the face, then texture through one
// homography a face and pose.
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "workloads/base/math/pixel_index.h"
#include "workloads/inputs/scene/room.h"

namespace pirt {
namespace {

constexpr int kBlock = 8;

/// Between texels, at texel coordinates; beyond the rim the rim goes on.
float sampled(const GreyImage& level, float u, float v) {
  u = std::clamp(u, 0.0F, static_cast<float>(level.width - 1) - 1e-3F);
  v = std::clamp(v, 0.0F, static_cast<float>(level.height - 1) - 1e-3F);
  const int x = static_cast<int>(u);
  const int y = static_cast<int>(v);
  const float fx = u - static_cast<float>(x);
  const float fy = v - static_cast<float>(y);
  const auto* a = level.row(y) + x;
  const auto* b = a + level.width;
  const float top = static_cast<float>(a[0]) + fx * static_cast<float>(a[1] - a[0]);
  const float low = static_cast<float>(b[0]) + fx * static_cast<float>(b[1] - b[0]);
  return top + fy * (low - top);
}

/// Of level k, whose texels are averages of 2^k x 2^k.
float sampled_at(const Face& face, std::size_t k, float u, float v) {
  const float scale = 1.0F / static_cast<float>(1U << k);
  return sampled(face.levels[k], (u + 0.5F) * scale - 0.5F, (v + 0.5F) * scale - 0.5F);
}

struct Detail {
  std::size_t level = 0;
  float part = 0;  ///< Of the next coarser level.
};

}  // namespace

/// Rays (x, y, 1) to texels: u = (hu . ray) / (hw . ray), v alike.
struct RoomCamera::Homography {
  Eigen::Vector3f hu, hv, hw;

  void at(float x, float y, float& u, float& v) const {
    const float w = 1.0F / (hw.x() * x + hw.y() * y + hw.z());
    u = (hu.x() * x + hu.y() * y + hu.z()) * w;
    v = (hv.x() * x + hv.y() * y + hv.z()) * w;
  }

  /// How coarse the texture must be taken so that a pixel of @p step does not skip texels.
  [[nodiscard]] Detail detail(float x, float y, float step, std::size_t levels) const {
    float u = 0, v = 0, ux = 0, vx = 0, uy = 0, vy = 0;
    at(x, y, u, v);
    at(x + step, y, ux, vx);
    at(x, y + step, uy, vy);
    const float footprint = std::max(std::hypot(ux - u, vx - v), std::hypot(uy - u, vy - v));
    const float level = std::clamp(std::log2(std::max(footprint, 1e-3F)), 0.0F,
                                   static_cast<float>(levels) - 1.001F);
    return {static_cast<std::size_t>(level), level - std::floor(level)};
  }
};

RoomCamera::RoomCamera(const Room& room, const CameraModel& camera)
    : room_(&room), camera_(camera) {
  for (int y = 0; y < camera.height; ++y) {
    for (int x = 0; x < camera.width; ++x) {
      const Eigen::Vector2d ray = camera.ray({x, y});
      x_.push_back(static_cast<float>(ray.x()));
      y_.push_back(static_cast<float>(ray.y()));
    }
  }
}

RoomCamera::Homography RoomCamera::homography(const Face& face, const Pose& pose) const {
  const double height = face.n.dot(face.origin - pose.position);
  const Eigen::Vector3d offset = pose.position - face.origin;
  const auto row = [&](const Eigen::Vector3d& axis) -> Eigen::Vector3f {
    const Eigen::Vector3d along = height * axis + offset.dot(axis) * face.n;
    // Texel k covers the metres from k to k + 1 over the density.
    const Eigen::Vector3d texels = kTexelsPerMetre * along - 0.5 * face.n;
    return (pose.rotation.transpose() * texels).cast<float>();
  };
  return {row(face.u), row(face.v), (pose.rotation.transpose() * face.n).cast<float>()};
}

void RoomCamera::find_faces(const Pose& pose, std::vector<std::int16_t>& faces) const {
  const int width = camera_.width;
  const int height = camera_.height;
  const Eigen::Matrix3f rotation = pose.rotation.cast<float>();
  const Eigen::Vector3f from = pose.position.cast<float>();
  const auto seen = [&](int x, int y) {
    const auto i = pixel_index(x, y, width);
    return static_cast<std::int16_t>(
        room_->face_seen(from, rotation * Eigen::Vector3f(x_[i], y_[i], 1.0F)));
  };
  faces.resize(x_.size());
  const auto index = [&](int x, int y) { return pixel_index(x, y, width); };
  // Rims of blocks first, their insides only where the rim is not all one face: boxes are convex
  // and larger than a block, so that nothing lies inside without crossing it.
  const auto last = [](int from_pixel, int size) {
    return std::min(from_pixel + kBlock, size - 1);
  };
  for (int y0 = 0; y0 < height; y0 += kBlock) {
    const int y1 = last(y0, height);
    for (int x0 = 0; x0 < width; x0 += kBlock) {
      const int x1 = last(x0, width);
      const auto a = seen(x0, y0);
      bool same = a == seen(x1, y0) && a == seen(x0, y1) && a == seen(x1, y1);
      same = same && a == seen((x0 + x1) / 2, y0) && a == seen(x0, (y0 + y1) / 2) &&
             a == seen((x0 + x1) / 2, y1) && a == seen(x1, (y0 + y1) / 2);
      for (int y = y0; y <= y1; ++y) {
        for (int x = x0; x <= x1; ++x) faces[index(x, y)] = same ? a : seen(x, y);
      }
    }
  }
}

GreyImage RoomCamera::picture(std::span<const Pose> poses) const {
  std::vector<std::int16_t> faces;
  find_faces(poses[poses.size() / 2], faces);
  std::vector<Homography> maps;  // by face, then pose
  for (const auto& face : room_->faces()) {
    for (const auto& pose : poses) maps.push_back(homography(face, pose));
  }
  GreyImage image{camera_.width, camera_.height, {}};
  image.pixels.resize(x_.size());
  const auto step = static_cast<float>(1.0 / camera_.focal());
  const float share = 1.0F / static_cast<float>(poses.size());
  for (int y = 0; y < image.height; ++y) {
    int of_face = -1;
    Detail detail;
    for (int x = 0; x < image.width; ++x) {
      const auto i = pixel_index(x, y, image.width);
      const Face& face = room_->faces()[static_cast<std::size_t>(faces[i])];
      const Homography* map = &maps[static_cast<std::size_t>(faces[i]) * poses.size()];
      if (faces[i] != of_face || x % kBlock == 0) {
        of_face = faces[i];
        detail = map->detail(x_[i], y_[i], step, face.levels.size());
      }
      float sum = 0;
      for (std::size_t k = 0; k < poses.size(); ++k) {
        float u = 0;
        float v = 0;
        map[k].at(x_[i], y_[i], u, v);
        const float fine = sampled_at(face, detail.level, u, v);
        if (detail.part < 0.02F) {
          sum += fine;
        } else {
          sum += fine + detail.part * (sampled_at(face, detail.level + 1, u, v) - fine);
        }
      }
      // NOLINTNEXTLINE(bugprone-incorrect-roundings): a half is nowhere near, in no picture.
      image.pixels[i] = static_cast<std::uint8_t>(sum * share + 0.5F);
    }
  }
  return image;
}

}  // namespace pirt
