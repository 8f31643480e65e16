// pirt plan: the shortest paths of a robot on an occupancy grid.
#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <memory>

#include "cli/commands.h"
#include "cli/options/files.h"
#include "cli/options/output.h"
#include "cli/options/values.h"
#include "reports/document/document.h"
#include "workloads/base/error.h"
#include "workloads/base/text/json.h"
#include "workloads/base/text/text.h"
#include "workloads/planning/map_files.h"
#include "workloads/planning/plan_path.h"

namespace pirt::cli {
namespace {

using planning::Cell;
using planning::CellState;
using planning::Grid;
using planning::Path;
using planning::PathStatus;
using planning::Point;
using planning::PreparedMap;
using planning::Unit;

struct PlanFlags {
  std::string map;
  std::optional<std::string> scenario, start, goal;
  double radius = 0;
  bool paths = false;
  Output json;
};

/// How far a length may be from a published one with eight decimals.
constexpr double kSameLength = 1e-6;

struct Query {
  Cell start, goal;
  std::optional<double> published;  ///< Length in cells.
  double rounding = 0;              ///< Of that.
  Path path = {};

  [[nodiscard]] bool differs() const {
    return published && (path.status != PathStatus::kFound ||
                         std::abs(path.length - *published) > std::max(kSameLength, rounding));
  }
};

Point parse_point(const std::string& option, const std::string& text) {
  constexpr double kFarthest = 1e8;
  const auto parts = split(text, ',');
  if (parts.size() != 2) {
    throw_bad_input(fmt::format("{} must be x,y, e.g. 1.5,2, got '{}'", option, text));
  }
  return {decimal_number(parts[0], -kFarthest, kFarthest).or_refuse(option + " x"),
          decimal_number(parts[1], -kFarthest, kFarthest).or_refuse(option + " y")};
}

std::string text_of(Point point) { return fmt::format("{:.10g},{:.10g}", point.x, point.y); }

/// @throws Error{kBadInput} unless the robot can be there, with the nearest place where it can.
Cell find_cell(const std::string& option, const std::string& text, const Grid& grid,
               const PreparedMap& map, double radius) {
  const Point point = parse_point(option, text);
  const Cell cell = grid.cell_of(point);
  if (map.passable(cell)) return cell;
  std::string why = "is outside the map";
  if (grid.contains(cell)) {
    why = grid.at(cell) == CellState::kFree
              ? fmt::format("is closer to an obstacle than the radius of {} {}", radius,
                            to_string(grid.unit))
              : fmt::format("is in a cell that is {}", to_string(grid.at(cell)));
  }
  const auto nearest = map.nearest_passable(cell);
  if (!nearest) {
    throw_bad_input(fmt::format("{} {} {}, and no cell of the map is free for a radius of {} {}",
                                option, text, why, radius, to_string(grid.unit)));
  }
  throw_bad_input(fmt::format("{} {} {}; the nearest free place is {}", option, text, why,
                              text_of(grid.centre_of(*nearest))));
}

std::vector<Query> read_queries(const PlanFlags& options, const Grid& grid,
                                const PreparedMap& map) {
  if (!options.scenario) {
    return {{find_cell("--start", *options.start, grid, map, options.radius),
             find_cell("--goal", *options.goal, grid, map, options.radius), std::nullopt}};
  }
  std::vector<Query> queries;
  for (const auto& query : planning::read_scenario(*options.scenario, grid)) {
    // A robot with a radius makes detours that the published lengths do not have.
    const auto published = options.radius == 0 ? std::optional(query.optimal_length) : std::nullopt;
    queries.push_back({query.start, query.goal, published, query.rounding});
  }
  return queries;
}

/// A scenario counts cells from the first of the file, whatever the map's unit.
struct MapFrame {
  const Grid& grid;
  bool in_cells;

