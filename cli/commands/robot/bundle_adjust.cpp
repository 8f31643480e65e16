// pirt bundle-adjust: moves the cameras and points of a problem to where they fit what was seen.
#include "workloads/mapping/bundle_adjust.h"

#include <fmt/core.h>

#include <algorithm>
#include <memory>

#include "cli/commands.h"
#include "cli/long_run.h"
#include "cli/options/files.h"
#include "cli/options/output.h"
#include "cli/options/values.h"
#include "workloads/base/text/json.h"

namespace pirt::cli {
namespace {

struct BundleAdjustFlags {
  std::string problem;
  std::string loss = "none";
  std::optional<double> loss_px;
  mapping::BundleOptions adjust;
  Output output, json;
};

std::string text_of(const mapping::BalProblem& problem, const mapping::BundleSummary& summary) {
  return fmt::format(
      "{} cameras, {} points, {} observations\n"
      "cost     {:.6g} -> {:.6g} px^2 (half the sum of squares), {} iterations, {}\n"
      "inliers  {} of {} observations, RMS {:.4f} px a coordinate\n"
      "noise    {:.4f} px a coordinate, corrected for {} parameters\n",
      problem.camera_count(), problem.point_count(), problem.observations.size(),
      summary.initial_cost, summary.final_cost, summary.iterations,
      summary.converged ? "converged" : "not converged", summary.inliers,
      problem.observations.size(), summary.inlier_rms_px, summary.noise_px,
      summary.free_parameters);
}

Json json_of(const mapping::BalProblem& problem, const mapping::BundleSummary& summary,
             const std::string& loss) {
  Json json = {{"schema_version", 1},
               {"cameras", problem.camera_count()},
               {"points", problem.point_count()},
               {"observations", problem.observations.size()},
               {"loss", loss},
               {"initial_cost", summary.initial_cost},
               {"final_cost", summary.final_cost},
               {"iterations", summary.iterations},
               {"converged", summary.converged},
               {"free_parameters", summary.free_parameters},
               {"inliers", summary.inliers},
               {"inlier_rms_px", summary.inlier_rms_px}};
  if (summary.noise_px > 0) json["noise_px"] = summary.noise_px;
  return json;
}

int adjust(BundleAdjustFlags options) {
  const auto losses = mapping::loss_names();
  options.adjust.loss =
      static_cast<mapping::Loss>(std::ranges::find(losses, options.loss) - losses.begin());
  if (options.loss_px && options.adjust.loss == mapping::Loss::kNone) {
    throw_bad_input("--loss-px is about a --loss, which is none; leave it out, or name one");
  }
  if (options.loss_px) options.adjust.loss_px = *options.loss_px;
  auto problem = mapping::read_bal(options.problem);
  const auto* const stop = stop_on_signal();
  const ProgressLine line;
  options.adjust.goes_on = [&](int iteration, double cost) {
    line.show(fmt::format("iteration {}, cost {:.6g} px^2", iteration, cost));
    return !*stop;
  };
  const auto summary = mapping::bundle_adjust(problem, options.adjust);
  line.clear();
  if (summary.stopped) {
    throw_environment(
        fmt::format("interrupted after {} iterations: nothing is written; fewer with "
                    "--iterations",
                    summary.iterations));
  }
  if (!summary.converged) {
    warn(fmt::format("{} iterations were not enough to converge; give more with --iterations",
                     summary.iterations));
  }
  if (options.output) emit_text(mapping::bal_text(problem), options.output);
  emit(options.output.to_stdout() ? "" : text_of(problem, summary),
       json_of(problem, summary, options.loss), options.json);
  return 0;
}

}  // namespace

void add_bundle_adjust(CLI::App& app, Action& action) {
  auto options = std::make_shared<BundleAdjustFlags>();
  Command command(app, "bundle-adjust",
                  "Move the cameras and points of a map to where they fit what was seen");
  add_input(command, "problem", &options->problem,
            "A problem in the format of Bundle Adjustment in the Large (BAL), or - for stdin")
      .required();
  add_choice(command, "--loss", &options->loss, "LOSS", mapping::loss_names(),
             "What an error beyond --loss-px counts; cauchy for data with outliers")
      .shows_default();
  add_value(command, "--loss-px", &options->loss_px, "PIXELS", not_within(1e-6, 1e6),
            fmt::format("Where the loss sets in: about the noise of the observations (default: {})",
                        options->adjust.loss_px));
  add_value(command, "--iterations", &options->adjust.most_iterations, "INTEGER",
            not_within(1, 100'000), "At most so many")
      .shows_default();
  add_value(command, "--threads", &options->adjust.threads, "INTEGER", not_within(1, 1024),
            "With one, the same input gives the same bits")
      .shows_default();
  command.add_flag("--fixed-intrinsics", options->adjust.fixed_intrinsics,
                   "Leave focal lengths and distortions as they are");
  add_output(command, "-o,--output", options->output, "Write the adjusted problem to a file");
  add_json(command, options->json);
  command.footer("Example: pirt generate bal | pirt bundle-adjust - -o out.txt");
  command.runs(action, [options] { return adjust(*options); });
}

}  // namespace pirt::cli
