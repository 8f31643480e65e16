// A table that can be drawn: one mark a row. A browser draws it (page/charts.js); text and Markdown
// show the same table, dots also as a strip in each row.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "reports/document/table.h"
#include "workloads/model/phase.h"

namespace pirt {

enum class ChartKind : std::uint8_t {
  kDots,       ///< A line a group; in it a dot a series at x, with its interval.
  kStacks,     ///< A bar a mark, of `parts` one after the other.
  kQuantiles,  ///< A strip a mark: a tick a quantile.
  kScatter,    ///< A point a mark at (x, y), its group beside it.
  kTimeline,   ///< A lane a group; in it a slice a mark from low to high.
};
/// "dots", "stacks", ...
[[nodiscard]] std::string_view to_string(ChartKind kind);

struct Axis {
  std::string label = {};  ///< With the unit.
  bool log = false;
};

/// What is drawn of one row of the table.
struct Mark {
  std::string group;   ///< "sobel"; of a timeline the lane.
  std::string series;  ///< Colour and shape: "cpu", "cold".
  std::optional<double> x = std::nullopt, y = std::nullopt;
  std::optional<double> low = std::nullopt, high = std::nullopt;  ///< On the x axis.
  std::vector<double> values = {};  ///< kStacks: of each of Chart::parts; kQuantiles: rising.
  Origin provenance = Provenance::kMeasured;
  /// Why its figure must not be believed, or why there is none; empty if it may be.
  std::string invalid = {};
  std::string doubt = {};  ///< Stands behind its figure: "?", "??".
  /// Said in place of a figure that is none: "never". Such a mark stands at the edge. Of a timeline
  /// the slice's name.
  std::string word = {};
  bool at_far_edge = false;  ///< Beyond all figures, not below them.
};

/// A line that is no row: a roof, a front; or, with one of x and y alone, a bound through the whole
/// chart.
struct ReferenceLine {
  std::string label;
  std::vector<std::pair<double, double>> points = {};
  std::optional<double> x = std::nullopt, y = std::nullopt;
};

struct Chart {
  ChartKind kind = ChartKind::kDots;
  /// What it shows, in a sentence, for whoever does not see it.
  std::string summary = {};
  Axis x = {}, y = {};
  std::vector<std::string> parts = {};   ///< kStacks: names of the values.
  std::vector<std::string> series = {};  ///< Those that have a colour before others, in this order.
  std::vector<ReferenceLine> lines = {};
  Table table = {};
  std::vector<Mark> marks = {};  ///< As many as the table has rows.
};

/// The table with, where the chart is of dots, each row's place on the axis drawn in a column of
/// its own.
[[nodiscard]] Table text_table_of(const Chart& chart);

}  // namespace pirt
