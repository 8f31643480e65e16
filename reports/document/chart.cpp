#include "reports/document/chart.h"

#include <algorithm>
#include <cmath>
#include <iterator>

namespace pirt {
namespace {

constexpr int kStripWidth = 32;

/// Where values stand on a strip.
class Scale {
 public:
  explicit Scale(const Chart& chart) : log_(chart.x.log) {
    for (const Mark& mark : chart.marks) {
      for (const auto& value : {mark.x, mark.low, mark.high}) {
        if (value) include(*value);
      }
    }
    if (!log_ && !empty_) low_ = std::min(low_, 0.0);
  }
  [[nodiscard]] bool empty() const { return empty_; }
  /// Absent for what the axis cannot show: 0 on a logarithmic one.
  [[nodiscard]] std::optional<int> place(std::optional<double> value) const {
    if (!value || (log_ && *value <= 0)) return std::nullopt;
    const double part = high_ > low_ ? (scaled(*value) - low_) / (high_ - low_) : 0.5;
    return static_cast<int>(std::lround(std::clamp(part, 0.0, 1.0) * (kStripWidth - 1)));
  }

 private:
  [[nodiscard]] double scaled(double value) const { return log_ ? std::log(value) : value; }
  void include(double value) {
    if (log_ && value <= 0) return;
    const double at = scaled(value);
    low_ = empty_ ? at : std::min(low_, at);
    high_ = empty_ ? at : std::max(high_, at);
    empty_ = false;
  }

  bool log_;
  bool empty_ = true;
  double low_ = 0, high_ = 0;
};

std::string strip(const Mark& mark, const Scale& scale) {
  const auto at = scale.place(mark.x);
  if (!at) return mark.word;
  const int low = scale.place(mark.low).value_or(*at);
  const int high = scale.place(mark.high).value_or(*at);
  std::string text;
  for (int i = 0; i < kStripWidth; ++i) {
    if (i == *at) {
      text += !mark.invalid.empty() ? "×" : mark.provenance == Provenance::kMeasured ? "●" : "○";
    } else {
      text += i >= low && i <= high ? "─" : "·";
    }
  }
  return text;
}

}  // namespace

std::string_view to_string(ChartKind kind) {
  switch (kind) {
    case ChartKind::kDots:
      return "dots";
    case ChartKind::kStacks:
      return "stacks";
    case ChartKind::kQuantiles:
      return "quantiles";
    case ChartKind::kScatter:
      return "scatter";
    case ChartKind::kTimeline:
      return "timeline";
  }
  return "";
}

Table text_table_of(const Chart& chart) {
  Table table = chart.table;
  const Scale scale(chart);
  if (chart.kind == ChartKind::kDots && !scale.empty()) {
    // Behind the columns that name a row, where a narrow terminal still has it beside them.
    std::ptrdiff_t at = 0;
    while (at < 2 && at + 1 < std::ssize(table.columns) &&
           table.columns[static_cast<std::size_t>(at)].align == Align::kLeft) {
      ++at;
    }
    table.columns.insert(
        table.columns.begin() + at,
        {chart.x.label + (chart.x.log ? ", logarithmic" : ", from 0"), Align::kLeft});
    for (std::size_t i = 0; i < table.rows.size(); ++i) {
      table.rows[i].insert(table.rows[i].begin() + at, strip(chart.marks[i], scale));
    }
    table.footnotes.emplace_back("● measured, ○ not measured, × invalid; ─ its interval.");
  }
  if (!chart.summary.empty()) table.footnotes.insert(table.footnotes.begin(), chart.summary);
  return table;
}

}  // namespace pirt
