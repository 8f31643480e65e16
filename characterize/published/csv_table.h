// A table as spreadsheets write it (RFC 4180): fields between commas, in double quotes where they
// hold a comma, a quote or a line's end, and columns by the names of the head, in any order.
//
// No other separator, and nothing is guessed: what a field means its reader says.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

namespace pirt {

class CsvTable {
 public:
  /// @param file  Name for messages.
  /// @throws Error{kBadInput} with file:line for a quote that is not closed or stands within a
  /// field, for an empty text, and for a column that is there twice.
  CsvTable(std::string file, const std::string& text);

  [[nodiscard]] const std::vector<std::string>& columns() const { return rows_.front().fields; }
  [[nodiscard]] bool has(std::string_view column) const;
  /// @param what     What the table is, for the message: "ncnn's table".
  /// @throws Error{kBadInput} naming the first of @p columns that the head has not.
  void require(const std::vector<std::string>& columns, std::string_view what) const;

  /// Goes to the next row; false behind the last one. Empty lines are none.
  bool next() { return ++at_ < rows_.size(); }
  /// Of this row: empty if it has as many fields as the head, else what is wrong.
  [[nodiscard]] std::string misfit() const;
  /// Of a row without misfit; empty if there is no such column.
  [[nodiscard]] std::string text(std::string_view column) const;
  /// "FILE:LINE" of this row; before the first one, of the head.
  [[nodiscard]] std::string place() const;

 private:
  struct Row {
    std::size_t line = 1;
    std::vector<std::string> fields = {};
  };
  [[nodiscard]] static std::vector<Row> read(const std::string& file, std::string_view text);

  std::string file_;
  std::vector<Row> rows_;  ///< The first is the head.
  std::size_t at_ = 0;
};

}  // namespace pirt
