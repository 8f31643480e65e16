#include "workloads/inputs/sequence/table_file.h"

#include <fmt/core.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cctype>
#include <cmath>
#include <limits>

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

/// A heading that is not marked as a comment, as spreadsheets and pandas write it.
bool is_heading(const std::string& cell) {
  std::string word;
  for (const char c : cell) {
    if (std::isalpha(static_cast<unsigned char>(c)) == 0) break;
    word += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  }
  return !word.empty() && word != "nan" && word != "inf" && word != "infinity";
}

}  // namespace

double TableRow::number(std::size_t column) const {
  const auto read = decimal_number(plain(cells_[column]), -kLargest, kLargest);
  if (!read.value) fail(fmt::format("column {} {}", column + 1, read.problem));
  return *read.value;
}

Nanos TableRow::seconds(std::size_t column) const {
  constexpr double kLatest_s = 9e9;
  const auto read = decimal_number(plain(cells_[column]), 0, kLatest_s);
  if (!read.value) fail(fmt::format("column {} (seconds) {}", column + 1, read.problem));
  return from_s(*read.value);
}

Nanos TableRow::stamp(std::size_t column) const {
  const auto read =
      whole_number<std::int64_t>(cells_[column], 0, std::numeric_limits<std::int64_t>::max() / 4);
  if (!read.value) fail(fmt::format("column {} (nanoseconds) {}", column + 1, read.problem));
  return Nanos(*read.value);
}

Eigen::Matrix3d TableRow::rotation(std::size_t w, std::size_t x) const {
  constexpr double kTolerance = 1e-3;
  const Eigen::Quaterniond q(number(w), number(x), number(x + 1), number(x + 2));
  if (!(std::abs(q.norm() - 1.0) <= kTolerance)) {
    fail(fmt::format("the quaternion in columns {} to {} has not length 1", std::min(w, x) + 1,
                     std::max(w, x + 2) + 1));
  }
  return q.normalized().toRotationMatrix();
}

void TableRow::fail(const std::string& message) const { throw_bad_input(place_ + ": " + message); }

std::vector<TableRow> read_table(const std::filesystem::path& file, char separator,
                                 std::size_t columns) {
  std::vector<TableRow> rows;
  int number = 0;
  bool is_first = true;
  for (const auto& raw : split(read_text(file), '\n')) {
    ++number;
    std::string line = trimmed(raw);
    if (separator == ' ') std::ranges::replace(line, '\t', ' ');
    if (line.empty() || line.front() == '#') continue;
    auto cells = cells_of(line, separator);
    if (separator == ',' && is_first && is_heading(cells.front())) {
      is_first = false;
      continue;
    }
    is_first = false;
    TableRow row(fmt::format("{}:{}", file.string(), number), std::move(cells));
    if (columns != 0 && row.size() != columns) {
      row.fail(fmt::format("has {} columns, expected {}{}", row.size(), columns,
                           row.size() < columns ? why_fewer(line, separator) : ""));
    }
    rows.push_back(std::move(row));
  }
  if (rows.empty()) {
    throw_bad_input(fmt::format("'{}' has no rows (lines end in LF, or CR and LF)", file.string()));
  }
  return rows;
}

}  // namespace pirt