  [[nodiscard]] Point place(Cell cell) const {
    return in_cells ? Point{static_cast<double>(cell.x), static_cast<double>(cell.y)}
                    : grid.centre_of(cell);
  }
  [[nodiscard]] double length(const Path& path) const {
    return in_cells ? path.length : path.length * grid.resolution;
  }
  [[nodiscard]] std::string unit() const {
    return std::string(to_string(in_cells ? Unit::kCells : grid.unit));
  }
};

Json json_of(const Query& query, const MapFrame& frame, bool with_path) {
  const auto point = [&](Cell cell) {
    const Point at = frame.place(cell);
    return Json{at.x, at.y};
  };
  Json json = {{"start", point(query.start)},
               {"goal", point(query.goal)},
               {"status", std::string(to_string(query.path.status))}};
  if (query.path.status == PathStatus::kFound) json["length"] = frame.length(query.path);
  if (query.published) json["published_length"] = *query.published;
  if (!with_path || query.path.status != PathStatus::kFound) return json;
  auto& path = json["path"] = Json::array();
  for (const Cell cell : query.path.cells) path.push_back(point(cell));
  return json;
}

Document document_of(const std::vector<Query>& queries, const MapFrame& frame) {
  Table table;
  table.columns = {{"start", Align::kLeft},
                   {"goal", Align::kLeft},
                   {"status", Align::kLeft},
                   {"length " + frame.unit()},
                   {"moves"}};
  const bool published = queries.front().published.has_value();
  if (published) table.columns.push_back({"published"});
  for (const auto& query : queries) {
    const bool found = query.path.status == PathStatus::kFound;
    std::vector<std::string> row = {text_of(frame.place(query.start)),
                                    text_of(frame.place(query.goal)),
                                    std::string(to_string(query.path.status)),
                                    found ? fmt::format("{:.8g}", frame.length(query.path)) : "-",
                                    found ? fmt::format("{}", query.path.cells.size() - 1) : "-"};
    if (published) {
      row.push_back(fmt::format("{:.8g}{}", *query.published, query.differs() ? " differs" : ""));
    }
    table.rows.push_back(std::move(row));
  }
  return {"", {std::move(table)}};
}

int plan(const PlanFlags& options) {
  if (options.scenario.has_value() == (options.start && options.goal) ||
      options.start.has_value() != options.goal.has_value()) {
    throw_bad_input("give --scenario FILE, or --start x,y and --goal x,y");
  }
  const Grid grid = planning::read_map(options.map);
  const PreparedMap map(grid, options.radius);
  auto queries = read_queries(options, grid, map);
  planning::PathPlanner planner(map);
  bool good = true;
  for (auto& query : queries) {
    query.path = planner.plan(query.start, query.goal);
    good = good && query.path.status == PathStatus::kFound && !query.differs();
  }
  const MapFrame frame{grid, options.scenario.has_value()};
  Json json = {{"schema_version", 1},   {"map", options.map},       {"width", grid.width},
               {"height", grid.height}, {"radius", options.radius}, {"unit", frame.unit()}};
  auto& rows = json["queries"] = Json::array();
  for (const auto& query : queries) {
    rows.push_back(json_of(query, frame, options.paths || !options.scenario));
  }
  emit(render(document_of(queries, frame), Format::kText), json, options.json);
  return good ? 0 : kExitCheckFailed;
}

}  // namespace

void add_plan(CLI::App& app, Action& action) {
  auto options = std::make_shared<PlanFlags>();
  Command command(app, "plan", "Find shortest paths on an occupancy grid");
  add_input(command, "--map", &options->map,
            "Map: the .yaml of ROS's map_server, or a .map of Moving AI")
      .required();
  add_input(command, "--scenario", &options->scenario,
            "Queries of Moving AI (.scen), in cells; lengths are compared with the published ones");
  add_text(command, "--start", &options->start, "X,Y",
           "One query instead: from here, in the map's frame (ROS: metres; Moving AI: cells)");
  add_text(command, "--goal", &options->goal, "X,Y", "... to here");
  add_value(command, "--radius", &options->radius, "NUMBER", not_within(0.0, 1e6),
            "Of the robot, in metres (Moving AI: cells): kept from obstacles and unknown cells, "
            "between centres of cells")
      .shows_default();
  command.add_flag("--paths", options->paths,
                   "Write the cells of each path of a scenario to --json too");
  add_json(command, options->json);
  command.option("--paths").needs(command.option("--json"));
  command.footer(
      "Exit code 1: there is no path, or a length is not the published one.\n"
      "Example: pirt plan --map depot.yaml --start 2,2 --goal 28,13 --radius 0.22");
  command.runs(action, [options] { return plan(*options); });
}

}  // namespace pirt::cli
