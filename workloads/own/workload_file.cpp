// Workload files: YAML for what is no C++ (README.md of this folder has all keys).
#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <initializer_list>
#include <iterator>
#include <memory>
#include <optional>
#include <set>
#include <string_view>
#include <utility>

#include "workloads/base/error.h"
#include "workloads/base/system/program_path.h"
#include "workloads/base/text/text.h"
#include "workloads/base/text/yaml.h"
#include "workloads/model/function_kernel.h"
#include "workloads/model/own_operation.h"
#include "workloads/own/own.h"
#include "workloads/own/program.h"
#include "workloads/recognition/model.h"
#include "workloads/recognition/opencv_threads.h"

namespace pirt::own {
namespace {

namespace fs = std::filesystem;

constexpr Nanos kStartLimit = std::chrono::seconds(60), kCallLimit = std::chrono::seconds(10);
constexpr double kLongestLimitMs = 3'600'000;

/// What @p read says is wrong, said of the node.
template <typename Read>
auto at_place(const YamlNode& node, const Read& read) {
  try {
    return read();
  } catch (const Error& error) {
    node.fail(error.what());
  }
}

/// Those of a list; none where there is no such key.
std::vector<std::string> words_at(const YamlNode& node, std::string_view key) {
  std::vector<std::string> words;
  if (!node.has(key)) return words;
  for (const YamlNode& word : node.at(key).items()) words.push_back(word.text());
  return words;
}

/// Relative to the file's folder.
fs::path place(const fs::path& file, const std::string& named) {
  fs::path path = (file.parent_path() / named).lexically_normal();
  check_is_file(path);
  return path;
}

/// "{image: u8[480,640], ...}"
std::vector<TensorSpec> read_tensors(const YamlNode& node) {
  std::vector<TensorSpec> specs;
  for (const std::string& name : node.keys()) {
    const YamlNode each = node.at(name);
    const YamlNode tensor = each.is_map() ? each.at("tensor") : each;
    if (each.is_map()) each.check_keys({"tensor", "range"});
    specs.push_back(at_place(tensor, [&] { return tensor_from(name, tensor.text()); }));
    if (!each.is_map() || !each.has("range")) continue;
    const auto ends = each.at("range").items();
    if (ends.size() != 2) each.at("range").fail("needs two numbers, the least and the largest");
    specs.back().ranges = {{ends[0].number(-1e300, 1e300), ends[1].number(-1e300, 1e300)}};
  }
  return specs;
}

std::vector<TensorSpec> tensors_at(const YamlNode& node, std::string_view key) {
  return node.has(key) ? read_tensors(node.at(key)) : std::vector<TensorSpec>();
}

Nanos read_limit(const YamlNode& node) { return from_s(node.number(1, kLongestLimitMs / 1e3)); }

/// Of a kernel: numbers, or width or height of the workload.
std::array<std::int64_t, 3> read_extents(const YamlNode& node) {
  const auto items = node.items();
  if (items.empty() || items.size() > 3) node.fail("needs one to three sizes, x first");
  std::array<std::int64_t, 3> extents{};
  for (std::size_t i = 0; i < items.size(); ++i) {
    const auto extent = extent_from(items[i].text());
    if (!extent) items[i].fail("is no size: a number from 1 on, width or height");
    extents[i] = *extent;
  }
  return extents;
}

OpenclArgument read_argument(const YamlNode& node) {
  if (node.is_map()) {
    const auto keys = node.keys();
    const auto element = element_from(keys.empty() ? "" : keys.front());
    if (keys.size() != 1 || !element) {
      node.fail("is no number of an argument: {u8: 128}, {i32: -1}, {f32: 0.5}");
    }
    return {
        .tensor = {}, .element = *element, .value = node.at(keys.front()).number(-1e300, 1e300)};
  }
  return {.tensor = node.text(), .element = Element::kI32, .value = 0};
}

/// What follows @p words, with blanks before each; absent where the line begins otherwise.
std::optional<std::string_view> after_words(std::string_view line,
                                            std::initializer_list<std::string_view> words) {
  for (const std::string_view word : words) {
    line.remove_prefix(std::min(line.find_first_not_of(" \t"), line.size()));
    if (!line.starts_with(word)) return std::nullopt;
    line.remove_prefix(word.size());
  }
  return line;
}

/// The source with the files beside it that it includes in the place of their lines: drivers differ
/// in how they are told of a folder. Errors are still of the file and line where they are.
/// @param files  Gets those that were read.
std::string with_includes(const fs::path& file, std::vector<fs::path>& files) {
  constexpr std::size_t kMostFiles = 100;
  if (files.size() >= kMostFiles) throw_bad_input(file.string() + ": it includes itself");
  files.push_back(file);
  const auto from_line = [&file](std::size_t number) {
    return fmt::format("#line {} \"{}\"\n", number, file.filename().string());
  };
  const auto lines = split(read_text(file), '\n');
  std::string text = from_line(1);
  bool once = false;
  for (std::size_t i = 0; i < lines.size(); ++i) {
    once = once || after_words(lines[i], {"#", "pragma", "once"});
    const std::string_view named = after_words(lines[i], {"#", "include", "\""}).value_or("");
    const auto end = named.find('"');
    if (end == std::string_view::npos) {
      text += lines[i] + '\n';
      continue;
    }
    text += with_includes(place(file, std::string(named.substr(0, end))), files);
    text += from_line(i + 2);
  }
  if (!once) return text;
  // Which of its places comes first depends on the conditions around them.
  const auto number = std::ranges::find(files, file) - files.begin();
  return fmt::format("#ifndef PIRT_ONCE_{0}\n#define PIRT_ONCE_{0}\n{1}#endif\n", number, text);
}

void read_opencl(const fs::path& file, const YamlNode& node, Definition& definition) {
  node.check_keys({"source", "kernel", "global", "local", "args", "options"});
  const YamlNode named = node.at("source");
  const fs::path path = at_place(named, [&] { return place(file, named.text()); });
  const auto text = at_place(named, [&] {
    std::vector<fs::path> files;
    return with_includes(path, files);
  });
  OpenclSource source{.file = path.string(), .text = text, .kernel = {}, .options = {}};
  source.kernel = node.at("kernel").text();
  source.global = read_extents(node.at("global"));
  if (node.has("local")) source.local = read_extents(node.at("local"));
  if (node.has("options")) source.options = " " + node.at("options").text();
  for (const YamlNode& argument : node.at("args").items()) {
    source.arguments.push_back(read_argument(argument));
  }
  check(source, definition, node.location());
  definition.backends.emplace_back("opencl");
  definition.functions = [source](Size size) { return Functions{.opencl = at(source, size)}; };
}

void read_program(const fs::path& file, const YamlNode& node, Definition& definition) {
  if (!definition.state.empty()) node.fail("a program keeps its state itself: leave `state` out");
  Program program{.workload = definition.name,
                  .command = words_at(node, "command"),
                  .folder = file.parent_path(),
                  .start_limit = kStartLimit,
                  .call_limit = kCallLimit};
  if (program.command.empty() || program.command.front().empty()) {
    node.at("command").fail("needs the words of a command: [python3, icp.py]");
  }
  const auto limit = [&node](const char* key, Nanos standard) {
    return node.has(key) ? from_ms(node.at(key).number(1, kLongestLimitMs)) : standard;
  };
  program.start_limit = limit("start_limit_ms", kStartLimit);
  program.call_limit = limit("call_limit_ms", kCallLimit);
  // Whoever is late is killed by these, and says more of it.
  definition.limit += program.start_limit + program.call_limit;
  program.inputs = definition.inputs;
  program.parameters = definition.parameters;
  program.outputs = definition.outputs;
  definition.backends.emplace_back("cpu");
  definition.functions = [program](Size size) {
    Program sized = program;
    sized.inputs = at(program.inputs, size);
    sized.parameters = at(program.parameters, size);
    sized.outputs = at(program.outputs, size);
    return Functions{
        .cpu = [sized](std::span<const Tensor> parameters,
                       int threads) { return make_program_kernel(sized, parameters, threads); },
        .ends_by_itself = sized.start_limit + sized.call_limit};
  };
}

/// A network on @p threads of the host's cores.
/// @param places  Of each output among the network's.
std::unique_ptr<Kernel> network_kernel(const std::string& name, const fs::path& model,
                                       const std::optional<fs::path>& config,
                                       const std::vector<std::size_t>& places, int threads) {
  const std::shared_ptr network = recognition::open_network(model, config);
  return std::make_unique<FunctionKernel>(
      [=](std::span<const Tensor> inputs, std::span<Tensor> outputs) {
        const Tensor& input = inputs.front();
        const std::vector<int> shape(input.spec().shape.begin(), input.spec().shape.end());
        std::string error;
        const recognition::OpencvThreads in_use(threads);
        const auto results = network->run(input.as<float>(), shape, error);
        if (!error.empty()) throw CallFailed(name + ": " + error);
        for (std::size_t i = 0; i < outputs.size(); ++i) {
          const std::size_t at = places[i];
          if (at >= results.size() || results[at].shape != outputs[i].spec().shape) {
            throw CallFailed(
                fmt::format("{}: output {} is not {}", name, at, outputs[i].spec().describe()));
          }
          std::ranges::copy(results[at].values, outputs[i].as<float>().begin());
        }
      });
}

/// What the network makes of its input, by its names where they can be a tensor's.
std::vector<TensorSpec> outputs_of(recognition::Network& network, const TensorSpec& input) {
  const std::vector<float> zeros(static_cast<std::size_t>(input.count()));
  const std::vector<int> shape(input.shape.begin(), input.shape.end());
  std::string error;
  const auto results = network.run(zeros, shape, error);
  if (!error.empty()) {
    throw_bad_input("it does not run on " + input.describe() + ": " + error +
                    "; is that its input?");
  }
  std::vector<TensorSpec> specs;
  for (const auto& result : results) {
    const bool is_name = is_tensor_name(result.name) && result.name != input.name;
    specs.push_back({.name = is_name ? result.name : fmt::format("output{}", specs.size()),
                     .element = Element::kF32,
                     .shape = result.shape});
  }
  return specs;
}

/// Of each declared output its place among those that the network makes: by name, or one after the
/// other where they are called otherwise and none can be taken for another; empty if they are not
/// the network's.
std::vector<std::size_t> places_of(const std::vector<TensorSpec>& declared,
                                   const std::vector<TensorSpec>& made) {
  std::set<std::vector<std::int64_t>> shapes;
  for (const TensorSpec& spec : made) shapes.insert(spec.shape);
  const bool by_name = std::ranges::all_of(declared, [&made](const TensorSpec& spec) {
    return std::ranges::find(made, spec.name, &TensorSpec::name) != made.end();
  });
  if (declared.size() != made.size() || (!by_name && shapes.size() < made.size())) return {};
  std::vector<std::size_t> places;
  for (std::size_t i = 0; i < declared.size(); ++i) {
    const TensorSpec& spec = declared[i];
    const auto named = std::ranges::find(made, spec.name, &TensorSpec::name) - made.begin();
    const std::size_t at = by_name ? static_cast<std::size_t>(named) : i;
    if (spec.element != made[at].element || spec.shape != made[at].shape || spec.varies) return {};
    places.push_back(at);
  }
  return places;
}

void read_network(const fs::path& file, const YamlNode& node, Definition& definition) {
  const YamlNode network = node.at("network");
  const auto beside = [&file](const YamlNode& named) {
    return at_place(named, [&] { return place(file, named.text()); });
  };
  const fs::path model = beside(network);
  std::optional<fs::path> config;
  if (node.has("config")) config = beside(node.at("config"));
  const bool one_input =
      definition.inputs.size() == 1 && definition.parameters.empty() && definition.state.empty() &&
      definition.inputs.front().element == Element::kF32 && !definition.inputs.front().varies &&
      std::ranges::all_of(definition.inputs.front().shape,
                          [](std::int64_t extent) { return extent > 0; });
  if (!one_input) {
    network.fail("needs one input of fixed size, such as inputs: {picture: \"f32[1,3,416,416]\"}");
  }
  Definition input = definition;  // Before a network is asked for as much memory.
  input.outputs = {tensor_from("output", "f32[1]")};
  input.backends = {"cpu"};
  check(input, network.location());
  const auto outputs = at_place(network, [&] {
    return outputs_of(*recognition::open_network(model, config), definition.inputs.front());
  });
  if (definition.outputs.empty()) definition.outputs = outputs;
  const auto places = places_of(definition.outputs, outputs);
  if (places.empty()) {
    std::vector<std::string> made;
    for (const TensorSpec& spec : outputs) made.push_back(spec.name + ": " + tensor_text(spec));
    node.at("outputs").fail("are not the network's, by its names: " + join(made, ", "));
  }
  definition.backends.emplace_back("cpu");
  definition.functions = [name = definition.name, model, config, places](Size) {
    return Functions{.cpu = [=](std::span<const Tensor>, int threads) {
      return network_kernel(name, model, config, places, threads);
    }};
  };
}

Definition read_workload(const fs::path& file, const YamlNode& node) {
  node.check_keys({"name", "description", "inputs", "outputs", "parameters", "state", "size",
                   "frames", "ops_per_element", "tolerance", "opencl", "network", "config",
                   "command", "writes", "start_limit_ms", "call_limit_ms", "limit_s"});
  Definition definition;
  definition.name = node.at("name").text();
  if (node.has("description")) definition.description = node.at("description").paragraph();
  definition.inputs = tensors_at(node, "inputs");
  definition.outputs = tensors_at(node, "outputs");
  definition.parameters = tensors_at(node, "parameters");
  definition.state = tensors_at(node, "state");
  if (node.has("size")) {
    definition.size = size_from(node.at("size").text());
    if (!definition.size) node.at("size").fail("is no size: 1280x720");
  }
  if (node.has("frames")) {
    definition.frames = static_cast<int>(node.at("frames").integer(1, 10'000));
  }
  if (node.has("ops_per_element")) {
    definition.ops_per_element = node.at("ops_per_element").number(0, 1e15);
  }
  if (node.has("tolerance")) definition.tolerance = node.at("tolerance").number(0, 1);
  const auto belongs = [&node](const char* key, const char* kind) {
    if (node.has(key) && !node.has(kind)) {
      node.at(key).fail(fmt::format("is of workloads with `{}`, and this one has none", kind));
    }
  };
  belongs("config", "network");
  belongs("writes", "command");
  belongs("start_limit_ms", "command");
  belongs("call_limit_ms", "command");
  if (node.has("limit_s")) definition.limit = read_limit(node.at("limit_s"));
  const int kinds = int{node.has("opencl")} + int{node.has("network")} + int{node.has("command")};
  if (kinds != 1) node.fail("needs one of: opencl, network, command");
  if (node.has("opencl")) read_opencl(file, node.at("opencl"), definition);
  if (node.has("network")) read_network(file, node, definition);
  if (node.has("command")) read_program(file, node, definition);
  check(definition, node.location());
  return definition;
}

YamlNode root_of(const fs::path& file, const std::string& text) {
  YamlNode root = parse_yaml(file.string(), text);
  root.check_keys({"workloads"});
  return root.at("workloads");
}

}  // namespace

std::vector<Definition> read_workload_file(const fs::path& file, const std::string& text) {
  std::vector<Definition> all;
  for (const YamlNode& node : root_of(file, text).items()) {
    if (!node.has("module")) {
      all.push_back(read_workload(file, node));
      continue;
    }
    node.check_keys({"module", "limit_s"});
    auto modules = at_place(node.at("module"),
                            [&] { return load_module(place(file, node.at("module").text())); });
    if (node.has("limit_s")) {
      for (Definition& each : modules) each.limit = read_limit(node.at("limit_s"));
    }
    std::ranges::move(modules, std::back_inserter(all));
  }
  return all;
}

std::vector<NamedFile> named_files(const fs::path& file, const std::string& text) {
  std::vector<NamedFile> files;
  for (const YamlNode& node : root_of(file, text).items()) {
    if (node.has("opencl") && node.at("opencl").has("source")) {
      std::vector<fs::path> its;
      static_cast<void>(with_includes(place(file, node.at("opencl").at("source").text()), its));
      for (fs::path& each : its) files.push_back({std::move(each)});
    }
    for (const char* key : {"module", "network", "config"}) {
      if (node.has(key)) files.push_back({place(file, node.at(key).text())});
    }
    std::set<fs::path> written;
    for (const std::string& name : words_at(node, "writes")) {
      written.insert(fs::absolute(file.parent_path() / name).lexically_normal());
    }
    for (CommandFile& each : files_named_by(words_at(node, "command"), file.parent_path())) {
      // What PATH finds is the machine's, as its libraries are: another file on each.
      const bool is_by_path = each.is_program && each.name.find('/') == std::string::npos;
      if (is_by_path || written.contains(fs::absolute(each.file).lexically_normal())) continue;
      files.push_back({.file = std::move(each.file), .is_of_command = true});
    }
  }
  return files;
}

}  // namespace pirt::own
