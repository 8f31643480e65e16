// Times that somebody has measured with means of their own, as CSV: workload, unit, ms, and what
// else is known of them.
#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "characterize/platform/platform_file.h"
#include "characterize/published/csv_table.h"
#include "characterize/published/published.h"
#include "workloads/base/error.h"
#include "workloads/base/text/numbers.h"
#include "workloads/base/text/text.h"
#include "workloads/catalog/specs.h"
#include "workloads/own/definition.h"

namespace pirt {
namespace {

constexpr double kMostMillijoules = 1e12;
constexpr double kMostMegabytes = 1e7;
constexpr std::int64_t kMostCalls = 1'000'000'000'000;
/// As of pirt's own rows: fewer say nothing of how far they may be off.
constexpr std::int64_t kFewCalls = 6;
constexpr std::size_t kMostProblems = 20;

const std::vector<std::string>& needed_columns() {
  static const std::vector<std::string> names = {"workload", "unit", "ms"};
  return names;
}

const std::vector<std::string>& optional_columns() {
  static const std::vector<std::string> names = {"p95_ms",    "samples", "energy_mj",
                                                 "memory_mb", "size",    "source"};
  return names;
}

/// Reads the rows, and collects what is wrong with each.
class TimesReader {
 public:
  TimesReader(const std::string& file, const std::string& text) : table_(file, text) {
    const std::string all =
        join(needed_columns(), ", ") + "; " + join(optional_columns(), ", ") + " if there";
    table_.require(needed_columns(), "a table of times (" + all + ")");
    auto known = needed_columns();
    known.insert(known.end(), optional_columns().begin(), optional_columns().end());
    for (const std::string& column : table_.columns()) {
      if (std::ranges::find(known, column) != known.end()) continue;
      throw_bad_input(fmt::format("{}: no column is called '{}'{}; there are {}", table_.place(),
                                  column, suggestion(column, known), all));
    }
  }

  std::vector<PublishedFigure> figures() {
    std::vector<PublishedFigure> figures;
    std::map<std::pair<std::string, std::string>, std::string> places;
    while (table_.next()) {
      if (const std::string problem = table_.misfit(); !problem.empty()) {
        add_problem(problem);
        continue;
      }
      PublishedFigure figure = read_row();
      const auto [first, is_new] =
          places.try_emplace({figure.workload, figure.unit}, table_.place());
      if (!is_new) {
        add_problem(fmt::format("{} on {} stands at {} already", figure.workload, figure.unit,
                                first->second));
      }
      figures.push_back(std::move(figure));
    }
    refuse_problems();
    if (figures.empty()) throw_bad_input(table_.place() + ": there is a head and no row");
    return figures;
  }

 private:
  void add_problem(const std::string& problem) {
    problems_.push_back(table_.place() + ": " + problem);
  }

  void refuse_problems() const {
    if (problems_.empty()) return;
    auto shown = problems_;
    if (shown.size() > kMostProblems) {
      shown.resize(kMostProblems);
      shown.push_back(fmt::format("and {} more", problems_.size() - kMostProblems));
    }
    throw_bad_input(join(shown, "; "));
  }

  /// Of a column that is not empty; else absent, and a problem where it is needed.
  template <typename T>
  std::optional<T> number(const char* column, const NumberRead<T>& read, bool needed = false) {
    if (!needed && table_.text(column).empty()) return std::nullopt;
    if (!read.value) add_problem(std::string(column) + " " + read.problem);
    return read.value;
  }

  std::optional<Nanos> time(const char* column, bool needed = false) {
    return number(column, milliseconds(table_.text(column), kNanosecondMs, kLongestMs), needed);
  }

  /// With the size, where there is one.
  std::string workload() {
    std::string name = table_.text("workload");
    const std::string size = table_.text("size");
    if (!is_made_of(name, "._-@")) {
      add_problem("workload '" + name + "' has other characters than letters, digits and . _ - @");
      return name;
    }
    if (!size.empty()) {
      const auto read = own::size_from(size);
      if (!read) {
        add_problem("size '" + size + "' is none; write WIDTHxHEIGHT, as in 1280x720");
        return name;
      }
      name += "@" + own::to_string(*read);
    }
    try {
      static_cast<void>(find_spec(name));
    } catch (const Error& error) {
      add_problem(error.what() +
                  std::string(is_foreign(name) ? "" : "; a name of your own has a dot: mine.icp"));
    }
    return name;
  }

  std::string unit() {
    std::string name = table_.text("unit");
    if (name.empty() || !is_made_of(name, "_-")) {
      add_problem("unit '" + name + "' is no name: letters, digits, _ and -");
    }
    const bool empty_in_yaml = name == "null" || name == "Null" || name == "NULL";
    if (empty_in_yaml || std::ranges::find(workload_keys(), name) != workload_keys().end()) {
      add_problem("unit '" + name + "' is a word of platform files; call it otherwise");
    }
    return name;
  }

  PublishedFigure read_row() {
    PublishedFigure figure{.workload = workload(), .unit = unit(), .samples = {}};
    if (const auto ms = time("ms", true)) figure.samples = {*ms};
    figure.p95 = time("p95_ms");
    if (figure.p95 && !figure.samples.empty() && *figure.p95 < figure.samples.front()) {
      add_problem("p95_ms is below ms");
    }
    const auto calls =
        number("samples", whole_number(table_.text("samples"), std::int64_t{1}, kMostCalls));
    figure.notes.push_back(calls ? fmt::format("of {} call{}", *calls, *calls == 1 ? "" : "s")
                                 : "of an unknown number of calls");
    if (calls && *calls < kFewCalls) figure.doubts.emplace_back("few_samples");
    const auto millijoules =
        number("energy_mj", decimal_number(table_.text("energy_mj"), 0, kMostMillijoules));
    if (millijoules) figure.energy_j = *millijoules / 1e3;
    const auto megabytes =
        number("memory_mb", decimal_number(table_.text("memory_mb"), 0, kMostMegabytes));
    if (megabytes) figure.memory_bytes = std::llround(*megabytes * 1e6);
    if (const auto source = table_.text("source"); !source.empty()) {
      figure.notes.push_back("source: " + source);
    }
    return figure;
  }

  CsvTable table_;
  std::vector<std::string> problems_;
};

}  // namespace

Publication read_times(const std::string& file, const std::string& text) {
  PublishedBoard board{
      .name = board_of(file), .said = "times of " + file, .provenance = Provenance::kMeasured};
  board.figures = TimesReader(file, text).figures();
  for (const PublishedFigure& figure : board.figures) {
    add_unit(
        board,
        {.name = figure.unit, .device = figure.unit, .is_cpu = figure.unit.starts_with("cpu")});
  }
  return {.format = "times", .boards = {std::move(board)}};
}

}  // namespace pirt
