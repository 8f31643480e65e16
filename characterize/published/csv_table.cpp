#include "characterize/published/csv_table.h"

#include <fmt/core.h>

#include <algorithm>
#include <utility>

#include "workloads/base/error.h"
#include "workloads/base/text/text.h"

namespace pirt {
namespace {

/// What stands from @p at on, to the comma or the line's end, which it goes to.
class FieldReader {
 public:
  FieldReader(const std::string& file, std::string_view text) : file_(file), text_(text) {}

  [[nodiscard]] bool at_end() const { return at_ == text_.size(); }
  [[nodiscard]] std::size_t line() const { return line_; }
  std::string field() {
    skip_blanks();
    std::string value = !at_end() && text_[at_] == '"' ? quoted() : plain();
    skip_blanks();
    if (!at_end() && text_[at_] != ',' && text_[at_] != '\n') {
      fail("behind a field in quotes comes ',' or the line's end");
    }
    return value;
  }
  /// Takes the comma or the line's end. @return Whether the row goes on.
  bool more() {
    if (at_end()) return false;
    const bool comma = text_[at_++] == ',';
    if (!comma) ++line_;
    return comma;
  }

 private:
  [[noreturn]] void fail(const char* problem) const {
    throw_bad_input(fmt::format("{}:{}: {}", file_, line_, problem));
  }
  void skip_blanks() {
    while (!at_end() && (text_[at_] == ' ' || text_[at_] == '\t' || text_[at_] == '\r')) ++at_;
  }
  std::string plain() {
    const std::size_t end = std::min(text_.find_first_of(",\n", at_), text_.size());
    std::string_view value = text_.substr(at_, end - at_);
    value = value.substr(0, value.find_last_not_of(" \t\r") + 1);
    if (value.find('"') != std::string_view::npos) {
      fail("a quote stands within a field; put the field in quotes, and the quote twice");
    }
    at_ = end;
    return std::string(value);
  }
  std::string quoted() {
    std::string value;
    for (++at_; !at_end(); ++at_) {
      if (text_[at_] == '"') {
        ++at_;
        if (at_end() || text_[at_] != '"') return value;
      }
      if (text_[at_] == '\n') ++line_;
      value += text_[at_];
    }
    fail("the quote is not closed");
  }

  const std::string& file_;
  std::string_view text_;
  std::size_t at_ = 0, line_ = 1;
};

}  // namespace

CsvTable::CsvTable(std::string file, const std::string& text)
    : file_(std::move(file)), rows_(read(file_, text)) {
  if (rows_.empty()) throw_bad_input("'" + file_ + "' is empty");
  auto names = columns();
  std::ranges::sort(names);
  if (const auto twice = std::ranges::adjacent_find(names); twice != names.end()) {
    throw_bad_input(place() + ": column '" + *twice + "' is there twice");
  }
}

std::vector<CsvTable::Row> CsvTable::read(const std::string& file, std::string_view text) {
  std::vector<Row> rows;
  FieldReader reader(file, text);
  while (!reader.at_end()) {
    Row row{.line = reader.line()};
    do {
      row.fields.push_back(reader.field());
    } while (reader.more());
    if (row.fields.size() > 1 || !row.fields.front().empty()) rows.push_back(std::move(row));
  }
  return rows;
}

bool CsvTable::has(std::string_view column) const {
  return std::ranges::find(columns(), column) != columns().end();
}

void CsvTable::require(const std::vector<std::string>& needed, std::string_view what) const {
  for (const std::string& column : needed) {
    if (has(column)) continue;
    throw_bad_input(fmt::format("{}:{}: {} has no column '{}'; it has {}", file_,
                                rows_.front().line, what, column, join(columns(), ", ")));
  }
}

std::string CsvTable::misfit() const {
  const std::size_t count = rows_[at_].fields.size();
  if (count == columns().size()) return "";
  return fmt::format("{} fields, and the head has {}", count, columns().size());
}

std::string CsvTable::text(std::string_view column) const {
  const auto found = std::ranges::find(columns(), column);
  if (found == columns().end()) return "";
  return rows_[at_].fields[static_cast<std::size_t>(found - columns().begin())];
}

std::string CsvTable::place() const { return fmt::format("{}:{}", file_, rows_[at_].line); }

}  // namespace pirt
