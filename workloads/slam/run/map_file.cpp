#include "workloads/slam/run/map_file.h"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <charconv>
#include <cmath>

#include "workloads/base/error.h"
#include "workloads/base/text/json.h"
#include "workloads/base/text/text.h"
#include "workloads/slam/filter/map_use.h"
#include "workloads/slam/filter/milestones.h"

namespace pirt::slam {
namespace {

constexpr int kVersion = 2;
constexpr std::string_view kKind = "pirt_slam_map";
constexpr std::size_t kMostFilePoints = 100'000;
constexpr std::size_t kColumns = 13;

std::string hex_of(const Descriptor& descriptor) {
  std::string text;
  for (const auto byte : descriptor) text += fmt::format("{:02x}", byte);
  return text;
}

Json row_of(const MapPoint& point) {
  const Eigen::Matrix3d& c = point.covariance;
  const Eigen::Vector3d& p = point.position;
  const Eigen::Vector3d& s = point.seen_from;
  return Json::array({p.x(), p.y(), p.z(), c(0, 0), c(0, 1), c(0, 2), c(1, 1), c(1, 2), c(2, 2),
                      s.x(), s.y(), s.z(), hex_of(point.descriptor)});
}

bool read_hex(const std::string& text, Descriptor& descriptor) {
  if (text.size() != 2 * descriptor.size()) return false;
  for (std::size_t i = 0; i < descriptor.size(); ++i) {
    const char* begin = text.data() + 2 * i;
    const auto [end, error] = std::from_chars(begin, begin + 2, descriptor[i], 16);
    if (error != std::errc() || end != begin + 2) return false;
  }
  return true;
}

/// Empty if it is a good row.
std::string problem_of(const Json& row, MapPoint& point) {
  if (!row.is_array() || row.size() != kColumns)
    return fmt::format("is no list of {} values", kColumns);
  std::array<double, kColumns - 1> v{};
  constexpr double kLargest = 1e7;
  for (std::size_t i = 0; i < v.size(); ++i) {
    if (!row[i].is_number()) return fmt::format("value {} is no number", i + 1);
    v[i] = row[i].get<double>();
    if (!std::isfinite(v[i]) || std::abs(v[i]) > kLargest) {
      return fmt::format("value {} is out of range", i + 1);
    }
  }
  point.position = {v[0], v[1], v[2]};
  point.covariance << v[3], v[4], v[5], v[4], v[6], v[7], v[5], v[7], v[8];
  if (Eigen::LLT<Eigen::Matrix3d>(point.covariance).info() != Eigen::Success) {
    return "the covariance is not positive definite";
  }
  point.seen_from = {v[9], v[10], v[11]};
  if (!row.back().is_string() || !read_hex(row.back().get<std::string>(), point.descriptor)) {
    return "the descriptor is no text of 64 hex digits";
  }
  return "";
}

}  // namespace

std::string map_text(const State& state, const Setup& setup) {
  Json points = Json::array();
  for (std::size_t i = 0; i < state.landmarks.size(); ++i) {
    points.push_back(row_of(map_point_of(state, i)));
  }
  for (const auto& p : state.map) points.push_back(row_of(p));
  if (state.in_map && setup.known != nullptr) {
    for (std::size_t i = 0; i < setup.known->size(); ++i) {
      const MapPoint& p = (*setup.known)[i];
      if (!is_taken(state, i)) points.push_back(row_of(p));
    }
  }
  const Json map = {{"schema_version", kVersion},
                    {"kind", kKind},
                    {"level", setup.imu.has_value()},
                    {"points", std::move(points)}};
  return json_text(map) + "\n";
}

std::shared_ptr<const std::vector<MapPoint>> load_map(const std::filesystem::path& file,
                                                      const Setup& setup) {
  const auto refuse = [&](const std::string& why) {
    throw_bad_input(
        fmt::format("'{}' is no usable SLAM map: {}; write one with pirt run-robot "
                    "--save-slam-map",
                    file.string(), why));
  };
  const Json map = try_parse_json(read_text(file)).value_or(Json());
  if (!map.is_object()) refuse("it is no JSON object");
  if (!map.contains("kind") || map["kind"] != kKind) refuse("its kind is not pirt_slam_map");
  if (!map.contains("schema_version") || map["schema_version"] != kVersion) {
    refuse(fmt::format("its schema_version is not {}", kVersion));
  }
  if (!map.contains("level") || !map["level"].is_boolean()) refuse("it has no 'level'");
  if (setup.imu && !map["level"].get<bool>()) {
    refuse("it was made without an IMU, and this run has one: which way is up is not known in it");
  }
  if (!map.contains("points") || !map["points"].is_array()) refuse("it has no list of points");
  const Json& points = map["points"];
  if (points.size() > kMostFilePoints) {
    refuse(fmt::format("it has {} points, expected at most {}", points.size(), kMostFilePoints));
  }
  std::vector<MapPoint> known;
  for (std::size_t i = 0; i < points.size(); ++i) {
    MapPoint point;
    const std::string problem = problem_of(points[i], point);
    if (!problem.empty()) refuse(fmt::format("point {}: {}", i, problem));
    known.push_back(point);
  }
  return std::make_shared<const std::vector<MapPoint>>(std::move(known));
}

}  // namespace pirt::slam
