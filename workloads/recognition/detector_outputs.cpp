#include "workloads/recognition/detector_outputs.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cmath>

#include "workloads/base/error.h"

namespace pirt::recognition {
namespace {

[[noreturn]] void refuse(const DetectorFacts& detector, const NetworkOutput& output,
                         const std::string& what) {
  throw_bad_input(
      fmt::format("the model '{}' is no detector that is known here: an output of shape [{}] {}",
                  detector.file, fmt::join(output.shape, ", "), what));
}

/// Of a model that computes them as probabilities: sums round.
double checked_score(const DetectorFacts& detector, const NetworkOutput& output, double score) {
  constexpr double kRounding = 1e-3;
  if (score >= -kRounding && score <= 1 + kRounding) return score;
  refuse(detector, output, fmt::format("has a score of {:.6g}, which is not from 0 to 1", score));
}

/// An output's numbers by row and column.
struct Rows {
  const NetworkOutput& output;
  std::size_t count = 0, columns = 0;
  std::size_t row_stride = 0, column_stride = 1;

  [[nodiscard]] double at(std::size_t row, std::size_t column) const {
    return double{output.values[row * row_stride + column * column_stride]};
  }
};

/// How the columns of a YOLO's output are to be read.
struct YoloLayout {
  Rows rows;
  bool objectness = true;        ///< Column 4 is one; the scores come after it.
  bool multiplied = false;       ///< The scores have the objectness in them already.
  double width = 1, height = 1;  ///< What the box is in parts of.

