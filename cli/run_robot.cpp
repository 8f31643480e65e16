// pirt run-robot: localization on a recorded sequence. The driver here is serial, without the
// runtime; what is printed and written does not depend on the driver.
#include <fmt/format.h>

#include <memory>
#include <optional>

#include "cli/commands.h"
#include "cli/files.h"
#include "cli/output.h"
#include "cli/values.h"
#include "workloads/base/error.h"
#include "workloads/base/json_value.h"
#include "workloads/slam/map_file.h"
#include "workloads/slam/pipeline.h"
#include "workloads/slam/plot.h"
#include "workloads/slam/summary.h"

namespace pirt::cli {
namespace {

struct Options {
  std::string dataset;
  std::optional<std::string> map;
  bool no_update = false;
  bool mono = false;
  bool no_imu = false;
  Output json, trajectory, plot, save_map;
};

constexpr const char* kDriver = "serial, without the runtime";

/// What a driver gives; nothing below knows which one it was.
struct Outcome {
  slam::RunResult result;
  slam::ShownFrame shown;  ///< Of the middle of the sequence.
};

Outcome run_serial(const Sequence& sequence, const slam::RunOptions& given) {
  Outcome outcome;
  slam::RunOptions options = given;
  const MachineClock clock;
  options.clock = &clock;
  const std::size_t middle = sequence.frames.size() / 2;
  options.seen = [&](std::size_t frame, const slam::State& state, const GreyImage& image,
                     const slam::FrameResult&) {
    if (frame == middle) outcome.shown = slam::show(state, image);
  };
  outcome.result = slam::run_serially(sequence, options);
  return outcome;
}

Sequence read(const Options& options) {
  if (options.dataset.empty()) throw_bad_input("name the folder of a sequence");
  Sequence sequence = read_sequence(options.dataset);
  if (options.mono) {
    sequence.cameras.resize(1);
    for (auto& frame : sequence.frames) frame.present.resize(1);
  }
  if (options.no_imu) {
    sequence.imu.clear();
    sequence.imu_model.reset();
  }
  return sequence;
}

std::string sensors_of(const slam::Setup& setup) {
  return fmt::format("{} camera{}, {}", setup.cameras.size(), setup.cameras.size() == 1 ? "" : "s",
                     setup.imu ? "IMU" : "no IMU");
}

std::string text_of(const slam::RunSummary& s, const slam::Setup& setup) {
  std::string text =
      fmt::format("driver         {}\nsensors        {}\n", kDriver, sensors_of(setup));
  text += fmt::format("frames         {}: {} tracking, {} starting, {} lost; {} without contrast\n",
                      s.frames, s.tracking, s.starting, s.lost, s.unusable);
  text += fmt::format("rate           {:.1f} Hz (pictures are read apart)\n", s.rate_hz);
  text += fmt::format("map            {} landmarks in the filter, {} points outside\n\n",
                      s.landmarks, s.map_points);
  text += fmt::format("{:<17} {:>8} {:>8} {:>8} {:>8}\n", "stage, ms", "mean", "p50", "p95", "p99");
  for (const auto& stage : s.stages) {
    text += fmt::format("{:<17} {:>8.3f} {:>8.3f} {:>8.3f} {:>8.3f}\n", stage.name, stage.mean_ms,
                        stage.p50_ms, stage.p95_ms, stage.p99_ms);
  }
  if (!s.error) return text + "\nno truth: errors are not known\n";
  const auto& e = *s.error;
  text += fmt::format(
      "\nposition       RMS {:.4f} m, most {:.4f} m, {:.3f} % of the path of {:.2f} "
      "m ({})\n",
      e.ate_rms_m, e.ate_max_m, e.path_m > 0 ? 100 * e.ate_rms_m / e.path_m : 0.0, e.path_m,
      s.scale_known ? "SE(3)-aligned" : "Sim(3)-aligned: one camera has no scale");
  if (s.constant_velocity_ate_rms_m) {
    text += fmt::format("               (constant velocity: RMS {:.4f} m)\n",
                        *s.constant_velocity_ate_rms_m);
  }
  text += fmt::format(
      "rotation       {:.4f} degrees over 1 frame, {:.4f} over 10 (no turn at all: "
      "{:.4f} and {:.4f})\n",
      s.rotation_1_frame_deg, s.rotation_10_frames_deg, s.rotation_1_trivial_deg,
      s.rotation_10_trivial_deg);
  return text + fmt::format("attitude       {:.4f} degrees, aligned\n", e.rotation_error_mean_deg);
}

Json json_of(const Options& options, const slam::RunSummary& s, const slam::Setup& setup) {
  Json json = {{"schema_version", 1},
               {"dataset", options.dataset},
               {"driver", kDriver},
               {"cameras", setup.cameras.size()},
               {"imu", setup.imu.has_value()},
               {"update", setup.update},
               {"frames", s.frames},
               {"frames_tracking", s.tracking},
               {"frames_starting", s.starting},
               {"frames_lost", s.lost},
               {"frames_without_contrast", s.unusable},
               {"rate_hz", s.rate_hz},
               {"landmarks", s.landmarks},
               {"map_points", s.map_points}};
  for (const auto& stage : s.stages) {
    json["stages"].push_back({{"name", stage.name},
                              {"mean_ms", stage.mean_ms},
                              {"p50_ms", stage.p50_ms},
                              {"p95_ms", stage.p95_ms},
                              {"p99_ms", stage.p99_ms}});
  }
  if (!s.error) return json;
  json["alignment"] = s.scale_known ? "se3" : "sim3";
  json["path_m"] = s.error->path_m;
  json["ate_rms_m"] = s.error->ate_rms_m;
  json["ate_max_m"] = s.error->ate_max_m;
  json["scale"] = s.error->scale;
  // Over one frame, which needs no alignment: a straight drive has no attitude to align.
  json["rotation_error_mean_deg"] = s.rotation_1_frame_deg;
  json["rotation_error_10_frames_deg"] = s.rotation_10_frames_deg;
  json["rotation_trivial_mean_deg"] = s.rotation_1_trivial_deg;
  json["rotation_trivial_10_frames_deg"] = s.rotation_10_trivial_deg;
  json["attitude_error_mean_deg"] = s.error->rotation_error_mean_deg;
  if (s.constant_velocity_ate_rms_m) {
    json["constant_velocity_ate_rms_m"] = *s.constant_velocity_ate_rms_m;
  }
  return json;
}

std::string picture(const Options& options, const Sequence& sequence, const Outcome& outcome,
                    const slam::RunSummary& summary) {
  slam::Plot plot;
  plot.trajectory = outcome.result.trajectory();
  if (summary.error) plot.truth = sequence.truth;
  plot.alignment = summary.scale_known ? Alignment::kSe3 : Alignment::kSim3;
  plot.frame = outcome.shown;
  plot.title = summary.error ? fmt::format("{}: RMS {:.3f} m on {:.1f} m", options.dataset,
                                           summary.error->ate_rms_m, summary.error->path_m)
                             : options.dataset;
  return options.plot.path().ends_with(".svg") ? slam::plot_svg(plot) : slam::plot_png(plot);
}

int run_robot(const Options& options) {
  if (options.plot && !options.plot.path().ends_with(".svg") &&
      !options.plot.path().ends_with(".png")) {
    throw_bad_input("--plot '" + options.plot.path() + "' must end in .png or .svg");
  }
  const Sequence sequence = read(options);
  warn_all(sequence.warnings);
  slam::RunOptions run;
  run.setup = slam::setup_of(sequence);
  run.setup.update = !options.no_update;
  if (options.map) run.start = slam::load_map(*options.map, run.setup);
  const Outcome outcome = run_serial(sequence, run);
  const auto summary = slam::summarize(sequence, outcome.result, run.setup);
  emit(text_of(summary, run.setup), json_of(options, summary, run.setup), options.json);
  if (options.trajectory) emit_text(tum_text(outcome.result.trajectory()), options.trajectory);
  if (options.save_map) {
    emit_text(slam::map_text(outcome.result.last, run.setup), options.save_map);
  }
  if (options.plot) emit_text(picture(options, sequence, outcome, summary), options.plot);
  return 0;
}

}  // namespace

void add_run_robot(CLI::App& app, Action& action) {
  auto options = std::make_shared<Options>();
  Command command(app, "run-robot",
                  "Localize a robot on a recorded sequence (EuRoC's layout or KITTI odometry)");
  add_input(command, "dataset", &options->dataset, "Folder of the sequence");
  command.add_flag("--mono", options->mono, "Use the left camera only");
  command.add_flag("--no-imu", options->no_imu, "Use the cameras only");
  command.add_flag("--no-update", options->no_update,
                   "Only predict, to see the drift that updates correct");
  add_input(command, "--load-slam-map", &options->map, "Know the place from a map that was saved");
  add_output(command, "--save-slam-map", options->save_map, "Write the map at the end",
             StdoutUse::kRefused);
  add_output(command, "--trajectory", options->trajectory,
             "Write the trajectory in the TUM format (s, x y z, qx qy qz qw)");
  add_output(command, "--plot", options->plot,
             "Draw the trajectory, with truth, and a frame's features: .png or .svg",
             StdoutUse::kRefused);
  add_json(command, options->json);
  command.footer("Example: pirt generate --seed 7 --duration 60s out/ && pirt run-robot out/");
  command.runs(action, [options] { return run_robot(*options); });
}

}  // namespace pirt::cli
