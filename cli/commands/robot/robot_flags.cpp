#include "cli/commands/robot/robot_flags.h"

#include <filesystem>
#include <numbers>
#include <vector>

#include "cli/options/files.h"
#include "cli/options/values.h"
#include "workloads/base/error.h"
#include "workloads/base/text/numbers.h"
#include "workloads/base/text/text.h"
#include "workloads/base/text/yaml.h"
#include "workloads/planning/map_files.h"
#include "workloads/slam/run/pipeline.h"

namespace pirt::cli {
namespace {

constexpr double kFarthest = 1e6;
constexpr const char* kGoal = "x,y in metres, e.g. 1.5,2";
constexpr const char* kStartText = "x,y,degrees, e.g. 1.5,2,90";

/// "1.5,2" as so many numbers.
std::vector<double> parse_numbers(const std::string& option, const std::string& text,
                                  std::size_t count, const std::string& form) {
  const auto parts = split(text, ',');
  if (parts.size() != count) {
    throw_bad_input(option + " must be " + form + ", got '" + text + "'");
  }
  std::vector<double> numbers;
  for (const auto& part : parts) {
    numbers.push_back(decimal_number(part, -kFarthest, kFarthest).or_refuse(option));
  }
  return numbers;
}

/// The option's numbers, else those of @p file, as a generated sequence has it.
std::vector<double> numbers_of(const std::optional<std::string>& given, const std::string& key,
                               const std::filesystem::path& file, std::size_t count,
                               const std::string& form) {
  if (given) return parse_numbers("--" + key, *given, count, form);
  if (std::filesystem::exists(file)) {
    const YamlNode root = parse_yaml(file.string(), read_text(file));
    if (root.is_map() && root.has(key)) {
      const YamlNode list = root.at(key);
      std::vector<double> numbers;
      for (const YamlNode& each : list.items()) {
        numbers.push_back(each.number(-kFarthest, kFarthest));
      }
      if (numbers.size() != count) list.fail("must be " + form);
      return numbers;
    }
  }
  throw_bad_input("give --" + key + ": " + form);
}

}  // namespace

std::optional<ActivityOptions> ActivityFlags::options(const std::string& dataset,
                                                      const Sequence& sequence) const {
  const auto refuse_without = [&](const std::string& why) {
    if (map || goal || start || (localize_only && model.model)) throw_bad_input(why);
  };
  if (localize_only) {
    refuse_without(
        "--localize-only leaves planning and recognition out, and with them --map, --goal, --start "
        "and --model");
    return std::nullopt;
  }
  const std::filesystem::path folder = dataset;
  std::optional<std::filesystem::path> grid;
  if (map) grid = *map;
  if (!map && std::filesystem::exists(folder / "map.yaml")) grid = folder / "map.yaml";
  if (!grid) refuse_without("--goal and --start are places on a map; give one with --map");
  if (!grid && !model.model) return std::nullopt;
  ActivityOptions activities;
  activities.setup = slam::setup_of(sequence);
  activities.corrects_map = !keep_map;
  activities.width = sequence.cameras[0].width;
  activities.height = sequence.cameras[0].height;
  if (model.model) activities.model = model.options();
  if (classifier.model) activities.classifier = classifier.options();
  if (!grid) return activities;
  if (!sequence.stereo() && sequence.imu.empty()) {
    throw_bad_input(
        "one camera without an IMU has no scale, and so no place on a map; add --localize-only");
  }
  const auto to = numbers_of(goal, "goal", folder / "goal.yaml", 2, kGoal);
  const auto from = numbers_of(start, "start", folder / "goal.yaml", 3, kStartText);
  ActivityOptions::Planning planning;
  planning.map = planning::read_map(*grid);
  planning.goal = {to[0], to[1]};
  planning.start = {{from[0], from[1]}, from[2] * std::numbers::pi / 180};
  activities.planning = std::move(planning);
  return activities;
}

void add_activities(Command& command, ActivityFlags& flags) {
  add_input(
      command, "--map", &flags.map,
      "Occupancy grid of ROS map_server (default: map.yaml in the sequence's folder); with one "
      "the robot plans, avoids obstacles and recognizes besides");
  add_text(command, "--goal", &flags.goal, "X,Y",
           "Where to, in metres on the map (default: goal.yaml's)");
  add_text(command, "--start", &flags.start, "X,Y,DEGREES",
           "Where on the map the robot stands, and its left camera looks, when the sequence begins "
           "(default: goal.yaml's)");
  add_model(command, flags.model, "", "a detector, in place of AlexNet with seeded weights");
  add_fit(command, flags.model);
  add_model(command, flags.classifier, "classifier",
            "a classifier beside the detector, for the labels of scenes (default: none)");
  add_output(command, "--scenes", flags.scenes,
             "Write what the detector sees every 10 s, as pirt describe does: a line of JSON each",
             StdoutUse::kRefused);
  for (const char* name : {"--classifier", "--scenes"}) {
    command.option(name).needs(command.option("--model"));
  }
  command.add_flag("--keep-map", flags.keep_map,
                   "Keyframes are adjusted and reported, and their points do not come into the "
                   "localization's map");
  command.add_flag("--localize-only", flags.localize_only,
                   "Nothing but localization, whatever map there is");
}

}  // namespace pirt::cli
