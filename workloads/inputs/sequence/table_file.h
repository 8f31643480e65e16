// Text files of numbers, a row a line: EuRoC's CSV and KITTI's blanks. Strict, with file:line.
#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "workloads/base/time.h"

namespace pirt {

/// Where a file has each column that is read; null = in the order in which it is read.
using ColumnOrder = std::shared_ptr<const std::vector<std::size_t>>;

class TableRow {
 public:
  TableRow(std::string place, std::vector<std::string> cells, ColumnOrder order = {})
      : place_(std::move(place)), cells_(std::move(cells)), order_(std::move(order)) {}

  [[nodiscard]] std::size_t size() const { return cells_.size(); }
  [[nodiscard]] const std::string& text(std::size_t column) const { return cells_[at(column)]; }
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
  /// Of the file.
  [[nodiscard]] std::size_t at(std::size_t column) const {
    return order_ == nullptr ? column : (*order_)[column];
  }

  std::string place_;
  std::vector<std::string> cells_;
  ColumnOrder order_;
};

/// The rows of a file, comments (#) and empty lines left out.
/// @param separator  ',' or ' ' (any number of blanks).
/// @param columns    How many each row has; 0 = any.
/// @param names  What a heading may call them, as "q w" for q_RS_w [], in the order in which they
///               are read: one that has all of these in another order is followed. Other words say
///               nothing.
/// @throws Error{kBadInput} for a row with another number of cells, for a file without rows, and
/// for a heading that has some of the names elsewhere and not all, or units that are not read.
[[nodiscard]] std::vector<TableRow> read_table(const std::filesystem::path& file, char separator,
                                               std::size_t columns,
                                               std::span<const std::string_view> names = {});

}  // namespace pirt
