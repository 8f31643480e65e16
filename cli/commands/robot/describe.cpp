// pirt describe: what pictures show, as JSON lines that can be searched.
#include <memory>

#include "cli/commands.h"
#include "cli/options/files.h"
#include "cli/options/models.h"
#include "cli/options/output.h"
#include "cli/options/values.h"
#include "workloads/base/text/json_value.h"
#include "workloads/inputs/pictures/images.h"
#include "workloads/recognition/describe_scene.h"

namespace pirt::cli {
namespace {

struct Options {
  std::vector<std::string> pictures;
  ModelFlags detector, classifier;
  recognition::DetectOptions detect;
  int labels = 5;
  Output output;
};

int describe(const Options& options) {
  recognition::Model detector(options.detector.options());
  std::optional<recognition::Model> classifier;
  if (options.classifier.model) classifier.emplace(options.classifier.options());
  std::string lines;
  for (const auto& file : picture_files(options.pictures)) {
    const auto scene = recognition::describe_scene(
        file, rgb_pixels(file), detector, classifier ? &*classifier : nullptr, options.detect,
        static_cast<std::size_t>(options.labels));
    lines += json_text(recognition::to_json(scene)) + "\n";
  }
  emit_text(lines, options.output);
  return 0;
}

}  // namespace

void add_describe(CLI::App& app, Action& action) {
  auto options = std::make_shared<Options>();
  Command command(app, "describe",
                  "Describe what pictures show, one line of JSON each: objects, where they are, "
                  "and what a classifier calls the whole");
  add_pictures(command, options->pictures);
  add_model(command, options->detector, "", "a detector");
  command.option("--model").required();
  add_model(command, options->classifier, "classifier", "a classifier (default: none)");
  add_detect_options(command, options->detect);
  add_value(command, "--labels", &options->labels, "INTEGER", not_within(1, 1000),
            "How many of the classifier's classes")
      .shows_default()
      .needs(command.option("--classifier"));
  add_output(command, "-o,--output", options->output, "File to write (default: stdout)");
  command.footer(
      "Example: pirt describe --model yolo.weights --config yolo.cfg --names coco.names "
      "--classifier net.caffemodel --classifier-config net.prototxt photos/ -o scenes.jsonl");
  command.runs(action, [options] { return describe(*options); });
}

}  // namespace pirt::cli
