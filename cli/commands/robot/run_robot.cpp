// pirt run-robot: localization on a recorded sequence, live through the runtime, or serially
// without it.
#include <fmt/format.h>
#include <malloc.h>

#include <algorithm>
#include <atomic>
#include <memory>
#include <optional>

#include "cli/commands.h"
#include "cli/commands/robot/robot_flags.h"
#include "cli/long_run.h"
#include "cli/options/duration.h"
#include "cli/options/files.h"
#include "cli/options/output.h"
#include "cli/options/own.h"
#include "cli/options/profile_platform.h"
#include "cli/options/shipped.h"
#include "cli/options/values.h"
#include "reports/document/document.h"
#include "reports/run/robot_recording.h"
#include "reports/run/robot_report.h"
#include "scheduler/policies/policy.h"
#include "scheduler/schedule.h"
#include "workloads/base/error.h"
#include "workloads/base/text/json.h"
#include "workloads/base/text/text.h"
#include "workloads/inputs/sequence/bad_pictures.h"
#include "workloads/inputs/sequence/recorded.h"
#include "workloads/slam/run/camera_imu.h"
#include "workloads/slam/run/map_file.h"

namespace pirt::cli {
namespace {

struct RunRobotFlags {
  std::string dataset;
  std::optional<std::string> slam_map, topics, calibration, truth;
  std::string stereo_tolerance = "3ms";
  ActivityFlags activities;
  bool no_update = false, no_map = false, mono = false, no_imu = false;
  bool serial = false, fast = false, comparing = false, strict = false;
  std::optional<std::string> mode, slices;
  std::string compare;  ///< Modes, with commas; empty = the paper's.
  std::optional<std::string> profile, platform;
  OwnFiles own;
  std::vector<std::string> settings;
  std::optional<std::string> duration;
  int in_flight = 2;
  double camera_late_ms = 0;
  Output json, trajectory, plot, save_map, trace, record;
};

Sequence read(const RunRobotFlags& options) {
  if (options.dataset.empty()) throw_bad_input("name the folder of a sequence, or a recording");
  Sequence sequence = read_sequence(
      options.dataset, {.imu = !options.no_imu,
                        .second_camera = !options.mono,
                        .topics = options.topics ? parse_topics(*options.topics) : SequenceTopics{},
                        .calibration = options.calibration.value_or(""),
                        .truth = options.truth.value_or(""),
                        .pair_tolerance = parse_duration(options.stereo_tolerance)});
  if (!sequence.imu.empty()) {
    for (Frame& frame : sequence.frames) frame.time -= from_ms(options.camera_late_ms);
  } else if (options.camera_late_ms != 0) {
    sequence.warnings.push_back(
        "--camera-late is by the IMU's stamps, and there is no IMU: pictures keep theirs");
  }
  if (options.duration) {
    const Nanos end = sequence.frames.front().time + parse_duration(*options.duration);
    std::erase_if(sequence.frames, [&](const Frame& frame) { return frame.time >= end; });
  }
  return sequence;
}

void check(const RunRobotFlags& options) {
  if (options.record && !options.record.path().ends_with(".mcap")) {
    throw_bad_input("--record '" + options.record.path() + "' must end in .mcap");
  }
  if (options.plot && !options.plot.path().ends_with(".svg") &&
      !options.plot.path().ends_with(".png")) {
    throw_bad_input("--plot '" + options.plot.path() + "' must end in .png or .svg");
  }
}

RuntimeOptions runtime_options(const RunRobotFlags& options) {
  // Without a profile, what is usual of this machine.
  auto platform = options.platform;
  if (!platform && !options.profile) platform = "host";
  const auto own = options.own.all();
  learn(own);
  for (const std::string& file : own) {
    const auto names = known_of(file);
    warn(fmt::format(
        "--workloads: a robot's steps are pirt's own, and none of {} is computed here; a mix has "
        "them beside others (pirt schedule --live), or a program of yours "
        "(RuntimeOptions::workloads)",
        join(std::vector(names.begin(), names.end()), ", ")));
  }
  auto read = read_platform(platform, options.profile, parse_overrides(options.settings), own);
  RuntimeOptions runtime;
  runtime.platform = std::move(read.platform);
  runtime.profile = std::move(read.profile);
  runtime.strict = options.strict;
  runtime.mode = options.mode.value_or("ect");
  runtime.slices = options.slices != "off";
  if (options.trace) runtime.trace = options.trace.path();
  runtime.progress = say;
  runtime.problem = [said = std::make_shared<std::atomic<int>>(0)](const std::string& line) {
    constexpr int kMostLines = 200;
    if (++*said <= kMostLines) say(line);
  };
  return runtime;
}

/// One robot, to be run in one way or several.
struct Robot {
  const Sequence& sequence;
  LocalizationOptions localization;
  std::optional<ActivityOptions> activities;

