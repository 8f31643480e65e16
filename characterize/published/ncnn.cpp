// A table of ncnn's benchmark README: soc, unit, threads, network, avg_ms; readme_version, min_ms
// and max_ms if it has them.
#include <fmt/core.h>

#include <algorithm>
#include <map>
#include <utility>

#include "characterize/published/csv_table.h"
#include "characterize/published/published.h"
#include "workloads/base/error.h"
#include "workloads/base/text/numbers.h"

namespace pirt {
namespace {

[[noreturn]] void refuse_row(const CsvTable& table, const std::string& problem) {
  throw_bad_input(table.place() + ": " + problem);
}

std::string named(const CsvTable& table, std::string_view column) {
  std::string value = table.text(column);
  if (value.empty()) refuse_row(table, std::string(column) + " is empty");
  if (!name_of(value).empty()) return value;
  refuse_row(table, fmt::format("{} '{}' has no letter or digit to be called by", column, value));
}

Nanos time_in(const CsvTable& table, std::string_view column) {
  return milliseconds(table.text(column), kNanosecondMs, kLongestMs)
      .or_refuse(fmt::format("{}: {}", table.place(), column));
}

struct Row {
  std::string edition, soc, unit, network, range;
  int threads = 1;
  Nanos mean{0};
};

std::vector<Row> rows_of(const std::string& file, const std::string& text) {
  CsvTable table(file, text);
  table.require({"soc", "unit", "threads", "network", "avg_ms"}, "ncnn's table");
  std::vector<Row> rows;
  while (table.next()) {
    if (const std::string problem = table.misfit(); !problem.empty()) refuse_row(table, problem);
    Row row{.edition = table.text("readme_version"),
            .soc = named(table, "soc"),
            .unit = named(table, "unit"),
            .network = named(table, "network"),
            .range = "",
            .threads =
                whole_number(table.text("threads"), 1, 4096).or_refuse(table.place() + ": threads"),
            .mean = time_in(table, "avg_ms")};
    if (!table.text("min_ms").empty() && !table.text("max_ms").empty()) {
      const Nanos low = time_in(table, "min_ms");
      const Nanos high = time_in(table, "max_ms");
      if (low > row.mean || row.mean > high) {
        refuse_row(table, "avg_ms is not between min_ms and max_ms");
      }
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
    std::string unit = is_gpu(row) ? "gpu" : "cpu";
    const auto first = std::ranges::find(board.units, unit, &PublishedUnit::name);
    // Another cluster of cores, or another GPU.
    if (first != board.units.end() && !first->device.starts_with(row.unit + ",")) {
      unit = name_of(row.unit, '_');
      if (unit == first->name) unit += "_2";
    }
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
