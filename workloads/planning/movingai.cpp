// Maps and scenarios of Moving AI's benchmark sets.
#include <fmt/core.h>

#include <cmath>
#include <string_view>

#include "workloads/base/text/numbers.h"
#include "workloads/base/text/printable.h"
#include "workloads/base/text/text.h"
#include "workloads/planning/map_files.h"

namespace pirt::planning {
namespace {

namespace fs = std::filesystem;

/// The lines of a file one after another, and messages with their place.
class Lines {
 public:
  explicit Lines(const fs::path& file)
      : file_(file.string()), lines_(split(read_text(file), '\n')) {
    while (!lines_.empty() && lines_.back().empty()) lines_.pop_back();
  }

  [[nodiscard]] bool at_end() const { return next_ == lines_.size(); }
  /// Of the line that was taken last, from 1.
  [[nodiscard]] int number() const { return static_cast<int>(next_); }
  /// @param what  For the message if there is no line left.
  const std::string& take(std::string_view what) {
    if (at_end()) fail(fmt::format("the file ends where {} should be", what));
    return lines_[next_++];
  }
  [[noreturn]] void fail(const std::string& message) const {
    throw_bad_input(fmt::format("{}:{}: {}", file_, number(), message));
  }
  [[nodiscard]] std::string place() const { return fmt::format("{}:{}:", file_, number()); }

 private:
  std::string file_;
  std::vector<std::string> lines_;
  std::size_t next_ = 0;
};

int read_side(Lines& lines, std::string_view key) {
  const std::string& line = lines.take(fmt::format("'{} N'", key));
  if (!line.starts_with(std::string(key) + " ")) {
    lines.fail(fmt::format("expected '{} N', got '{}'", key, printable(line.substr(0, 40))));
  }
  return whole_number(std::string_view(line).substr(key.size() + 1), 1, kLongestSide)
      .or_refuse(fmt::format("{} {}", lines.place(), key));
}

/// How far a length may be off. Older files have 6 digits, the newer ones 8 decimals.
double rounding_of(double length, std::string_view text) {
  const auto point = text.find('.');
  if (length == 0 || (point != std::string_view::npos && text.size() - point > 8)) return 0;
  return 0.51 * std::pow(10, std::floor(std::log10(length)) - 5);
}

CellState state_of(char c, int column, const Lines& lines) {
  switch (c) {
    case '.':
    case 'G':
    case 'S':
      return CellState::kFree;
    case '@':
    case 'O':
    case 'T':
    case 'W':
      return CellState::kOccupied;
    default:
      lines.fail(fmt::format("'{}' in column {} is no cell; cells are . G S @ O T W",
                             printable(std::string(1, c)), column + 1));
  }
}

Cell read_cell(const std::vector<std::string>& fields, std::size_t at, const Grid& grid,
               const Lines& lines) {
  const auto coordinate = [&](std::size_t field, int size) {
    return whole_number(fields[field], 0, size - 1)
        .or_refuse(fmt::format("{} {} of the {}", lines.place(), field == at ? "column" : "row",
                               at == 4 ? "start" : "goal"));
  };
  return {coordinate(at, grid.width), coordinate(at + 1, grid.height)};
}

}  // namespace

Grid read_movingai_map(const fs::path& file) {
  Lines lines(file);
  if (lines.take("'type octile'") != "type octile") {
    lines.fail(
        "a map of Moving AI begins with 'type octile'; maps of ROS are named by their .yaml");
  }
  Grid grid;
  grid.height = read_side(lines, "height");
  grid.width = read_side(lines, "width");
  if (std::int64_t{grid.width} * grid.height > kMostCells) {
    lines.fail(fmt::format("{}x{} cells are too many (the limit is {})", grid.width, grid.height,
                           kMostCells));
  }
  if (lines.take("'map'") != "map") lines.fail("expected 'map'");
  // Rows are counted before memory is taken for what the header claims.
  for (int y = 0; y < grid.height; ++y) {
    const std::string& row = lines.take(fmt::format("row {} of {}", y + 1, grid.height));
    if (row.size() != static_cast<std::size_t>(grid.width)) {
      lines.fail(
          fmt::format("row {} has {} cells; the width is {}", y + 1, row.size(), grid.width));
    }
    for (int x = 0; x < grid.width; ++x) {
      grid.cells.push_back(state_of(row[static_cast<std::size_t>(x)], x, lines));
    }
  }
  if (!lines.at_end()) {
    lines.take("");
    lines.fail(fmt::format("more than the {} rows that its height says", grid.height));
  }
  return grid;
}

std::vector<ScenarioQuery> read_scenario(const fs::path& file, const Grid& grid) {
  constexpr double kLongest = static_cast<double>(kMostCells) * 2;
  Lines lines(file);
  const std::string& version = lines.take("'version 1'");
  if (version != "version 1" && version != "version 1.0") {
    lines.fail("a scenario of Moving AI begins with 'version 1'");
  }
  std::vector<ScenarioQuery> queries;
  while (!lines.at_end()) {
    const auto fields = split(lines.take("a query"), '\t');
    if (fields.size() != 9) {
      lines.fail(fmt::format(
          "a query has 9 fields with tabs between them (bucket, map, width, height, start x, y, "
          "goal x, y, optimal length); got {}",
          fields.size()));
    }
    const auto side = [&](std::size_t field, std::string_view name, int is) {
      const int says = whole_number(fields[field], 1, kLongestSide)
                           .or_refuse(fmt::format("{} {}", lines.place(), name));
      if (says != is) {
        lines.fail(
            fmt::format("the query is of a map of {} {}, and this one has {}; give --map the "
                        "map that the scenario is for",
                        name, says, is));
      }
    };
    side(2, "width", grid.width);
    side(3, "height", grid.height);
    ScenarioQuery query;
    query.line = lines.number();
    query.start = read_cell(fields, 4, grid, lines);
    query.goal = read_cell(fields, 6, grid, lines);
    query.optimal_length = decimal_number(fields[8], 0, kLongest)
                               .or_refuse(fmt::format("{} optimal length", lines.place()));
    query.rounding = rounding_of(query.optimal_length, fields[8]);
    queries.push_back(query);
  }
  if (queries.empty()) throw_bad_input(file.string() + ": the scenario has no query");
  return queries;
}

}  // namespace pirt::planning
