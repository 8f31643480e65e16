#include "workloads/inputs/sequence/table_file.h"

#include <fmt/core.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cctype>
#include <cmath>
#include <initializer_list>
#include <limits>
#include <optional>
#include <utility>

#include "workloads/base/error.h"
#include "workloads/base/text/numbers.h"
#include "workloads/base/text/text.h"

namespace pirt {
namespace {

constexpr double kLargest = 1e12;

std::string trimmed(std::string_view text) {
  const auto blank = [](char c) { return std::isspace(static_cast<unsigned char>(c)) != 0; };
  while (!text.empty() && blank(text.front())) text.remove_prefix(1);
  while (!text.empty() && blank(text.back())) text.remove_suffix(1);
  return std::string(text);
}

std::vector<std::string> cells_of(const std::string& line, char separator) {
  std::vector<std::string> cells;
  for (const auto& cell : split(line, separator)) {
    auto text = trimmed(cell);
    const bool is_quoted = text.size() >= 2 && text.front() == '"' && text.back() == '"';
    if (is_quoted) text = trimmed(std::string_view(text).substr(1, text.size() - 2));
    if (separator == ' ' && text.empty()) continue;
    cells.push_back(std::move(text));
  }
  return cells;
}

/// A number as other programs print it: also "+1" and "1.", which the strict reader refuses.
std::string plain(std::string text) {
  if (text.starts_with('+')) text.erase(0, 1);
  return text;
}

/// Why a row may have fewer columns than it should.
const char* why_fewer(const std::string& line, char separator) {
  for (const char other : {',', ';', '\t'}) {
    if (other == separator || line.find(other) == std::string::npos) continue;
    return separator == ',' ? "; columns are separated by commas"
                            : "; columns are separated by blanks";
  }
  return "; is the file cut off?";
}

/// The words of a heading that blanks separate, each with its unit: "tx [m]".
std::vector<std::string> with_units(const std::vector<std::string>& words) {
  std::vector<std::string> cells;
  bool is_open = false;
  for (const std::string& word : words) {
    const bool goes_on = is_open || word.starts_with('[') || word.starts_with('(');
    if (goes_on && !cells.empty()) {
      cells.back() += " " + word;
    } else {
      cells.push_back(word);
    }
    for (const char c : word) {
      if (c == '[' || c == '(') is_open = true;
      if (c == ']' || c == ')') is_open = false;
    }
  }
  return cells;
}

/// A heading that is not marked as a comment, as spreadsheets and pandas write it.
bool is_heading(const std::string& cell) {
  std::string word;
  for (const char c : cell) {
    if (std::isalpha(static_cast<unsigned char>(c)) == 0) break;
    word += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  }
  return !word.empty() && word != "nan" && word != "inf" && word != "infinity";
}

/// "q w" of "q_RS_w []" and of "qw", "b_a x" of "b_a_RS_S_x [m s^-2]", "w x" of "gyro_x" and of
/// "angular_velocity.x", "timestamp" of "#timestamp [ns]".
std::string name_of(std::string_view cell) {
  std::string text = trimmed(cell.substr(0, cell.find_first_of("[(")));
  std::ranges::transform(text, text.begin(), [](unsigned char c) {
    return c == '.' ? '_' : static_cast<char>(std::tolower(c));
  });
  if (text == "t" || text == "stamp" || text.starts_with("time")) return "timestamp";
  const bool is_bias = text.starts_with("b_") && text.size() > 3;
  const std::size_t first = text.find('_', is_bias ? 2 : 0), last = text.rfind('_');
  const bool is_pair = text.size() == 2;
  if (!is_pair && (first == std::string::npos || last < first)) return text;
  std::string group = text.substr(0, is_pair ? 1 : first);
  const std::string axis = text.substr(is_pair ? 1 : last + 1);
  if (group == "g" || group == "omega" || group == "angular" || group.starts_with("gyr"))
    group = "w";
  if (group == "linear" || group.starts_with("acc")) group = "a";
  return group + " " + axis;
}

/// @throws Error{kBadInput} for a unit that is not the one in which the column is read.
void check_unit(const TableRow& heading, std::size_t column, std::string_view name) {
  const std::string& cell = heading.text(column);
  const auto begin = cell.find('[') != std::string::npos ? cell.find('[') : cell.find('(');
  if (begin == std::string::npos) return;
  const auto end = cell.find_first_of("])", begin);
  std::string unit = trimmed(std::string_view(cell).substr(begin + 1, end - begin - 1));
  if (unit.starts_with("in ")) unit = trimmed(unit.substr(3));  // "(in m)"
  const auto is_one_of = [&](std::initializer_list<std::string_view> units) {
    return std::ranges::any_of(units, [&](std::string_view each) {
      return unit == each || unit.starts_with(std::string(each) + " ") ||
             unit.starts_with(std::string(each) + "/");
    });
  };
  const bool turns = name.starts_with("w ") || name.starts_with("b_w "),
             accelerates = name.starts_with("a ") || name.starts_with("b_a "),
             moves = name.starts_with("p ") || name.starts_with("t ") || name.starts_with("v ");
  const auto fail = [&](const char* wanted) {
    heading.fail(fmt::format("column {} is in {}; give {}", column + 1, unit, wanted));
  };
  if (turns && is_one_of({"deg", "degree", "degrees", "\u00b0", "dps", "mdps"})) fail("rad/s");
  if (accelerates && is_one_of({"g", "mg"})) fail("m/s^2");
  if (moves && is_one_of({"mm", "cm", "km", "ft", "in"}))
    fail(name.starts_with("v ") ? "m/s" : "m");
}

/// @param heading  Of as many cells as the rows have.
ColumnOrder order_of(const TableRow& heading, std::span<const std::string_view> names) {
  std::vector<std::size_t> order;
  std::string elsewhere;
  for (std::size_t column = 0; column < names.size(); ++column) {
    for (std::size_t i = 0; i < heading.size(); ++i) {
      if (name_of(heading.text(i)) != names[column]) continue;
      order.push_back(i);
      check_unit(heading, i, names[column]);
      if (i != column) {
        elsewhere = fmt::format("the heading has {} in column {}, where column {} is meant",
                                heading.text(i), i + 1, column + 1);
      }
      break;
    }
  }
  if (elsewhere.empty()) return nullptr;
  if (order.size() != names.size()) {
    heading.fail(elsewhere + ", and does not name all columns; name all, or write them in order");
  }
  return std::make_shared<const std::vector<std::size_t>>(std::move(order));
}

}  // namespace

double TableRow::number(std::size_t column) const {
  const auto read = decimal_number(plain(text(column)), -kLargest, kLargest);
  if (!read.value) fail(fmt::format("column {} {}", at(column) + 1, read.problem));
  return *read.value;
}

Nanos TableRow::seconds(std::size_t column) const {
  constexpr double kLatest_s = 9e9;
  const auto read = decimal_number(plain(text(column)), 0, kLatest_s);
  if (!read.value) fail(fmt::format("column {} (seconds) {}", at(column) + 1, read.problem));
  return from_s(*read.value);
}

Nanos TableRow::stamp(std::size_t column) const {
  const auto read =
      whole_number<std::int64_t>(text(column), 0, std::numeric_limits<std::int64_t>::max() / 4);
  if (!read.value) fail(fmt::format("column {} (nanoseconds) {}", at(column) + 1, read.problem));
  return Nanos(*read.value);
}

Eigen::Matrix3d TableRow::rotation(std::size_t w, std::size_t x) const {
  constexpr double kTolerance = 1e-3;
  const Eigen::Quaterniond q(number(w), number(x), number(x + 1), number(x + 2));
  if (!(std::abs(q.norm() - 1.0) <= kTolerance)) {
    const auto [first, last] = std::minmax({at(w), at(x), at(x + 1), at(x + 2)});
    fail(fmt::format("the quaternion in columns {} to {} has not length 1", first + 1, last + 1));
  }
  return q.normalized().toRotationMatrix();
}

void TableRow::fail(const std::string& message) const { throw_bad_input(place_ + ": " + message); }

std::vector<TableRow> read_table(const std::filesystem::path& file, char separator,
                                 std::size_t columns, std::span<const std::string_view> names) {
  std::vector<TableRow> rows;
  std::optional<TableRow> heading;  // The last line above the rows, marked as a comment or not.
  ColumnOrder order;
  int number = 0;
  bool is_first = true;
  for (const auto& raw : split(read_text(file), '\n')) {
    ++number;
    std::string line = trimmed(raw);
    if (separator == ' ') std::ranges::replace(line, '\t', ' ');
    if (line.empty()) continue;
    const std::string place = fmt::format("{}:{}", file.string(), number);
    const bool is_comment = line.front() == '#';
    if (is_comment) line.erase(0, line.find_first_not_of('#'));
    auto cells = cells_of(line, separator);
    if (is_comment && separator == ' ') cells = with_units(cells);
    const bool may_be_heading = !is_comment && separator == ',' && std::exchange(is_first, false);
    if (is_comment || (may_be_heading && is_heading(cells.front()))) {
      if (rows.empty()) heading.emplace(place, std::move(cells));
      continue;
    }
    if (rows.empty() && heading && heading->size() == cells.size()) {
      order = order_of(*heading, names.first(std::min(names.size(), cells.size())));
    }
    TableRow row(place, std::move(cells), order);
    const std::size_t expected = order != nullptr ? heading->size() : columns;
    if (expected != 0 && row.size() != expected) {
      row.fail(fmt::format("has {} columns, expected {}{}", row.size(), expected,
                           row.size() < expected ? why_fewer(line, separator) : ""));
    }
    rows.push_back(std::move(row));
  }
  if (rows.empty()) {
    throw_bad_input(fmt::format("'{}' has no rows (lines end in LF, or CR and LF)", file.string()));
  }
  return rows;
}

}  // namespace pirt
