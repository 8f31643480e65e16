#include "workloads/mapping/bal.h"

#include <fmt/format.h>

#include <cctype>
#include <cmath>
#include <iterator>
#include <string_view>

#include "workloads/base/text/numbers.h"
#include "workloads/base/text/text.h"
#include "workloads/mapping/reprojection.h"

namespace pirt::mapping {
namespace {

constexpr std::size_t kMostBytes = std::size_t{1} << 30;
constexpr std::int32_t kMostOfAKind = 50'000'000;
/// Beyond, a pixel, a coordinate or a focal length is damage; squares of them still add up.
constexpr double kLargest = 1e100;

/// The numbers of a file, with blanks and newlines between them.
class Numbers {
 public:
  explicit Numbers(const std::filesystem::path& file)
      : file_(file.string()), text_(read_text(file, kMostBytes)) {}

  std::int32_t index(std::int32_t low, std::int32_t high, std::string_view what) {
    return read(whole_number(take(what), low, high), what);
  }
  double number(std::string_view what) {
    return read(decimal_number(take(what), -kLargest, kLargest), what);
  }
  /// How many bytes are left, each number taking at least two.
  [[nodiscard]] std::size_t left() const { return text_.size() - at_; }
  void expect_end() {
    skip_blanks();
    if (left() > 0) fail("there is more than the first line says");
  }
  [[noreturn]] void fail(const std::string& message) const {
    throw_bad_input(fmt::format("{}:{}: {}", file_, line_, message));
  }

 private:
  void skip_blanks() {
    for (; at_ < text_.size() && std::isspace(static_cast<unsigned char>(text_[at_])) != 0; ++at_) {
      if (text_[at_] == '\n') ++line_;
    }
  }
  std::string_view take(std::string_view what) {
    skip_blanks();
    const std::size_t begin = at_;
    while (at_ < text_.size() && std::isspace(static_cast<unsigned char>(text_[at_])) == 0) ++at_;
    if (at_ == begin) fail(fmt::format("the file ends where a {} should be", what));
    return std::string_view(text_).substr(begin, at_ - begin);
  }
  template <typename T>
  T read(const NumberRead<T>& value, std::string_view what) const {
    if (!value.value) fail(fmt::format("the {} {}", what, value.problem));
    return *value.value;
  }

  std::string file_;
  std::string text_;
  std::size_t at_ = 0;
  int line_ = 1;
};

}  // namespace

BalProblem read_bal(const std::filesystem::path& file) {
  Numbers numbers(file);
  const auto cameras = numbers.index(1, kMostOfAKind, "number of cameras");
  const auto points = numbers.index(1, kMostOfAKind, "number of points");
  const auto observations = numbers.index(1, kMostOfAKind, "number of observations");
  const std::size_t camera_numbers = static_cast<std::size_t>(cameras) * kCameraSize;
  const std::size_t point_numbers = static_cast<std::size_t>(points) * kPointSize;
  // Before memory is taken for what the first line claims.
  const std::size_t all =
      camera_numbers + point_numbers + static_cast<std::size_t>(observations) * 4;
  if (numbers.left() < 2 * all - 1) {
    numbers.fail(fmt::format(
        "{} cameras, {} points and {} observations are {} numbers, and the file ends before",
        cameras, points, observations, all));
  }
  BalProblem problem;
  problem.observations.reserve(static_cast<std::size_t>(observations));
  for (std::int32_t i = 0; i < observations; ++i) {
    Observation observation;
    observation.camera = numbers.index(0, cameras - 1, "camera of an observation");
    observation.point = numbers.index(0, points - 1, "point of an observation");
    observation.x = numbers.number("x of an observation");
    observation.y = numbers.number("y of an observation");
    problem.observations.push_back(observation);
  }
  for (std::size_t i = 0; i < camera_numbers; ++i) {
    problem.cameras.push_back(numbers.number("parameter of a camera"));
  }
  for (std::size_t i = 0; i < point_numbers; ++i) {
    problem.points.push_back(numbers.number("coordinate of a point"));
  }
  numbers.expect_end();
  return problem;
}

std::string bal_text(const BalProblem& problem) {
  fmt::memory_buffer text;
  const auto out = std::back_inserter(text);
  fmt::format_to(out, "{} {} {}\n", problem.camera_count(), problem.point_count(),
                 problem.observations.size());
  for (const auto& seen : problem.observations) {
    fmt::format_to(out, "{} {} {} {}\n", seen.camera, seen.point, seen.x, seen.y);
  }
  for (const double value : problem.cameras) fmt::format_to(out, "{}\n", value);
  for (const double value : problem.points) fmt::format_to(out, "{}\n", value);
  return fmt::to_string(text);
}

std::vector<double> residuals_px(const BalProblem& problem) {
  std::vector<double> residuals;
  residuals.reserve(2 * problem.observations.size());
  for (const auto& seen : problem.observations) {
    const auto at = project(&problem.cameras[static_cast<std::size_t>(seen.camera) * kCameraSize],
                            &problem.points[static_cast<std::size_t>(seen.point) * kPointSize]);
    residuals.push_back(at[0] - seen.x);
    residuals.push_back(at[1] - seen.y);
  }
  return residuals;
}

double half_squares(std::span<const double> residuals) {
  double sum = 0;
  for (const double residual : residuals) sum += residual * residual;
  return sum / 2;
}

}  // namespace pirt::mapping
