// pirt describe: what pictures show, as JSON lines that can be searched, or as a table.
#include <fmt/core.h>

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "cli/commands.h"
#include "cli/options/files.h"
#include "cli/options/models.h"
#include "cli/options/output.h"
#include "cli/options/values.h"
#include "reports/document/document.h"
#include "workloads/base/error.h"
#include "workloads/base/text/json.h"
#include "workloads/inputs/pictures/images.h"
#include "workloads/recognition/describe_scene.h"

namespace pirt::cli {
namespace {

struct DescribeFlags {
  std::vector<std::string> pictures;
  ModelFlags detector, classifier;
  recognition::DetectOptions detect;
  int labels = 5;
  bool table = false;
  Output output;
};

void append_rows(const recognition::Scene& scene, Table& table) {
  for (const auto& object : scene.objects) {
    const auto& box = object.box;
    table.rows.push_back({scene.image, object.name, fmt::format("{:.2f}", object.score),
                          fmt::format("{:.0f},{:.0f}", box.x, box.y),
                          fmt::format("{:.0f}x{:.0f}", box.width, box.height),
                          recognition::place_of(box, scene.width, scene.height)});
  }
  if (scene.objects.empty()) table.rows.push_back({scene.image, "-", "-", "-", "-", "-"});
}

/// On all cores: nothing else computes here.
recognition::Model open(const ModelFlags& flags) {
  auto options = flags.options();
  options.threads = 0;
  return recognition::Model(options);
}

int describe(const DescribeFlags& options) {
  recognition::Model detector = open(options.detector);
  std::optional<recognition::Model> classifier;
  if (options.classifier.model) classifier.emplace(open(options.classifier));
  std::string lines;
  Table table;
  table.columns = {{"picture", Align::kLeft}, {"object", Align::kLeft}, {"score"}, {"at"}, {"size"},
                   {"place", Align::kLeft}};
  const auto files = picture_files(options.pictures);
  std::vector<std::string> bad;
  for (const auto& file : files) {
    std::optional<Tensor> pixels;
    try {
      pixels.emplace(rgb_pixels(file));
    } catch (const Error& error) {
      if (error.code() != ErrorCode::kBadInput) throw;
      bad.emplace_back(error.what());
      continue;
    }
    const auto scene =
        recognition::describe_scene(file, *pixels, detector, classifier ? &*classifier : nullptr,
                                    options.detect, static_cast<std::size_t>(options.labels));
    lines += json_text(recognition::to_json(scene)) + "\n";
    append_rows(scene, table);
  }
  if (!bad.empty() && bad.size() == files.size()) throw_bad_input(bad.front());
  if (options.table) lines = render({"", {std::move(table)}}, Format::kText);
  emit_text(lines, options.output);
  warn_all(bad);
  const double most = kMostBadPart * static_cast<double>(files.size());
  if (static_cast<double>(bad.size()) <= most) return 0;
  warn(fmt::format("{} of {} pictures are left out, more than {:.0f} %", bad.size(), files.size(),
                   100 * kMostBadPart));
  return kExitEnvironment;
}

}  // namespace

void add_describe(CLI::App& app, Action& action) {
  auto options = std::make_shared<DescribeFlags>();
  Command command(app, "describe",
                  "Describe what pictures show, one line of JSON each: objects, where they are, "
                  "and what a classifier calls the whole");
  add_pictures(command, options->pictures);
  add_model(command, options->detector, "", "a detector");
  add_fit(command, options->detector);
  command.option("--model").required();
  add_model(command, options->classifier, "classifier", "a classifier (default: none)");
  add_detect_options(command, options->detect);
  add_value(command, "--labels", &options->labels, "INTEGER", not_within(1, 1000),
            "How many of the classifier's classes")
      .shows_default()
      .needs(command.option("--classifier"));
  add_output(command, "-o,--output", options->output, "File to write (default: stdout)");
  command
      .add_flag("--table", options->table,
                "A table of the objects instead, for eyes rather than programs")
      .excludes(command.option("--classifier"));
  command.footer(
      "Understood are YOLO (Darknet; ONNX, end to end too) and SSD. Scores are the model's own.\n"
      "Example: pirt describe --model yolo.weights --config yolo.cfg --names coco.names "
      "--classifier net.caffemodel --classifier-config net.prototxt photos/ -o scenes.jsonl");
  command.runs(action, [options] { return describe(*options); });
}

}  // namespace pirt::cli
