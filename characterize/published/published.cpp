#include "characterize/published/published.h"

#include <fmt/core.h>

#include <algorithm>
#include <filesystem>

#include "characterize/campaign/run_facts.h"
#include "characterize/machine/environment.h"
#include "characterize/published/csv_table.h"
#include "characterize/published/google_benchmark.h"
#include "workloads/base/error.h"
#include "workloads/base/text/json.h"
#include "workloads/base/text/numbers.h"
#include "workloads/base/text/printable.h"
#include "workloads/catalog/specs.h"

namespace pirt {
namespace {

constexpr std::string_view kPublished = "published", kImported = "imported";

/// Stands for mode, precision and backend of a run that pirt did not measure.
std::string how_taken(const PublishedBoard& board) {
  return std::string(board.provenance == Provenance::kPublished ? kPublished : kImported);
}

Publication read_json_of(const std::string& file, const Json& root) {
  const bool benchmarks = root.contains("benchmarks") && root.at("benchmarks").is_array();
  if (benchmarks && root.contains("devices")) return read_nvbench(file, root);
  if (benchmarks && root.contains("context")) return read_google_benchmark(file, root);
  if (root.contains("metadata")) return read_ros2_benchmark(file, root);
  throw JsonError(
      "it is no result of ros2_benchmark (metadata), Google Benchmark (context, benchmarks) or "
      "nvbench (devices, benchmarks)");
}

bool begins_with_head(const std::string& text) {
  const std::string head = text.substr(0, text.find('\n'));
  return head.find(',') != std::string::npos && head.find(": ") == std::string::npos;
}

/// A table of a spreadsheet that writes decimal commas.
void check_separator(const std::string& file, const std::string& text) {
  const std::string head = text.substr(0, text.find('\n'));
  const auto has = [&head](const char* what) { return head.find(what) != std::string::npos; };
  if (has(",") || !(has(";") || has("\t")) || !(has("workload") || has("soc"))) return;
  throw_bad_input(file + ":1: its columns are not between commas but '" +
                  printable(head.substr(0, 80)) +
                  "'; save it as CSV with ',' between columns and '.' in numbers");
}

/// In double quotes, as YAML and JSON both read them.
std::string quoted(const std::string& text) { return json_text(Json(text)); }

}  // namespace

Publication read_publication(const std::string& file, const std::string& text) {
  const auto first = text.find_first_not_of(" \t\r\n");
  if (first == std::string::npos) throw_bad_input("'" + file + "' is empty");
  const std::string body = text.substr(first);
  try {
    if (const auto benchmarks = find_benchmarks(body)) return read_json_of(file, *benchmarks);
    if (body.front() == '{') return read_json_of(file, parse_json(body));
  } catch (const JsonError& error) {
    throw_bad_input("'" + file + "' cannot be imported: " + error.reason());
  }
  if (body.front() == '#' && body.find("# Performance Model") != std::string::npos) {
    return read_starpu(file, text);
  }
  check_separator(file, body);
  if (!begins_with_head(body)) return read_robotperf(file, text);
  return CsvTable(file, text).has("soc") ? read_ncnn(file, text) : read_times(file, text);
}

namespace {

CellRecord cell_of(const PublishedBoard& board, const PublishedFigure& figure,
                   const std::string& source) {
  const bool published = board.provenance == Provenance::kPublished;
  CellRecord cell{
      .workload = figure.workload,
      .unit = figure.unit,
      .ops = figure.ops,
      .bytes = figure.bytes.value_or(0),
      .verification = published ? "not verified: published figures" : "not verified: imported",
      .phases = {},
      .energy = {},
      .host_memory_bytes = figure.memory_bytes};
  if (const auto spec = try_find_spec(figure.workload)) {
    cell.ops = spec->ops;
    cell.bytes = spec->bytes;
  }
  PhaseRecord call;
  call.phase = Phase::kCall;
  call.provenance = board.provenance;
  call.notes = figure.notes;
  call.doubts = figure.doubts;
  call.samples = figure.samples;
  call.p95 = figure.p95;
  if (published) {
    // Nobody says that they were taken by one process.
    for (std::size_t i = 0; i < figure.samples.size(); ++i) {
      call.processes.push_back(static_cast<std::int32_t>(i));
    }
  } else {
    call.notes.insert(call.notes.begin(), std::string(kMeasuredElsewhere));
  }
  cell.phases.push_back(std::move(call));
  if (figure.energy_j) {
    cell.energy = EnergyRecord{.energy_j = figure.energy_j,
                               .provenance = board.provenance,
                               .source = "elsewhere: " + source,
                               .reasons = {}};
  }
  return cell;
}

}  // namespace

std::int64_t write_published(ProfileWriter& writer, const PublishedBoard& board,
                             const std::string& source) {
  RunHeader header;
  header.started = utc_now();
  header.platform = board.name;
  header.environment = board.facts;
  header.environment.merge(build_environment());
  header.environment["source"] = source;
  header.environment["machine"] = board.said;
  if (!board.edition.empty()) header.environment["published.edition"] = board.edition;
  header.environment["mode"] = how_taken(board);
  header.environment["precision"] = how_taken(board);  // Is identity: nothing is compared with it.
  for (const PublishedUnit& unit : board.units) {
    header.units.push_back({.unit = unit.name,
                            .backend = how_taken(board),
                            .device = unit.device,
                            .device_is_cpu = unit.is_cpu,
                            .cores = {}});
  }
  const std::int64_t run_id = writer.begin_run(header);
  for (const PublishedFigure& figure : board.figures) {
    writer.write_cell(run_id, cell_of(board, figure, source));
  }
  writer.finish_run(run_id, utc_now());
  return run_id;
}

std::string published_platform(const PublishedBoard& board, const std::string& source) {
  std::string text = fmt::format(
      "platform: {}\ndescription: {}\nassumptions: {}\nunits:\n", board.name,
      quoted(fmt::format("{}, as {}: {}", board.said, how_taken(board), source)),
      quoted("The watts of the units stand nowhere here; set them, or energy is not known."));
  for (const PublishedUnit& unit : board.units) {
    text += fmt::format("  {}: {{servers: 1, slots: 1}}  # {}\n", unit.name, quoted(unit.device));
  }
  return text;
}

std::string name_of(const std::string& said, char gap) {
  std::string name;
  for (const char c : said) {
    const bool plain = (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9');
    const char lower = c >= 'A' && c <= 'Z' ? static_cast<char>(c + ('a' - 'A')) : c;
    if (plain || lower != c) {
      name += lower;
    } else if (!name.empty() && name.back() != gap) {
      name += gap;
    }
  }
  if (!name.empty() && name.back() == gap) name.pop_back();
  return name;
}

std::optional<std::string> published_platform(const Profile& profile) {
  // Nothing of where it lies: it is the same platform in each copy.
  PublishedBoard board{.name = profile.platform(), .said = profile.platform()};
  for (const RunInfo& run : profile.runs) {
    for (const UnitRecord& unit : run.units) {
      if (unit.backend != kPublished && unit.backend != kImported) return std::nullopt;
      if (unit.backend == kImported) board.provenance = Provenance::kMeasured;
      add_unit(board, {.name = unit.unit, .device = unit.device, .is_cpu = unit.device_is_cpu});
    }
  }
  if (board.units.empty()) return std::nullopt;
  return published_platform(board, "its database");
}

std::string board_of(const std::string& file) {
  const std::string name = name_of(std::filesystem::path(file).stem().string());
  return name.empty() ? "elsewhere" : name;
}

std::string foreign_name(const std::string& prefix, const std::string& said,
                         std::map<std::string, std::string>& known) {
  const std::string name = name_of(said, '_');
  if (name.empty()) throw JsonError("'" + said + "' has no letter or digit to be called by");
  const auto [first, is_new] = known.try_emplace(name, said);
  if (!is_new && first->second != said) {
    throw JsonError(fmt::format("'{}' and '{}' would both be called {}.{}; rename one",
                                first->second, said, prefix, name));
  }
  return prefix + "." + name;
}

Nanos published_time(double value, double unit_ns, const std::string& what) {
  const double ms = value * unit_ns / 1e6;
  if (!(ms >= kNanosecondMs && ms <= kLongestMs)) {
    throw JsonError(fmt::format("{} is {}, no time of a call", what, value));
  }
  return from_ms(ms);
}

void add_unit(PublishedBoard& board, const PublishedUnit& unit) {
  if (std::ranges::find(board.units, unit.name, &PublishedUnit::name) == board.units.end()) {
    board.units.push_back(unit);
  }
}

void add_figure(PublishedBoard& board, const PublishedFigure& figure) {
  const auto known = std::ranges::find_if(board.figures, [&](const PublishedFigure& other) {
    return other.workload == figure.workload && other.unit == figure.unit;
  });
  if (known == board.figures.end()) {
    board.figures.push_back(figure);
    return;
  }
  known->samples.insert(known->samples.end(), figure.samples.begin(), figure.samples.end());
  for (const auto& note : figure.notes) {
    if (std::ranges::find(known->notes, note) == known->notes.end()) known->notes.push_back(note);
  }
}

}  // namespace pirt
