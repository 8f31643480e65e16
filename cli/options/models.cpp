#include "cli/options/models.h"

#include <algorithm>
#include <filesystem>

#include "cli/options/files.h"
#include "cli/options/values.h"
#include "workloads/base/error.h"
#include "workloads/base/text/text.h"
#include "workloads/inputs/pictures/images.h"

namespace pirt::cli {
namespace {

constexpr int kLargestSide = 4096;

std::array<int, 2> parse_size(const std::string& text) {
  const auto sides = split(text, 'x');
  if (sides.size() != 2) {
    throw_bad_input("the size of a model's input must be WIDTHxHEIGHT, e.g. 640x640, got '" + text +
                    "'");
  }
  const auto side = [&](std::size_t i) {
    return whole_number(sides[i], 1, kLargestSide).or_refuse("a side of '" + text + "'");
  };
  return {side(0), side(1)};
}

/// The option of a model as it is called with a prefix.
std::string option_name(const std::string& prefix, const std::string& option) {
  return prefix.empty() ? "--" + option : "--" + prefix + "-" + option;
}

/// Of the weights.
std::string model_option(const std::string& prefix) {
  return prefix.empty() ? "--model" : "--" + prefix;
}

}  // namespace

std::vector<std::string> ModelFlags::arguments(const std::string& prefix) const {
  std::vector<std::string> arguments;
  const auto add = [&](const std::string& option, const std::optional<std::string>& value) {
    if (!value) return;
    arguments.push_back(option);
    arguments.push_back(*value);
  };
  add(model_option(prefix), model);
  add(option_name(prefix, "config"), config);
  add(option_name(prefix, "names"), names);
  add(option_name(prefix, "size"), size);
  add(option_name(prefix, "preprocess"), preprocess);
  add("--fit", fit);
  return arguments;
}

recognition::ModelOptions ModelFlags::options() const {
  recognition::ModelOptions options;
  options.model = *model;
  if (config) options.config = *config;
  options.config_option = config_option;
  if (names) options.names = *names;
  if (size) options.size = parse_size(*size);
  if (preprocess) {
    const auto known = recognition::preprocess_names();
    options.preprocess =
        static_cast<recognition::Preprocess>(std::ranges::find(known, *preprocess) - known.begin());
  }
  if (fit) {
    const auto known = recognition::detector_fit_names();
    options.fit = static_cast<recognition::Fit>(std::ranges::find(known, *fit) - known.begin());
  }
  return options;
}

void add_fit(Command& command, ModelFlags& flags) {
  add_choice(command, "--fit", &flags.fit, "HOW", recognition::detector_fit_names(),
             "How a picture comes to the detector's size (default: letterbox for ONNX and where "
             "Darknet's .cfg says letter_box=1, else stretch)");
}

void add_model(Command& command, ModelFlags& flags, const std::string& prefix,
               const std::string& what) {
  const auto name = [&](const std::string& option) { return option_name(prefix, option); };
  const Option model =
      add_input(command, model_option(prefix), &flags.model,
                "Weights of " + what + ": .weights of Darknet, .caffemodel, .onnx");
  flags.config_option = name("config");
  add_input(command, name("config"), &flags.config,
            "Its layers: the .cfg of Darknet, the .prototxt of Caffe")
      .needs(model);
  add_input(command, name("names"), &flags.names, "Names of its classes, one a line").needs(model);
  add_text(command, name("size"), &flags.size, "WIDTHxHEIGHT",
           "Of its input, in pixels (default: what --" + (prefix.empty() ? "" : prefix + "-") +
               "config says)")
      .needs(model);
  add_choice(command, name("preprocess"), &flags.preprocess, "HOW", recognition::preprocess_names(),
             "What it takes for pixels (default: caffe for Caffe, else unit, 0 to 1)")
      .needs(model);
}

void add_detect_options(Command& command, recognition::DetectOptions& options) {
  add_value(command, "--threshold", &options.least_score, "NUMBER", not_within(0.0, 1.0),
            "Least score of an object")
      .shows_default();
  add_value(command, "--overlap", &options.most_overlap, "NUMBER", not_within(0.0, 1.0),
            "Boxes of one class that share more than this part of their union are one object")
      .shows_default();
}

void add_pictures(Command& command, std::vector<std::string>& pictures) {
  add_input(command, "pictures", &pictures, "PNG and JPEG files, or folders of them",
            FileUse::kReadPictures)
      .required();
}

std::vector<std::string> picture_files(const std::vector<std::string>& given) {
  std::vector<std::string> files;
  for (const auto& name : given) {
    if (!std::filesystem::is_directory(name)) {
      files.push_back(name);
      continue;
    }
    for (const auto& file : pictures_of(name)) files.push_back(file.string());
  }
  return files;
}

}  // namespace pirt::cli