  /// @param live  Otherwise serially, without the runtime.
  [[nodiscard]] RobotRun run(bool live) const {
    LocalizationOptions options = localization;
    std::optional<Activities> companion;
    if (activities) options.companion = &companion.emplace(*activities);
    auto result = live ? localize_live(sequence, options) : localize_serially(sequence, options);
    if (!live) warn_all(result.problems);  // The runtime's were said as they came.
    const std::string mode = live ? options.runtime.mode : "";
    return robot_run(
        live ? fmt::format("live, mode {} on platform {}", mode, options.runtime.platform.name)
             : "serial, without the runtime",
        mode, sequence, options, std::move(result), companion ? &*companion : nullptr);
  }
};

/// Whether it knew at some time where it is.
bool has_tracked(const RobotRun& run) {
  return std::ranges::any_of(run.result.run.frames, [](const slam::FrameResult& frame) {
    return frame.status == slam::Status::kTracking;
  });
}

int compare(const RunRobotFlags& options, Robot robot) {
  const auto modes = options.compare.empty() ? paper_modes() : find_policies(options.compare);
  std::vector<RobotRun> runs;
  runs.push_back(robot.run(false));
  if (robot.activities && robot.activities->corrects_map && robot.localization.stops() == 0) {
    Robot keeping = robot;
    keeping.activities->corrects_map = false;
    runs.push_back(keeping.run(false));
    runs.back().driver += ", its map as it was";
  }
  const std::size_t serial_runs = runs.size();
  std::vector<std::string> skipped;
  bool failed = false;
  for (const auto& mode : modes) {
    if (robot.localization.stops() > 0) {
      skipped.push_back(fmt::format("Not run: {}: interrupted", mode));
      continue;
    }
    robot.localization.runtime.mode = mode;
    try {
      runs.push_back(robot.run(true));
    } catch (const Error& error) {
      failed = failed || error.code() != ErrorCode::kBadInput;
      skipped.push_back(fmt::format("Not run: {}: {}", mode, error.what()));
    }
  }
  const bool interrupted = robot.localization.stops() > 0;
  if (runs.size() == serial_runs && !skipped.empty() && !interrupted && !failed)
    throw_bad_input(skipped.front());
  const bool lost = !options.no_update && std::ranges::none_of(runs, has_tracked);
  Table table = robot_comparison(runs);
  for (const RobotRun& each : runs) {
    if (!each.result.stopped) continue;
    table.footnotes.push_back(fmt::format(
        "Interrupted: {}: its figures are of what ran, not to be compared with the others",
        each.driver));
  }
  std::ranges::copy(skipped, std::back_inserter(table.footnotes));
  Json json = {{"schema_version", 1}, {"dataset", options.dataset}};
  for (const RobotRun& each : runs) json["runs"].push_back(robot_json(each, options.dataset));
  for (const std::string& each : skipped) json["not_run"].push_back(each);
  emit(render({.title = "", .parts = {std::move(table)}}, Format::kText), json, options.json);
  if (lost && !interrupted) warn("nothing was localized in any of the runs");
  return interrupted || failed || lost ? kExitEnvironment : 0;
}

std::string picture(const RunRobotFlags& options, const Sequence& sequence, const RobotRun& run) {
  slam::Plot plot = slam::plot_of(run.result.run, run.setup);
  if (run.summary.error) plot.truth = sequence.truth;
  plot.alignment = run.summary.scale_known ? Alignment::kSe3 : Alignment::kSim3;
  plot.frame = run.result.shown;
  plot.title = run.summary.error
                   ? fmt::format("{}: RMS {:.3f} m on {:.1f} m", options.dataset,
                                 run.summary.error->ate_rms_m, run.summary.error->path_m)
                   : options.dataset;
  return options.plot.path().ends_with(".svg") ? slam::plot_svg(plot) : slam::plot_png(plot);
}

/// Each frame's pictures and matrices are as large as the last one's: what was freed is kept, not
/// given to the system and asked for again, page by page (0.4 of 6.2 ms a frame).
void keep_freed_memory() {
  mallopt(M_MMAP_THRESHOLD, 32 << 20);
  mallopt(M_TRIM_THRESHOLD, 512 << 20);
}

int run_robot(const RunRobotFlags& options) {
  check(options);
  keep_freed_memory();
  Sequence sequence = read(options);
  warn_all(sequence.warnings);
  const auto bad_pictures = leave_out_bad_pictures(sequence);
  if (const auto fit = slam::fit_camera_to_imu(sequence)) warn_all(slam::warnings_of(*fit));
  warn_all(slam::warnings_of(slam::compare_imu(sequence), sequence));
  LocalizationOptions run;
  run.setup = slam::setup_of(sequence);
  run.setup.update = !options.no_update;
  run.setup.recognize = !options.no_map;
  if (options.slam_map) run.setup.known = slam::load_map(*options.slam_map, run.setup);
  if (!options.serial) run.runtime = runtime_options(options);
  run.own_rate = !options.fast;
  run.most_in_flight = static_cast<std::size_t>(options.in_flight);
  if (options.plot) run.show = sequence.frames.size() / 2;
  run.stops = [stops = count_stop_signals(), bad_pictures] {
    return std::max(stops->load(), bad_pictures->are_too_many() ? 1 : 0);
  };
  Robot robot{.sequence = sequence,
              .localization = std::move(run),
              .activities = options.activities.options(options.dataset, sequence)};
  const auto tell_of_pictures = [&bad_pictures] {
    warn_all(bad_pictures->warnings());
    if (bad_pictures->are_too_many()) {
      warn(fmt::format("more than {:.0f} % of the pictures cannot be read: the run ends there",
                       100 * kMostBadPart));
    }
  };
  if (options.comparing) {
    const int code = compare(options, std::move(robot));
    tell_of_pictures();
    return code;
  }
  const RobotRun done = robot.run(!options.serial);
  tell_of_pictures();
  Results results;
  const bool shown = !options.trajectory.to_stdout();  // Lines of two kinds would be of no use.
  results.emit(shown ? robot_text(done) : "", robot_json(done, options.dataset), options.json);
  // What is there from another time is better than nothing.
  const bool tracked = has_tracked(done);
  for (const Output* each : {&options.trajectory, &options.save_map}) {
    if (*each && !tracked && !each->to_stdout()) {
      warn("no frame was tracked: " + each->option() + " leaves '" + each->path() + "' as it is");
    }
  }
  if (options.trajectory && (tracked || options.trajectory.to_stdout())) {
    results.write(tum_text(done.result.run.trajectory()), options.trajectory);
  }
  if (options.activities.scenes) {
    std::string lines;
    for (const auto& scene : done.scenes) lines += scene + "\n";
    results.write(lines, options.activities.scenes);
  }
  if (options.save_map && tracked) {
    results.write(slam::map_text(done.result.run.last, done.setup), options.save_map);
  }
  if (options.record) results.write(robot_recording(done), options.record);
  if (options.plot) results.write(picture(options, sequence, done), options.plot);
  if (!done.result.trace_problem.empty()) results.add(done.result.trace_problem);
  results.check();
  if (!tracked && !options.no_update && !done.result.stopped) {
    warn(
        fmt::format("nothing was localized: of {} frames {} were starting and {} lost; the first "
                    "pictures need texture, and the robot has to move",
                    done.summary.frames, done.summary.starting, done.summary.lost));
    return kExitEnvironment;
  }
  return done.result.stopped ? kExitEnvironment : 0;
}

}  // namespace

void add_run_robot(CLI::App& app, Action& action) {
  auto options = std::make_shared<RunRobotFlags>();
  Command command(app, "run-robot",
                  "Localize a robot on a recorded sequence (EuRoC's layout, KITTI odometry, a "
                  "recording of ROS), "
                  "live");
  add_input(command, "dataset", &options->dataset,
            "Folder of the sequence, or a recording: a .bag of ROS 1, a .db3 or .mcap of ROS 2, or "
            "their folder");
  add_text(command, "--topics", &options->topics, "WHAT=TOPIC,...",
           "Topics of a recording: left, right, imu, truth, e.g. left=/cam0/image_raw,imu=none "
           "(default: found by their types)");
  add_input(
      command, "--calibration", &options->calibration,
      "What a recording without CameraInfo, or a folder without sensor.yaml, does not say of its "
      "cameras: Kalibr's camchain, EuRoC's sensor.yaml or their folder, or the file of ROS's "
      "camera_calibration");
  add_input(command, "--truth", &options->truth,
            "Where the robot really was, in the TUM format (s, x y z, qx qy qz qw) (default: what "
            "the sequence says)");
  add_value(command, "--stereo-tolerance", &options->stereo_tolerance, "DURATION", no_duration,
            "Pictures of two cameras that are no farther apart, nor than a third of the time "
            "between two, are of one moment")
      .shows_default();
  command.add_flag("--fast", options->fast,
                   "As fast as it goes, not at the sequence's own rate; no frame is dropped");
  add_value(command, "--duration", &options->duration, "DURATION", no_duration,
            "Only so much of the sequence, e.g. 20s (default: all)");
  add_choice(command, "--mode", &options->mode, "MODE", runtime_policy_names(),
             "Policy that chooses the units (default: ect)");
  add_choice(
      command, "--slices", &options->slices, "WHETHER", {"on", "off"},
      "Let the next frame's steps in between two slices of a longer call, where its workload "
      "can be left there (default: on)");
  const Option compare = command.add(
      "--compare", &options->compare,
      "Instead of --mode: first serially without the runtime, then live in these modes, with "
      "commas (default: the paper's), shown as one table");
  compare.takes(0, 1).type("MODE,...").offers(runtime_policy_names());
  command.add_flag("--serial", options->serial, "In one thread, without the runtime");
  add_input(command, "--platform", &options->platform,
            "A name of `pirt list platforms`, or a YAML file (default: the profile's, else host)",
            FileUse::kReadIfFile)
      .offers(offer_platforms());
  add_strict(command, options->strict);
  add_settings(command, options->settings);
  add_input(command, "--profile", &options->profile,
            "Profile database of pirt characterize; without one all units count as equally fast");
  add_workloads(command, options->own);
  add_value(command, "--in-flight", &options->in_flight, "INTEGER", not_within(1, 1000),
            "Frames at a time; one that finds more is dropped")
      .shows_default();
  add_activities(command, options->activities);
  command.add_flag("--mono", options->mono, "Use the left camera only");
  command.add_flag("--no-imu", options->no_imu, "Use the cameras only");
  add_value(
      command, "--camera-late", &options->camera_late_ms, "MS", not_within(-1000.0, 1000.0),
      "By how much pictures' stamps are later than the IMU's, in ms; what a sequence says of it "
      "is warned of");
  command.add_flag("--no-update", options->no_update,
                   "Only predict, to see the drift that updates correct");
  command.add_flag("--no-map", options->no_map,
                   "Know no place again that was lost from view, to see the drift that it ends");
  add_input(command, "--load-slam-map", &options->slam_map,
            "Find the place in a map that was saved; until then, and where it is another place's, "
            "the robot goes on in a world of its own");
  add_output(command, "--save-slam-map", options->save_map,
             "Write the run's map at the end, with the loaded one if that was found",
             StdoutUse::kRefused);
  add_output(command, "--trajectory", options->trajectory,
             "Write the trajectory in the TUM format (s, x y z, qx qy qz qw)");
  add_output(command, "--record", options->record,
             "Write poses, planned paths, detections and latencies as an MCAP recording, for "
             "Foxglove",
             StdoutUse::kRefused);
  add_output(
      command, "--plot", options->plot,
      "Draw the trajectory with truth, map and where it was known again, and a frame's features: "
      ".png or .svg",
      StdoutUse::kRefused);
  add_output(command, "--trace", options->trace,
             "Write what happened to a file, for Perfetto (ui.perfetto.dev) and pirt replay",
             StdoutUse::kRefused);
  add_json(command, options->json);
  // --serial runs without the runtime, --compare has that run in it and more than one besides.
  command.option("--no-map").excludes(command.option("--load-slam-map"));
  command.option("--strict").needs(command.option("--profile"));
  for (const auto* name : {"--mode", "--platform", "--profile", "--set", "--in-flight", "--trace",
                           "--strict", "--workloads", "--slices"})
    command.option("--serial").excludes(command.option(name));
  for (const auto* name : {"--serial", "--mode", "--trace", "--trajectory", "--plot",
                           "--save-slam-map", "--scenes", "--record"})
    compare.excludes(command.option(name));
  command.footer("Example: pirt generate --seed 7 --duration 60s out/ && pirt run-robot out/");
  command.runs(action, [options, compare] {
    options->comparing = compare.given();
    return run_robot(*options);
  });
}

}  // namespace pirt::cli
