// KITTI odometry folders: rectified pictures, no IMU. Geiger et al., CVPR 2012.
#include <fmt/core.h>

#include <algorithm>
#include <cmath>

#include "workloads/base/error.h"
#include "workloads/base/math/pixel_index.h"
#include "workloads/inputs/pictures/images.h"
#include "workloads/inputs/sequence/sequence.h"
#include "workloads/inputs/sequence/table_file.h"

namespace pirt {
namespace {

namespace fs = std::filesystem;

constexpr double kUsualRate_hz = 10.0;

/// Rows of 12 numbers, of which calib.txt may begin with "P0:".
std::vector<std::array<double, 12>> read_matrices(const fs::path& file, bool labelled) {
  std::vector<std::array<double, 12>> matrices;
  for (const auto& row : read_table(file, ' ', 0)) {
    const bool label = labelled && row.size() == 13 && row.text(0).ends_with(':');
    if (label && !row.text(0).starts_with('P')) continue;  // Tr: to the laser scanner
    const std::size_t first = label ? 1 : 0;
    if (row.size() != first + 12) {
      row.fail(fmt::format("has {} numbers, expected a 3x4 matrix, row by row", row.size()));
    }
    std::array<double, 12> matrix{};
    for (std::size_t i = 0; i < 12; ++i) matrix[i] = row.number(first + i);
    matrices.push_back(matrix);
  }
  return matrices;
}

fs::path first_of(const fs::path& folder, std::initializer_list<const char*> names) {
  for (const char* name : names) {
    if (fs::is_directory(folder / name)) return folder / name;
  }
  return {};
}

CameraModel camera_of(const std::array<double, 12>& p, const fs::path& file) {
  CameraModel camera;
  camera.fx = p[0], camera.fy = p[5], camera.cx = p[2], camera.cy = p[6];
  if (camera.fx < 10 || camera.fy < 10 || p[10] != 1.0) {
    throw_bad_input("'" + file.string() + "': this is no projection matrix of a rectified camera");
  }
  camera.body_from_camera.position.x() = -p[3] / camera.fx;  // body = camera 0
  camera.rate_hz = kUsualRate_hz;
  return camera;
}

void read_times(const fs::path& folder, Sequence& sequence, std::size_t count) {
  const fs::path file = folder / "times.txt";
  if (!fs::exists(file)) {
    sequence.warnings.push_back("no times.txt: frames are taken to be 0.1 s apart");
    for (std::size_t i = 0; i < count; ++i) {
      sequence.frames.push_back({from_s(static_cast<double>(i) / kUsualRate_hz), {}});
    }
    return;
  }
  for (const auto& row : read_table(file, ' ', 1)) {
    const Nanos time = from_s(row.number(0));
    if (!sequence.frames.empty()) check_rises(row, sequence.frames.back().time, time);
    sequence.frames.push_back({time, {}});
  }
  if (sequence.frames.size() != count) {
    throw_bad_input(fmt::format("'{}' has {} times for {} pictures", file.string(),
                                sequence.frames.size(), count));
  }
}

void read_poses(const fs::path& file, Sequence& sequence) {
  if (!fs::exists(file)) return;
  const auto poses = read_matrices(file, false);
  if (poses.size() != sequence.frames.size()) {
    throw_bad_input(fmt::format("'{}' has {} poses for {} pictures", file.string(), poses.size(),
                                sequence.frames.size()));
  }
  for (std::size_t i = 0; i < poses.size(); ++i) {
    TruthRow row;
    row.time = sequence.frames[i].time;
    for (int r = 0; r < 3; ++r) {
      for (int c = 0; c < 3; ++c) {
        row.body.rotation(r, c) = poses[i][pixel_index(c, r, 4)];
      }
      row.body.position(r) = poses[i][pixel_index(3, r, 4)];
    }
    if (!(row.body.rotation * row.body.rotation.transpose()).isIdentity(1e-3)) {
      throw_bad_input(
          fmt::format("'{}': pose {} is no rotation and translation", file.string(), i));
    }
    row.body.rotation = nearest_rotation(row.body.rotation);
    sequence.truth.push_back(row);
  }
}

}  // namespace

Sequence read_kitti(const fs::path& folder) {
  Sequence sequence;
  sequence.name = folder.string();
  const fs::path calibration = folder / "calib.txt";
  if (!fs::exists(calibration)) {
    throw_bad_input("the calibration '" + calibration.string() +
                    "' is missing; a sequence needs it");
  }
  const auto matrices = read_matrices(calibration, true);
  std::vector<std::vector<fs::path>> files;
  const fs::path left = first_of(folder, {"image_0", "image_l"});
  if (left.empty()) throw_bad_input("'" + folder.string() + "' has neither image_0 nor image_l");
  files.push_back(pictures_of(left));
  if (const fs::path right = first_of(folder, {"image_1", "image_r"}); !right.empty()) {
    files.push_back(pictures_of(right));
    if (matrices.size() < 2) throw_bad_input("'" + calibration.string() + "' has no P1");
    if (files[1].size() != files[0].size()) {
      throw_bad_input(fmt::format("'{}' has {} left and {} right pictures", folder.string(),
                                  files[0].size(), files[1].size()));
    }
  }
  read_times(folder, sequence, files[0].size());
  for (auto& frame : sequence.frames) frame.present.assign(files.size(), true);
  const GreySize size = grey_size(files[0].front());
  for (std::size_t i = 0; i < files.size(); ++i) {
    sequence.cameras.push_back(camera_of(matrices[i], calibration));
    sequence.cameras.back().width = size.width;
    sequence.cameras.back().height = size.height;
  }
  read_poses(folder / "poses.txt", sequence);
  sequence.image = [files, size](std::size_t frame, std::size_t camera) {
    return read_grey_image(files[camera][frame], size.width, size.height);
  };
  std::ranges::move(gaps_of(sequence), std::back_inserter(sequence.warnings));
  return sequence;
}

}  // namespace pirt
