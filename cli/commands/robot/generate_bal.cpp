// pirt generate bal: writes a bundle adjustment problem whose answer is known.
#include "workloads/mapping/generate_bal.h"

#include <memory>

#include "cli/commands.h"
#include "cli/options/files.h"
#include "cli/options/output.h"
#include "cli/options/values.h"

namespace pirt::cli {
namespace {

struct GenerateBalFlags {
  mapping::BalParameters parameters;
  Output output, truth;
};

int generate(const GenerateBalFlags& options) {
  const auto made = mapping::generate_bal(options.parameters);
  if (options.truth) emit_text(mapping::bal_text(made.truth), options.truth);
  emit_text(mapping::bal_text(made.problem), options.output);
  return 0;
}

}  // namespace

void add_generate_bal(CLI::App& app, Action& action) {
  auto options = std::make_shared<GenerateBalFlags>();
  auto& parameters = options->parameters;
  Command command(app, "generate bal",
                  "Write a bundle adjustment problem of a camera that goes round a scene");
  add_value(command, "--images", &parameters.images, "INTEGER",
            not_within(mapping::kLeastImages, mapping::kMostImages), "Number of images")
      .shows_default();
  add_value(command, "--points", &parameters.points, "INTEGER", not_within(1, mapping::kMostPoints),
            "Number of points, each seen in 4 to 15 images")
      .shows_default();
  add_value(command, "--noise-px", &parameters.noise_px, "PIXELS", not_within(0.0, 100.0),
            "Standard deviation of an observation's coordinates")
      .shows_default();
  add_value(command, "--outliers", &parameters.outliers, "FRACTION", not_within(0.0, 0.5),
            "The part of observations that are anywhere in the image, e.g. 0.02")
      .shows_default();
  add_seed(command, parameters.seed, "Same seed, same bytes");
  add_output(command, "-o,--output", options->output, "File to write (default: stdout)");
  add_output(command, "--truth", options->truth,
             "Write cameras and points as they are, with observations without noise");
  command.footer("Example: pirt generate bal --images 100 --points 5000 --seed 1 -o b.txt");
  command.runs(action, [options] { return generate(*options); });
}

}  // namespace pirt::cli
