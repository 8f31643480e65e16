// KITTI odometry folders: rectified pictures, no IMU. Geiger et al., CVPR 2012.
#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <charconv>
#include <cmath>
#include <map>
#include <memory>
#include <optional>

#include "workloads/base/error.h"
#include "workloads/base/math/pixel_index.h"
#include "workloads/base/text/text.h"
#include "workloads/inputs/pictures/image_format.h"
#include "workloads/inputs/pictures/images.h"
#include "workloads/inputs/recording/first_message.h"
#include "workloads/inputs/sequence/camera_info.h"
#include "workloads/inputs/sequence/sequence.h"
#include "workloads/inputs/sequence/stamps.h"
#include "workloads/inputs/sequence/table_file.h"
#include "workloads/inputs/sequence/trajectory.h"

namespace pirt {
namespace {

namespace fs = std::filesystem;

constexpr double kUsualRate_hz = 10.0;

using Matrix34 = std::array<double, 12>;

/// @param first  The column that it begins in.
Matrix34 matrix_of(const TableRow& row, std::size_t first = 0) {
  if (row.size() != first + 12) {
    row.fail(fmt::format("has {} numbers, expected a 3x4 matrix, row by row", row.size()));
  }
  Matrix34 matrix{};
  for (std::size_t i = 0; i < 12; ++i) matrix[i] = row.number(first + i);
  return matrix;
}

/// P0 and P1 by their labels; without any, row by row.
Matrix34 projection_of(const fs::path& file, std::size_t camera) {
  const auto rows = read_table(file, ' ', 0);
  const auto has_label = [](const TableRow& row) { return row.text(0).ends_with(':'); };
  const std::string label = fmt::format("P{}", camera);
  if (std::ranges::none_of(rows, has_label)) {
    if (camera >= rows.size()) throw_bad_input("'" + file.string() + "' has no " + label);
    return matrix_of(rows[camera]);
  }
  const auto found = std::ranges::find(rows, label + ":", [](const auto& r) { return r.text(0); });
  if (found == rows.end()) throw_bad_input("'" + file.string() + "' has no " + label);
  return matrix_of(*found, 1);
}

using Number = std::uint64_t;

/// By the number in their names, the last one: "9.png" is before "10.png". What stands before it is
/// the same of all, or the number is a part of what orders them, such as a second's fraction.
std::map<Number, fs::path> numbered_pictures(const fs::path& folder) {
  constexpr std::string_view kDigits = "0123456789";
  std::map<Number, fs::path> pictures;
  std::optional<std::string> first;  // A name up to its number, and of a fraction its length.
  for (const fs::path& file : pictures_of(folder)) {
    const std::string name = file.stem().string();
    const auto end = name.find_last_of(kDigits);
    const auto before = name.find_last_not_of(kDigits, end);
    const std::size_t begin = before == std::string::npos ? 0 : before + 1;
    Number number = 0;
    if (end == std::string::npos ||
        std::from_chars(name.data() + begin, name.data() + end + 1, number).ec != std::errc()) {
      throw_bad_input("'" + file.string() +
                      "' has no number in its name, which says where in the sequence it belongs");
    }
    std::string around = name.substr(0, begin);
    if (around.ends_with('.')) around += std::to_string(end - begin);
    if (first.value_or(around) != around) {
      throw_bad_input(fmt::format(
          "'{}': names have more than one number that differs, so that nobody knows their order; "
          "number them from 000000.png on, with their times in times.txt",
          file.string()));
    }
    first = around;
    const auto [place, is_new] = pictures.emplace(number, file);
    if (!is_new) {
      throw_bad_input(fmt::format("'{}' and '{}' have the same number; take one of them away",
                                  place->second.string(), file.string()));
    }
  }
  return pictures;
}

fs::path first_of(const fs::path& folder, std::initializer_list<const char*> names) {
  for (const char* name : names) {
    if (fs::is_directory(folder / name)) return folder / name;
  }
  return {};
}

CameraModel camera_of(const Matrix34& p, const fs::path& file) {
  CameraModel camera;
  camera.fx = p[0], camera.fy = p[5], camera.cx = p[2], camera.cy = p[6];
  if (p[10] != 1.0) {
    throw_bad_input("'" + file.string() + "': this is no projection matrix of a rectified camera");
  }
  camera.body_from_camera.position.x() = -p[3] / camera.fx;  // body = camera 0
  camera.rate_hz = kUsualRate_hz;
  return camera;
}

/// Which row is of which picture: each has one, or they are counted from picture 0 on.
std::vector<std::size_t> rows_of(const fs::path& file, std::size_t rows, const char* what,
                                 const std::vector<Number>& numbers) {
  const bool each = rows == numbers.size();
  if (!each && numbers.back() >= rows) {
    throw_bad_input(fmt::format("'{}' has {} {} for {} pictures, of numbers up to {}",
                                file.string(), rows, what, numbers.size(), numbers.back()));
  }
  std::vector<std::size_t> positions;
  for (std::size_t i = 0; i < numbers.size(); ++i) positions.push_back(each ? i : numbers[i]);
  return positions;
}

/// What a picture's header says: the calibration does not.
ImageHeader header_of(const fs::path& file) {
  constexpr std::int64_t kMostAcross = 20000;
  const ImageCheck check = check_image(read_file(file));
  const bool is_large =
      check.header && std::max(check.header->width, check.header->height) > kMostAcross;
  if (check.header && !is_large) return *check.header;
  throw_bad_input("cannot use the picture '" + file.string() +
                  "': " + (is_large ? "it is larger than 20000 pixels" : check.problem));
}

/// Of each picture; they need not rise.
std::vector<Nanos> read_times(const fs::path& folder, Sequence& sequence,
                              const std::vector<Number>& numbers) {
  const fs::path file = folder / "times.txt";
  std::vector<Nanos> times;
  if (!fs::exists(file)) {
    sequence.warnings.push_back("no times.txt: frames are taken to be 0.1 s apart");
    // Numbers of pictures that were lost leave a gap; others are no numbers of frames.
    const bool counts = numbers.back() - numbers.front() < 2 * numbers.size();
    for (std::size_t i = 0; i < numbers.size(); ++i) {
      const Number frame = counts ? numbers[i] - numbers.front() : i;
      times.push_back(from_s(static_cast<double>(frame) / kUsualRate_hz));
    }
    return times;
  }
  const auto rows = read_table(file, ' ', 1);
  for (const std::size_t row : rows_of(file, rows.size(), "times", numbers)) {
    times.push_back(rows[row].seconds(0));
  }
  return times;
}

/// By the left picture, all of one number.
struct Shot {
  Nanos time{};
  std::size_t place = 0;  ///< Among those of the left camera.
  fs::path left;
  std::optional<fs::path> right;
};

/// Truth may end before the pictures do.
void read_poses(const fs::path& file, Sequence& sequence, std::vector<Number> numbers,
                const std::vector<Shot>& shots) {
  const auto poses = read_table(file, ' ', 0);
  if (poses.size() < numbers.size() && numbers.front() == 0) {
    std::erase_if(numbers, [&poses](Number number) { return number >= poses.size(); });
  }
  const auto rows = rows_of(file, poses.size(), "poses", numbers);
  for (const Shot& shot : shots) {
    if (shot.place >= rows.size()) continue;
    const TableRow& from = poses[rows[shot.place]];
    const Matrix34 pose = matrix_of(from);
    TruthRow row;
    row.time = shot.time;
    for (int r = 0; r < 3; ++r) {
      for (int c = 0; c < 3; ++c) row.body.rotation(r, c) = pose[pixel_index(c, r, 4)];
      row.body.position(r) = pose[pixel_index(3, r, 4)];
    }
    const auto rotation = checked_rotation(row.body.rotation);
    if (!rotation) from.fail("is no rotation and translation");
    row.body.rotation = *rotation;
    sequence.truth.push_back(row);
  }
  if (sequence.truth.size() < shots.size()) {
    sequence.warnings.push_back(fmt::format("'{}' has no poses of {} of {} pictures", file.string(),
                                            shots.size() - sequence.truth.size(), shots.size()));
  }
}

}  // namespace

Sequence read_kitti(const fs::path& folder, const ReadOptions& options) {
  Sequence sequence;
  sequence.name = folder.string();
  const fs::path calibration = folder / "calib.txt";
  if (!fs::exists(calibration)) {
    throw_bad_input("the calibration '" + calibration.string() +
                    "' is missing; a sequence needs it");
  }
  const fs::path left = first_of(folder, {"image_0", "image_l"});
  if (left.empty()) throw_bad_input("'" + folder.string() + "' has neither image_0 nor image_l");
  const fs::path right =
      options.second_camera ? first_of(folder, {"image_1", "image_r"}) : fs::path();
  const auto others = right.empty() ? std::map<Number, fs::path>() : numbered_pictures(right);
  std::vector<Number> numbers;
  std::vector<Shot> shots;
  for (const auto& [number, file] : numbered_pictures(left)) {
    const auto other = others.find(number);
    shots.push_back({.place = numbers.size(), .left = file, .right = {}});
    if (other != others.end()) shots.back().right = other->second;
    numbers.push_back(number);
  }
  const auto times = read_times(folder, sequence, numbers);
  for (std::size_t i = 0; i < shots.size(); ++i) shots[i].time = times[i];
  const std::string what = "'" + (folder / "times.txt").string() + "'";
  keep_rising(shots, what, sequence.warnings);
  check_step(what, stamps_of(shots), std::nullopt, kFinestPicture_s);
  Partners partners;
  for (std::size_t i = 0; i < shots.size() && !right.empty(); ++i) {
    partners.push_back(shots[i].right ? std::optional(i) : std::nullopt);
  }
  const ImageHeader header =
      first_usable(shots.size(), [&shots](std::size_t i) { return header_of(shots[i].left); });
  const auto width = static_cast<int>(header.width), height = static_cast<int>(header.height);
  for (std::size_t i = 0; i < (right.empty() ? 1U : 2U); ++i) {
    CameraModel camera = camera_of(projection_of(calibration, i), calibration);
    camera.width = width;
    camera.height = height;
    const std::string problem = no_pinhole(camera);
    if (!problem.empty()) throw_bad_input("'" + calibration.string() + "': " + problem);
    sequence.cameras.push_back(camera);
  }
  if (sequence.cameras.size() > 1 && !(sequence.cameras[1].body_from_camera.position.x() > 0)) {
    sequence.warnings.push_back("'" + calibration.string() +
                                "': P1 does not put camera 1 to the right of camera 0 (its 4th "
                                "number is below 0 then); its pictures are not used");
    sequence.cameras.resize(1);
    partners.clear();
  }
  make_frames(sequence, stamps_of(shots), partners,
              {left.filename().string(), right.filename().string()});
  const fs::path poses = folder / "poses.txt";
  if (options.truth.empty() && fs::exists(poses)) {
    take_truth(sequence, "poses.txt", [&] { read_poses(poses, sequence, numbers, shots); });
  }
  sequence.image = [shots, width, height,
                    deep = std::make_shared<std::array<std::atomic<bool>, 2>>()](
                       std::size_t frame, std::size_t camera) {
    const Shot& shot = shots[frame];
    return read_grey_image(camera == 0 ? shot.left : shot.right.value(), width, height,
                           &deep->at(camera));
  };
  return sequence;
}

}  // namespace pirt
