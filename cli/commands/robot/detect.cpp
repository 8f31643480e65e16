// pirt detect: the objects that a user's model sees in pictures.
#include <fmt/core.h>

#include <memory>

#include "cli/commands.h"
#include "cli/options/files.h"
#include "cli/options/models.h"
#include "cli/options/output.h"
#include "reports/document/document.h"
#include "workloads/base/text/json_value.h"
#include "workloads/inputs/pictures/images.h"
#include "workloads/recognition/describe_scene.h"

namespace pirt::cli {
namespace {

struct Options {
  std::vector<std::string> pictures;
  ModelFlags model;
  recognition::DetectOptions detect;
  Output json;
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

int detect(const Options& options) {
  recognition::Model detector(options.model.options());
  Table table;
  table.columns = {{"picture", Align::kLeft}, {"object", Align::kLeft}, {"score"}, {"at"}, {"size"},
                   {"place", Align::kLeft}};
  Json json = {{"schema_version", 1}, {"model", detector.file()}};
  auto& images = json["images"] = Json::array();
  for (const auto& file : picture_files(options.pictures)) {
    const auto scene =
        recognition::describe_scene(file, rgb_pixels(file), detector, nullptr, options.detect, 0);
    append_rows(scene, table);
    images.push_back(recognition::to_json(scene));
  }
  emit(render({"", {std::move(table)}}, Format::kText), json, options.json);
  return 0;
}

}  // namespace

void add_detect(CLI::App& app, Action& action) {
  auto options = std::make_shared<Options>();
  Command command(app, "detect", "Find the objects in pictures with a trained model of yours");
  add_pictures(command, options->pictures);
  add_model(command, options->model, "", "a detector");
  command.option("--model").required();
  add_detect_options(command, options->detect);
  add_json(command, options->json);
  command.footer(
      "Understood are YOLO (Darknet, ONNX) and SSD. Scores are the model's own.\n"
      "Example: pirt detect --model yolo.weights --config yolo.cfg --names coco.names dog.jpg");
  command.runs(action, [options] { return detect(*options); });
}

}  // namespace pirt::cli
