#include "characterize/published/published.h"

#include <fmt/core.h>

#include <algorithm>

#include "characterize/campaign/run_facts.h"
#include "characterize/machine/environment.h"
#include "workloads/base/error.h"
#include "workloads/base/text/json.h"

namespace pirt {
namespace {

constexpr const char* kPublished = "published";

/// In double quotes, as YAML and JSON both read them.
std::string quoted(const std::string& text) { return json_text(Json(text)); }

}  // namespace

Publication read_publication(const std::string& file, const std::string& text) {
  const auto first = text.find_first_not_of(" \t\r\n");
  if (first == std::string::npos) throw_bad_input("'" + file + "' is empty");
  if (text[first] == '{') return read_ros2_benchmark(file, text);
  const std::string head = text.substr(first, text.find('\n', first) - first);
  return head.find(',') != std::string::npos && head.find(": ") == std::string::npos
             ? read_ncnn(file, text)
             : read_robotperf(file, text);
}

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
  header.environment["mode"] = kPublished;
  header.environment["precision"] = kPublished;  // Is identity: nothing is compared with it.
  for (const PublishedUnit& unit : board.units) {
    header.units.push_back({.unit = unit.name,
                            .backend = kPublished,
                            .device = unit.device,
                            .device_is_cpu = unit.is_cpu,
                            .cores = {}});
  }
  const std::int64_t run_id = writer.begin_run(header);
  for (const PublishedFigure& figure : board.figures) {
    CellRecord cell;
    cell.workload = figure.workload;
    cell.unit = figure.unit;
    cell.verification = "not verified: published figures";
    PhaseRecord call;
    call.phase = Phase::kCall;
    call.provenance = Provenance::kPublished;
    call.notes = figure.notes;
    call.samples = figure.samples;
    // Nobody says that they were taken by one process.
    for (std::size_t i = 0; i < figure.samples.size(); ++i) {
      call.processes.push_back(static_cast<std::int32_t>(i));
    }
    cell.phases.push_back(std::move(call));
    writer.write_cell(run_id, cell);
  }
  writer.finish_run(run_id, utc_now());
  return run_id;
}

std::string published_platform(const PublishedBoard& board, const std::string& source) {
  std::string text = fmt::format(
      "platform: {}\ndescription: {}\nassumptions: {}\nunits:\n", board.name,
      quoted(board.said + ", as published: " + source),
      quoted(
          "The watts of the units are published nowhere here; set them, or energy is not known."));
  for (const PublishedUnit& unit : board.units) {
    text += fmt::format("  {}: {{servers: 1, slots: 1}}  # {}\n", unit.name, unit.device);
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