  [[nodiscard]] std::size_t first_score() const { return objectness ? 5 : 4; }
  [[nodiscard]] std::size_t classes() const { return rows.columns - first_score(); }
};

Rows by_rows(const NetworkOutput& output, std::size_t axis) {
  const auto count = static_cast<std::size_t>(output.shape[axis]);
  const auto columns = static_cast<std::size_t>(output.shape[axis + 1]);
  return {.output = output, .count = count, .columns = columns, .row_stride = columns};
}

Rows by_columns(const NetworkOutput& output, std::size_t axis) {
  const auto columns = static_cast<std::size_t>(output.shape[axis]);
  const auto count = static_cast<std::size_t>(output.shape[axis + 1]);
  return {.output = output,
          .count = count,
          .columns = columns,
          .row_stride = 1,
          .column_stride = count};
}

/// Whether there is a row for each cell of the usual grids, of one anchor or of three.
bool has_rows_of_grids(const DetectorFacts& detector, std::size_t rows) {
  std::size_t cells = 0;
  for (const int stride : {8, 16, 32, 64}) {
    cells += static_cast<std::size_t>(detector.width / stride) *
             static_cast<std::size_t>(detector.height / stride);
    if (stride >= 32 && (rows == cells || rows == 3 * cells)) return true;
  }
  return false;
}

bool is_ssd(const NetworkOutput& output) {
  return output.shape.size() == 4 && output.shape[0] == 1 && output.shape[1] == 1 &&
         output.shape[3] == 7;
}

bool is_end_to_end(const DetectorFacts& detector, const NetworkOutput& output) {
  const auto& shape = output.shape;
  return shape.size() == 3 && shape[0] == 1 && shape[2] == 6 &&
         !has_rows_of_grids(detector, static_cast<std::size_t>(shape[1]));
}

/// Of [1, first, second]: whether the boxes lie along the second. There are more of them than
/// numbers a box, if the names do not say it better.
bool has_rows_across(const DetectorFacts& detector, std::int64_t first, std::int64_t second) {
  const auto names = static_cast<std::int64_t>(detector.names);
  const bool as_columns = names > 0 && first == 4 + names;
  const bool as_rows = names > 0 && second == 5 + names;
  return as_columns != as_rows ? as_columns : first < second;
}

YoloLayout yolo_layout(const DetectorFacts& detector, const NetworkOutput& output) {
  const auto& shape = output.shape;
  if (shape.size() == 2 && detector.format == ModelFormat::kDarknet && shape[1] > 5) {
    return {.rows = by_rows(output, 0), .multiplied = true};
  }
  if (shape.size() == 3 && shape[0] == 1) {
    const double width = detector.width, height = detector.height;
    const bool across = has_rows_across(detector, shape[1], shape[2]);
    if (!across && shape[2] > 5) {
      return {.rows = by_rows(output, 1), .width = width, .height = height};
    }
    if (across && shape[1] > 4) {
      return {.rows = by_columns(output, 1), .objectness = false, .width = width, .height = height};
    }
  }
  refuse(detector, output, "is none of YOLO's or SSD's");
}

void check_names(const DetectorFacts& detector, std::size_t classes) {
  if (detector.names == 0 || detector.names == classes) return;
  throw_bad_input(fmt::format("the model '{}' has {} classes, and there are {} names",
                              detector.file, classes, detector.names));
}

std::vector<Candidate> of_yolo(const DetectorFacts& detector, const NetworkOutput& output,
                               double least) {
  const YoloLayout layout = yolo_layout(detector, output);
  const Rows& rows = layout.rows;
  check_names(detector, layout.classes());
  const auto score = [&](std::size_t row, std::size_t column) {
    return checked_score(detector, output, rows.at(row, column));
  };
  std::vector<Candidate> candidates;
  for (std::size_t row = 0; row < rows.count; ++row) {
    Candidate best;
    for (std::size_t i = 0; i < layout.classes(); ++i) {
      const double of_class = score(row, layout.first_score() + i);
      if (of_class > best.score) best.index = i, best.score = of_class;
    }
    if (layout.objectness && !layout.multiplied) best.score *= score(row, 4);
    if (!(best.score >= least)) continue;
    const double half_width = rows.at(row, 2) / layout.width / 2;
    const double half_height = rows.at(row, 3) / layout.height / 2;
    best.left = rows.at(row, 0) / layout.width - half_width;
    best.right = rows.at(row, 0) / layout.width + half_width;
    best.top = rows.at(row, 1) / layout.height - half_height;
    best.bottom = rows.at(row, 1) / layout.height + half_height;
    candidates.push_back(best);
  }
  return candidates;
}

/// Where the numbers of a row stand that says its class.
struct ClassRow {
  std::size_t box, score, index;
  double width, height;  ///< What the box is in parts of.
};

std::vector<Candidate> of_classes(const DetectorFacts& detector, const Rows& rows,
                                  const ClassRow& row_is, double least) {
  std::vector<Candidate> candidates;
  for (std::size_t row = 0; row < rows.count; ++row) {
    const double index = rows.at(row, row_is.index);
    if (index < 0) continue;  // Room that is not used.
    const bool is_class = index == std::floor(index) && index < 1e6;
    if (!is_class) {
      refuse(detector, rows.output, fmt::format("has a class of {:.6g}", index));
    }
    if (detector.names > 0 && index >= static_cast<double>(detector.names)) {
      check_names(detector, static_cast<std::size_t>(index) + 1);
    }
    const double score = checked_score(detector, rows.output, rows.at(row, row_is.score));
    if (score < least) continue;
    const auto edge = [&](std::size_t i) {
      return rows.at(row, row_is.box + i) / (i % 2 == 0 ? row_is.width : row_is.height);
    };
    candidates.push_back(
        {static_cast<std::size_t>(index), score, edge(0), edge(1), edge(2), edge(3)});
  }
  return candidates;
}

}  // namespace

std::vector<Candidate> candidates_of(const DetectorFacts& detector, const NetworkOutput& output,
                                     double least_score) {
  if (is_ssd(output)) {
    const ClassRow ssd{.box = 3, .score = 2, .index = 1, .width = 1, .height = 1};
    return of_classes(detector, by_rows(output, 2), ssd, least_score);
  }
  if (is_end_to_end(detector, output)) {
    const ClassRow pixels{.box = 0,
                          .score = 4,
                          .index = 5,
                          .width = double(detector.width),
                          .height = double(detector.height)};
    return of_classes(detector, by_rows(output, 1), pixels, least_score);
  }
  return of_yolo(detector, output, least_score);
}

}  // namespace pirt::recognition
