// Text files of numbers, a row a line: EuRoC's CSV and KITTI's blanks. Strict, with file:line.
#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "workloads/base/time.h"

namespace pirt {

class TableRow {
 public:
  TableRow(std::string place, std::vector<std::string> cells)
      : place_(std::move(place)), cells_(std::move(cells)) {}

  [[nodiscard]] std::size_t size() const { return cells_.size(); }
  [[nodiscard]] const std::string& text(std::size_t column) const { return cells_[column]; }
  /// Finite, of at most 1e12. @throws Error{kBadInput} with file:line and column.
  [[nodiscard]] double number(std::size_t column) const;
  /// A time in seconds, >= 0, and no more than Nanos holds.
  [[nodiscard]] Nanos seconds(std::size_t column) const;
  /// A stamp in nanoseconds, >= 0.
  [[nodiscard]] Nanos stamp(std::size_t column) const;
  /// A unit quaternion, its real part first or last.
  [[nodiscard]] Eigen::Matrix3d rotation(std::size_t w, std::size_t x) const;
  [[noreturn]] void fail(const std::string& message) const;

 private:
  std::string place_;
  std::vector<std::string> cells_;
};

/// The rows of a file, comments (#) and empty lines left out.
/// @param separator  ',' or ' ' (any number of blanks).
/// @param columns    How many each row has; 0 = any.
/// @throws Error{kBadInput} for a row with another number of cells, and for a file without rows.
[[nodiscard]] std::vector<TableRow> read_table(const std::filesystem::path& file, char separator,
                                               std::size_t columns);

}  // namespace pirt
