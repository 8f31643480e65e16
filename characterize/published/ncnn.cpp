// A table of ncnn's benchmark README: soc, unit, threads, network, avg_ms; readme_version, min_ms
// and max_ms if it has them.
#include <fmt/core.h>

#include <algorithm>
#include <map>
#include <utility>

#include "characterize/published/published.h"
#include "workloads/base/error.h"
#include "workloads/base/text/numbers.h"
#include "workloads/base/text/text.h"

namespace pirt {
namespace {

/// The table with its columns by name.
class Table {
 public:
  Table(std::string file, const std::string& text) : file_(std::move(file)) {
    for (auto& line : split(text, '\n')) {
      if (line.ends_with('\r')) line.pop_back();
      lines_.push_back(std::move(line));
    }
    columns_ = split(lines_.front(), ',');
    for (const auto* column : {"soc", "unit", "threads", "network", "avg_ms"}) {
      if (std::ranges::find(columns_, column) != columns_.end()) continue;
      throw_bad_input(fmt::format("{}:1: ncnn's table has no column '{}'; it has {}", file_, column,
                                  join(columns_, ", ")));
    }
  }

  /// Goes to the next row; false behind the last one.
  bool next() {
    do {
      if (++row_ == lines_.size()) return false;
    } while (lines_[row_].empty());
    fields_ = split(lines_[row_], ',');
    if (fields_.size() != columns_.size()) {
      fail(fmt::format("{} fields, and the head has {}", fields_.size(), columns_.size()));
    }
    return true;
  }
  /// Empty if there is no such column.
  [[nodiscard]] std::string text(std::string_view column) const {
    const auto at = std::ranges::find(columns_, column) - columns_.begin();
    return at == std::ssize(columns_) ? "" : fields_[static_cast<std::size_t>(at)];
  }
  [[nodiscard]] std::string filled(std::string_view column) const {
    std::string value = text(column);
    if (value.empty()) fail(fmt::format("{} is empty", column));
    return value;
  }
  [[nodiscard]] Nanos time(std::string_view column) const {
    return milliseconds(text(column), kNanosecondMs, kLongestMs)
        .or_refuse(fmt::format("{}:{}: {}", file_, row_ + 1, column));
  }
  [[nodiscard]] int threads() const {
    return whole_number(text("threads"), 1, 4096)
        .or_refuse(fmt::format("{}:{}: threads", file_, row_ + 1));
  }
  [[noreturn]] void fail(const std::string& problem) const {
    throw_bad_input(fmt::format("{}:{}: {}", file_, row_ + 1, problem));
  }

 private:
  std::string file_;
  std::vector<std::string> lines_, columns_, fields_;
  std::size_t row_ = 0;
};

struct Row {
  std::string edition, soc, unit, network, range;
  int threads = 1;
  Nanos mean{0};
};

std::vector<Row> rows_of(const std::string& file, const std::string& text) {
  Table table(file, text);
  std::vector<Row> rows;
  while (table.next()) {
    Row row{.edition = table.text("readme_version"),
            .soc = table.filled("soc"),
            .unit = table.filled("unit"),
            .network = table.filled("network"),
            .range = "",
            .threads = table.threads(),
            .mean = table.time("avg_ms")};
    if (!table.text("min_ms").empty() && !table.text("max_ms").empty()) {
      const Nanos low = table.time("min_ms");
      const Nanos high = table.time("max_ms");
      if (low > row.mean || row.mean > high) table.fail("avg_ms is not between min_ms and max_ms");
      row.range = fmt::format(", {} to {} ms", table.text("min_ms"), table.text("max_ms"));
    }
    rows.push_back(std::move(row));
  }
  if (rows.empty()) throw_bad_input("'" + file + "' has a head and no rows");
  return rows;
}

bool is_gpu(const Row& row) { return row.unit.starts_with("GPU"); }

}  // namespace

Publication read_ncnn(const std::string& file, const std::string& text) {
  const auto rows = rows_of(file, text);
  Publication publication{.format = "ncnn", .boards = {}, .left_out = {}};
  std::map<std::string, int> most;  // threads, of each SoC
  for (const Row& row : rows) {
    int& threads = most[row.soc];
    if (!is_gpu(row)) threads = std::max(threads, row.threads);
  }
  std::map<std::pair<std::string, std::string>, std::size_t> known;  // boards
  for (const Row& row : rows) {
    // The same cores with fewer threads are no unit beside themselves.
    const bool fewer = !is_gpu(row) && row.threads < most[row.soc];
    const std::string name =
        name_of(row.soc) +
        (fewer ? fmt::format("-{}-thread{}", row.threads, row.threads == 1 ? "" : "s") : "");
    const auto [at, is_new] = known.try_emplace({name, row.edition}, publication.boards.size());
    if (is_new) {
      publication.boards.push_back({.name = name,
                                    .said = row.soc,
                                    .edition = row.edition,
                                    .units = {},
                                    .figures = {},
                                    .facts = {}});
    }
    PublishedBoard& board = publication.boards[at->second];
    const std::string unit = is_gpu(row) ? "gpu" : "cpu";
    add_unit(board, {.name = unit,
                     .device = fmt::format("{}, {} thread{}", row.unit, row.threads,
                                           row.threads == 1 ? "" : "s"),
                     .is_cpu = !is_gpu(row)});
    add_figure(board, {.workload = "ncnn." + name_of(row.network, '_'),
                       .unit = unit,
                       .samples = {row.mean},
                       .notes = {"mean of an unknown number of calls" + row.range}});
  }
  return publication;
}

}  // namespace pirt
