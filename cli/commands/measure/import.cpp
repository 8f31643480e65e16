// pirt import: figures that pirt has not measured, into a profile database.
#include <fmt/core.h>

#include <algorithm>
#include <memory>
#include <optional>

#include "characterize/platform/platform.h"
#include "characterize/published/published.h"
#include "cli/commands.h"
#include "cli/options/files.h"
#include "cli/options/output.h"
#include "cli/options/values.h"
#include "reports/document/document.h"
#include "workloads/base/error.h"
#include "workloads/base/text/json.h"
#include "workloads/base/text/text.h"

namespace pirt::cli {
namespace {

struct ImportFlags {
  std::string file;
  std::string database;
  std::optional<std::string> board, name, source;
  Output platform_file;
  Output json;
};

/// Where a board is called as a platform that is shipped, whose units and cloud it would have.
void check_shipped(const Publication& publication, const ImportFlags& options) {
  const auto shipped = shipped_platforms();
  for (const PublishedBoard& board : publication.boards) {
    if (std::ranges::find(shipped, board.name) == shipped.end()) continue;
    if (!options.name) {
      throw_bad_input(fmt::format(
          "'{}' makes a board {}, which pirt has a platform of: --name {} gives its units these "
          "times, another --name makes a platform of its own",
          options.file, board.name, board.name));
    }
    const Platform platform = load_platform(board.name);
    for (const PublishedUnit& unit : board.units) static_cast<void>(platform.unit(unit.name));
  }
}

/// Those that are asked for, called as is asked for.
void choose(Publication& publication, const ImportFlags& options) {
  std::vector<std::string> names;
  for (const auto& board : publication.boards) {
    if (std::ranges::find(names, board.name) == names.end()) names.push_back(board.name);
  }
  if (options.board) {
    std::erase_if(publication.boards,
                  [&](const PublishedBoard& board) { return board.name != *options.board; });
    if (publication.boards.empty()) {
      throw_bad_input("'" + options.file + "' has no board '" + *options.board + "'" +
                      suggestion(*options.board, names));
    }
    names = {*options.board};
  }
  if (names.size() > 1 && (options.name || options.platform_file)) {
    throw_bad_input(fmt::format("'{}' has {} boards, and {} is of one; choose it with --board: {}",
                                options.file, names.size(),
                                options.name ? "--name" : "--platform-file", join(names, ", ")));
  }
  for (auto& board : publication.boards) {
    if (options.name) board.name = *options.name;
  }
  check_shipped(publication, options);
}

std::string medians(const PublishedFigure& figure) {
  const auto [low, high] = std::ranges::minmax(figure.samples);
  return low == high ? fmt::format("{:.4g}", to_ms(low))
                     : fmt::format("{:.4g} to {:.4g}", to_ms(low), to_ms(high));
}

int import(const ImportFlags& options) {
  Publication publication = read_publication(options.file, read_text(options.file));
  choose(publication, options);
  const std::string source = options.source.value_or(options.file);
  std::optional<ProfileWriter> writer;  // made once there is something to store
  Table table{.title = fmt::format("Figures of {} ({})", options.file, publication.format),
              .columns = {{"platform", Align::kLeft},
                          {"edition", Align::kLeft},
                          {"unit", Align::kLeft},
                          {"workload", Align::kLeft},
                          {"ms"},
                          {"figures"},
                          {"provenance", Align::kLeft}}};
  Json runs = Json::array();
  for (const PublishedBoard& board : publication.boards) {
    if (board.figures.empty()) {
      publication.left_out.push_back(board.said +
                                     ": no time of a call is given, so that it has no run");
      continue;
    }
    if (!writer) writer.emplace(options.database);
    const auto run_id = write_published(*writer, board, source);
    Json rows = Json::array();
    for (const PublishedFigure& figure : board.figures) {
      table.rows.push_back({board.name, board.edition.empty() ? "-" : board.edition, figure.unit,
                            figure.workload, medians(figure),
                            fmt::format("{}", figure.samples.size()),
                            std::string(to_string(board.provenance))});
      Json samples = Json::array();
      for (const Nanos sample : figure.samples) samples.push_back(sample.count());
      rows.push_back({{"workload", figure.workload},
                      {"unit", figure.unit},
                      {"call_ns", samples},
                      {"notes", figure.notes}});
    }
    Json run = {{"run_id", run_id},
                {"platform", board.name},
                {"board", board.said},
                {"provenance", to_string(board.provenance)},
                {"rows", rows}};
    if (!board.edition.empty()) run["edition"] = board.edition;
    runs.push_back(std::move(run));
  }
  if (runs.empty()) {
    throw_bad_input("'" + options.file +
                    "' has no time of a call: " + join(publication.left_out, "; "));
  }
  if (options.platform_file) {
    emit_text(published_platform(publication.boards.back(), source), options.platform_file);
  }
  table.footnotes.push_back("Of several editions of a platform, the last is the profile.");
  for (const auto& line : publication.left_out) table.footnotes.push_back("Left out: " + line);
  emit(render({.title = "pirt import", .parts = {table}}, Format::kText),
       {{"schema_version", 1},
        {"format", publication.format},
        {"source", source},
        {"runs", runs},
        {"left_out", publication.left_out}},
       options.json);
  return 0;
}

std::string no_platform_name(const std::string& text) {
  if (!text.empty() && text == name_of(text)) return "";
  return "'" + text + "' is no platform's name: letters a to z, digits, and '-' between them";
}

}  // namespace

void add_import(CLI::App& app, Action& action) {
  auto options = std::make_shared<ImportFlags>();
  Command command(app, "import",
                  "Take figures that pirt has not measured into a profile database: times of your "
                  "own as CSV (workload, unit, ms), JSON of Google Benchmark or nvbench, a history "
                  "of StarPU; published ones of ros2_benchmark (JSON), RobotPerf (benchmark.yaml) "
                  "and ncnn (CSV)");
  add_input(command, "file", &options->file, "What was measured, or published").required();
  add_continued(command, "--db", &options->database,
                "Profile database; made if missing, added to otherwise")
      .required();
  add_text(command, "--board", &options->board, "NAME", "Of several boards, only this one");
  add_value(command, "--name", &options->name, "NAME", no_platform_name,
            "What the board's platform is called (default: from what the file calls it)");
  add_text(command, "--source", &options->source, "WHERE",
           "Where the file is from, kept with the rows (default: its name)");
  add_output(command, "--platform-file", options->platform_file,
             "Write a platform with the board's units, for --platform; watts are yours to add",
             StdoutUse::kRefused);
  add_json(command, options->json);
  command.footer(
      "A table of times may also have p95_ms, samples, energy_mj, memory_mb, size (1280x720) and "
      "source. Its workloads are those of `pirt list workloads`, or have a dot (mine.icp). Such "
      "rows are `measured`, and noted `measured elsewhere`; those of others are `published` and "
      "keep foreign names (ncnn.alexnet).\n"
      "Example: pirt import times.csv --db mine.db && pirt schedule --profile mine.db --mix "
      "./mine.yaml --mode ect");
  command.runs(action, [options] { return import(*options); });
}

}  // namespace pirt::cli
