// pirt generate: a generated sequence with exact truth, as an EuRoC folder or a recording of ROS.
#include <fmt/core.h>

#include <algorithm>
#include <limits>
#include <memory>
#include <optional>
#include <thread>

#include "cli/commands.h"
#include "cli/long_run.h"
#include "cli/options/duration.h"
#include "cli/options/files.h"
#include "cli/options/values.h"
#include "workloads/base/error.h"
#include "workloads/inputs/scene/generator.h"
#include "workloads/inputs/sequence/recorded.h"

namespace pirt::cli {
namespace {

struct GenerateFlags {
  std::string folder;
  std::string format = "euroc";
  std::string duration = "60s";
  std::optional<std::string> rest;
  std::string cameras = "stereo";
  std::string shape = "loop";
  std::optional<int> threads;
  std::optional<std::int64_t> room_seed;
  SceneOptions scene;
};

constexpr double kRest = 2;  ///< Seconds.

bool is_zero(const std::string& duration) { return duration == "0" || duration == "0s"; }

int generate(const GenerateFlags& options) {
  if (options.folder.empty()) {
    throw_bad_input(
        "name the folder that is to be made: pirt generate FOLDER (or a kind: dag, bal)");
  }
  if (options.format != "euroc" && !options.folder.ends_with("." + options.format)) {
    throw_bad_input(fmt::format("--format {} makes a file, and '{}' does not end in .{}",
                                options.format, options.folder, options.format));
  }
  for (const std::string other : {"bag", "db3", "mcap"}) {
    if (options.format == "euroc" && options.folder.ends_with("." + other)) {
      throw_bad_input("'" + options.folder + "' would be a folder; add --format " + other +
                      " for a recording");
    }
  }
  if (options.format != "euroc" && options.threads) {
    throw_bad_input("--threads is of folders: a recording is written in order of time");
  }
  SceneOptions scene = options.scene;
  scene.path.duration_s = to_s(parse_duration(options.duration));
  // Of a short sequence, a part; what was asked for is checked where the scene is.
  scene.path.rest_s = !options.rest            ? std::min(kRest, scene.path.duration_s / 4)
                      : is_zero(*options.rest) ? 0.0
                                               : to_s(parse_duration(*options.rest));
  scene.path.shape = options.shape == "turns"  ? PathShape::kTurns
                     : options.shape == "ring" ? PathShape::kRing
                                               : PathShape::kLoop;
  if (options.room_seed) scene.room_seed = static_cast<std::uint64_t>(*options.room_seed);
  scene.stereo = options.cameras == "stereo";
  const Sequence sequence = generate_sequence(scene);
  const FloorMap map = floor_map(scene);
  const int cores = static_cast<int>(std::max(1U, std::thread::hardware_concurrency()));
  const auto* const stop = stop_on_signal();
  const ProgressLine line;
  const auto progress = [&](std::size_t written, std::size_t total) {
    line.show(fmt::format("{} of {} pictures", written, total));
    return !*stop;
  };
  const bool made =
      options.format == "euroc"
          ? write_euroc(
                sequence, options.folder, options.threads.value_or(cores),
                {{"map.yaml", map.yaml}, {"map.pgm", map.pgm}, {"goal.yaml", map.goal_yaml}},
                progress)
          : write_recording(sequence, options.folder, progress);
  line.clear();
  if (!made) throw_environment("interrupted: '" + options.folder + "' is not made");
  double path_m = 0;
  for (std::size_t i = 1; i < sequence.truth.size(); ++i) {
    path_m += (sequence.truth[i].body.position - sequence.truth[i - 1].body.position).norm();
  }
  emit_text(fmt::format("{}: {} frames of {} camera{}, {} IMU samples, path {:.1f} m\n",
                        options.folder, sequence.frames.size(), sequence.cameras.size(),
                        sequence.stereo() ? "s" : "", sequence.imu.size(), path_m),
            {});
  return 0;
}

std::string no_rest(const std::string& text) { return is_zero(text) ? "" : no_duration(text); }

}  // namespace

void add_generate(CLI::App& app, Action& action) {
  auto options = std::make_shared<GenerateFlags>();
  auto& scene = options->scene;
  Command command(
      app, "generate",
      "Generate a sequence of a robot in a textured room (cameras, IMU, truth), in "
      "EuRoC's layout with a floor map, or as a recording of ROS; or, by a kind, something else");
  add_text(command, "folder", &options->folder, "FOLDER", "Folder to make, or recording");
  add_choice(command, "--format", &options->format, "FORMAT", {"euroc", "bag", "db3", "mcap"},
             "A folder of EuRoC's with a floor map, or a recording of ROS 1 or ROS 2 without")
      .shows_default();
  add_value(command, "--duration", &options->duration, "DURATION", no_duration,
            "Length of the sequence")
      .shows_default();
  add_value(command, "--rest", &options->rest, "DURATION", no_rest,
            "Rest at the start, or 0 (default: 2s, at most a quarter of the sequence)");
  add_choice(command, "--cameras", &options->cameras, "WHICH", {"stereo", "mono"}, "How many")
      .shows_default();
  add_choice(command, "--path", &options->shape, "SHAPE", {"loop", "turns", "ring"},
             "Around the room, two turns of 90 degrees between straights, or in place of the room "
             "around a square corridor, 25 m a side")
      .shows_default();
  add_value(command, "--width", &scene.width, "INTEGER", not_within(64, 4096), "Pixels")
      .shows_default();
  add_value(command, "--height", &scene.height, "INTEGER", not_within(64, 4096), "Pixels")
      .shows_default();
  add_value(command, "--rate", &scene.camera_rate_hz, "HZ", not_within(1.0, 1000.0),
            "Frames a second")
      .shows_default();
  add_value(command, "--noise", &scene.noise_levels, "LEVELS", not_within(0.0, 50.0),
            "Sigma of the pictures' noise, in grey levels")
      .shows_default();
  add_value(command, "--exposure-ms", &scene.exposure_ms, "MS", not_within(0.0, 1000.0),
            "Motion blur")
      .shows_default();
  add_value(command, "--threads", &options->threads, "INTEGER", not_within(1, 256),
            "Threads that render (default: all cores)");
  add_seed(command, scene.path.seed, "Same seed, same bytes");
  add_value(command, "--room-seed", &options->room_seed, "INTEGER",
            not_within(std::int64_t{0}, std::numeric_limits<std::int64_t>::max()),
            "Seed of the room and its textures, so that another path leads through the same one "
            "(default: --seed's)");
  command.footer("Example: pirt generate --seed 7 --duration 60s out/ && pirt run-robot out/");
  command.runs(action, [options] { return generate(*options); });
}

}  // namespace pirt::cli
