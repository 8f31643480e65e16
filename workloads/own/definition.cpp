#include "workloads/own/definition.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>
#include <utility>

#include "workloads/base/error.h"
#include "workloads/base/math/random.h"
#include "workloads/base/text/numbers.h"
#include "workloads/base/text/printable.h"
#include "workloads/base/text/text.h"

namespace pirt::own {
namespace {

constexpr int kMostExtent = 65'536;
constexpr std::int64_t kMostRow = std::int64_t{1} << 31;
/// Of a tensor: more is a slip of the pen.
constexpr std::int64_t kMostBytes = std::int64_t{1} << 32;
/// Of all inputs that it is measured with.
constexpr std::int64_t kMostSequence = std::int64_t{1} << 36;
constexpr std::size_t kMostTensors = 64, kMostDims = 6;
constexpr double kFloatTolerance = 1e-4;
constexpr int kFormat = 1;

struct Symbol {
  std::string_view name;
  std::int64_t value;
};
constexpr std::array kSymbols = {Symbol{"width", kWidth}, Symbol{"height", kHeight}};
constexpr std::array kElements = {Element::kU8, Element::kI16, Element::kI32, Element::kF32,
                                  Element::kF64};

/// Of each kind.
std::array<const std::vector<TensorSpec>*, 4> all_specs(const Definition& definition) {
  return {&definition.inputs, &definition.parameters, &definition.outputs, &definition.state};
}

bool is_sized(const TensorSpec& spec) {
  return std::ranges::any_of(spec.shape, [](std::int64_t extent) { return extent < 0; });
}

bool is_sized(const Definition& definition) {
  return std::ranges::any_of(all_specs(definition), [](const std::vector<TensorSpec>* specs) {
    return std::ranges::any_of(*specs, [](const TensorSpec& spec) { return is_sized(spec); });
  });
}

std::int64_t at(std::int64_t extent, Size size) {
  return extent == kWidth ? size.width : extent == kHeight ? size.height : extent;
}

/// Of its values.
Range range_of(Element element) {
  switch (element) {
    case Element::kU8:
      return {0, 255};
    case Element::kI16:
      return {-32'768, 32'767};
    case Element::kI32:
      return {std::numeric_limits<std::int32_t>::min(), std::numeric_limits<std::int32_t>::max()};
    case Element::kF32:
      return {-std::numeric_limits<float>::max(), std::numeric_limits<float>::max()};
    case Element::kF64:
      break;
  }
  return {-std::numeric_limits<double>::max(), std::numeric_limits<double>::max()};
}

bool is_integer(Element element) { return element != Element::kF32 && element != Element::kF64; }

/// The least and the largest value of @p element within the range; the other way round if there is
/// none.
Range values_within(const Range& range, Element element) {
  if (is_integer(element)) return {std::ceil(range.low), std::floor(range.high)};
  if (element == Element::kF64) return range;
  constexpr float kEnd = std::numeric_limits<float>::infinity();
  const auto low = static_cast<float>(range.low), high = static_cast<float>(range.high);
  return {low < range.low ? std::nextafter(low, kEnd) : low,
          high > range.high ? std::nextafter(high, -kEnd) : high};
}

/// Calls @p use with the elements as they are.
template <typename Of, typename Use>
void with_elements(Of& tensor, const Use& use) {
  switch (tensor.spec().element) {
    case Element::kU8:
      return use(tensor.template as<std::uint8_t>());
    case Element::kI16:
      return use(tensor.template as<std::int16_t>());
    case Element::kI32:
      return use(tensor.template as<std::int32_t>());
    case Element::kF32:
      return use(tensor.template as<float>());
    case Element::kF64:
      return use(tensor.template as<double>());
  }
}

/// In f64.
Tensor wide(const Tensor& tensor) {
  TensorSpec spec = tensor.spec();
  spec.element = Element::kF64;
  Tensor made(std::move(spec));
  if (made.spec().varies) made.set_rows(tensor.rows());
  with_elements(tensor, [&](auto elements) {
    std::ranges::copy(elements.first(static_cast<std::size_t>(tensor.used_count())),
                      made.as<double>().begin());
  });
  return made;
}

/// Numbers within the range of the tensor, a pure function of the seed.
void fill_numbers(Tensor& tensor, std::uint64_t seed) {
  const TensorSpec& spec = tensor.spec();
  Range range{0, 1};
  if (spec.element == Element::kU8) range = {0, 255};
  if (spec.element == Element::kI16 || spec.element == Element::kI32) range = {-100, 100};
  if (!spec.ranges.empty()) range = values_within(spec.ranges.front(), spec.element);
  Random random(seed);
  with_elements(tensor, [&](auto elements) {
    for (auto& each : elements) {
      const double value = random.uniform(range.low, range.high);
      each = static_cast<std::remove_reference_t<decltype(each)>>(
          is_integer(spec.element) ? std::nearbyint(value) : value);
    }
  });
}

/// A picture where it can be one, else numbers.
/// @param pictures  That the call has so far: each is the frame after the one before.
void fill(Tensor& tensor, const DataRequest& request, int& pictures,
          std::vector<std::string>& notes) {
  const TensorSpec& spec = tensor.spec();
  const auto extent = [&spec](std::size_t axis) { return static_cast<int>(spec.shape[axis]); };
  const bool is_image = spec.element == Element::kU8 && !spec.varies && spec.ranges.empty();
  const int picture = picture_index(request.seed), frame = request.frame + pictures;
  std::optional<Picture> taken;
  if (is_image && spec.shape.size() == 2) {
    taken = request.images->gray_frame(picture, frame, extent(1), extent(0));
  } else if (is_image && spec.shape.size() == 3 && spec.shape[0] == 3) {
    taken = request.images->rgb(picture + frame, extent(2), extent(1));
  }
  if (!taken) {
    fill_numbers(tensor, hash_u64(derive_seed(request.seed, spec.name),
                                  static_cast<std::uint64_t>(request.frame)));
    return;
  }
  ++pictures;
  std::ranges::copy(taken->pixels.as<std::uint8_t>(), tensor.as<std::uint8_t>().begin());
  for (std::string& note : taken->notes) {
    if (std::ranges::find(notes, note) == notes.end()) notes.push_back(std::move(note));
  }
}

Data make_data(const DataRequest& request, const std::vector<TensorSpec>& inputs,
               const std::vector<TensorSpec>& parameters, const Functions& functions) {
  Data data{.inputs = make_tensors(inputs), .parameters = make_tensors(parameters), .notes = {}};
  if (functions.make_inputs) {
    functions.make_inputs(request, data.inputs, data.parameters);
    return data;
  }
  int pictures = 0;
  for (Tensor& input : data.inputs) fill(input, request, pictures, data.notes);
  for (Tensor& parameter : data.parameters) {
    fill_numbers(parameter, derive_seed(request.seed, parameter.spec().name));
  }
  return data;
}

/// What a player fills an output with before a call: f32 and f64 of it are no numbers.
bool is_unwritten(const Tensor& tensor, std::size_t element) {
  const TensorSpec& spec = tensor.spec();
  const auto size = static_cast<std::size_t>(spec.size_bytes() / spec.count());
  return std::ranges::all_of(tensor.bytes().subspan(element * size, size),
                             [](std::byte each) { return each == std::byte{0xFF}; });
}

/// A hole of a depth picture is a hole in both: what is no finite number, and the same, is equal.
void leave_out_holes(const Tensor& output, Tensor& wide_output, Tensor& wide_expected) {
  const auto a = wide_output.used<double>(), b = wide_expected.used<double>();
  for (std::size_t i = 0; i < std::min(a.size(), b.size()); ++i) {
    const bool same = std::isnan(a[i]) ? std::isnan(b[i]) && !is_unwritten(output, i)
                                       : std::isinf(a[i]) && a[i] == b[i];
    if (same) a[i] = b[i] = 0;
  }
}

Verdict verify(std::span<const Tensor> outputs, std::span<const Tensor> expected,
               double tolerance) {
  std::vector<Tensor> got = copy_tensors(outputs), want = copy_tensors(expected);
  for (std::size_t i = 0; i < std::min(got.size(), want.size()); ++i) {
    if (is_integer(got[i].spec().element) && tolerance == 0) continue;
    got[i] = wide(got[i]);
    want[i] = wide(want[i]);
    leave_out_holes(outputs[i], got[i], want[i]);
  }
  return verify_mixed(tolerance == 0 ? kFloatTolerance : tolerance)(got, want);
}

/// Letters, digits and @p others, 1 to 100.
bool is_name_of(std::string_view name, std::string_view others) {
  return !name.empty() && name.size() <= 100 && is_made_of(name, others);
}

/// What is wrong with the name; empty = nothing.
std::string name_problem(const std::string& name) {
  if (!is_name_of(name, "_-.")) return "may have letters, digits, '_', '-' and '.', 100 at most";
  const auto dot = name.find('.');
  const bool inside = dot != std::string::npos && dot > 0 && name.back() != '.';
  return inside ? "" : "needs a dot, as in mine.sobel: names without one are pirt's";
}

void check_tensor(const TensorSpec& spec, Size largest, const std::string& where) {
  const auto fail = [&](const std::string& why) {
    throw_bad_input(fmt::format("{}: tensor '{}' {}", where, printable(spec.name), why));
  };
  if (!is_tensor_name(spec.name)) {
    fail("needs a name of letters, digits, '_', '-', '.', '/' and ':', 1 to 100");
  }
  if (spec.shape.empty() || spec.shape.size() > kMostDims) {
    fail(fmt::format("has {} dimensions; 1 to {} are possible", spec.shape.size(), kMostDims));
  }
  double bytes = static_cast<double>(size_bytes(spec.element));
  for (const std::int64_t given : spec.shape) {
    const std::int64_t extent = at(given, largest);
    if (extent < 1 || extent > kMostRow) fail(fmt::format("has an extent of {}", extent));
    bytes *= static_cast<double>(extent);
  }
  if (bytes > static_cast<double>(kMostBytes)) {
    fail(fmt::format("has {:.3g} bytes; {} are the most", bytes, kMostBytes));
  }
  const Range most = range_of(spec.element);
  for (const Range& range : spec.ranges) {
    const bool is_one = range.low <= range.high && range.low >= most.low && range.high <= most.high;
    const Range values = is_one ? values_within(range, spec.element) : range;
    if (!is_one || (is_integer(spec.element) && values.low > values.high)) {
      fail(fmt::format("has a range that is none of {}: {} to {}", pirt::to_string(spec.element),
                       range.low, range.high));
    }
  }
}

/// Of all tensors of one kind.
double bytes_of(std::vector<TensorSpec> specs, Size size) {
  double bytes = 0;
  for (const TensorSpec& spec : at(std::move(specs), size)) {
    bytes += static_cast<double>(spec.size_bytes());
  }
  return bytes;
}

Json tensors_json(const std::vector<TensorSpec>& specs) {
  Json all = Json::array();
  for (const TensorSpec& spec : specs) {
    Json each = {{"name", spec.name}, {"tensor", tensor_text(spec)}};
    if (!spec.ranges.empty()) {
      each["range"] = Json::array({spec.ranges.front().low, spec.ranges.front().high});
    }
    all.push_back(std::move(each));
  }
  return all;
}

std::vector<TensorSpec> tensors_from(const Json& json) {
  std::vector<TensorSpec> specs;
  for (const Json& each : json) {
    specs.push_back(
        tensor_from(each.at("name").get<std::string>(), each.at("tensor").get<std::string>()));
    if (each.contains("range")) {
      specs.back().ranges = {{each.at("range").at(0), each.at("range").at(1)}};
    }
  }
  return specs;
}

Workload make(const std::shared_ptr<const Definition>& shared, Size size) {
  const Definition& definition = *shared;
  auto operation = std::make_shared<OwnOperation>();
  operation->source = definition.source;
  operation->digest = definition.digest;
  operation->definition = json_text(to_json(definition));
  operation->backends = definition.backends;
  operation->limit = definition.limit;
  if (definition.slices > 1) {
    operation->slices.assign(static_cast<std::size_t>(definition.slices), 1.0 / definition.slices);
  }
  Workload w;
  w.name = definition.name;
  w.description = definition.description;
  w.tags = {"own"};
  w.kernel = kOwnKernel;
  w.inputs = at(definition.inputs, size);
  w.parameters = at(definition.parameters, size);
  w.outputs = at(definition.outputs, size);
  if (!definition.state.empty()) {
    w.state = StateSpec{.name = definition.name, .tensors = at(definition.state, size)};
  }
  w.frames = definition.frames;
  const std::int64_t made = w.outputs.empty() ? 0 : w.outputs.front().count();
  const double ops = definition.ops_per_element * static_cast<double>(made);
  if (ops > 0 && ops < 9e18) w.ops = static_cast<std::int64_t>(std::llround(ops));
  w.verify = [tolerance = definition.tolerance](std::span<const Tensor> outputs,
                                                std::span<const Tensor> expected) {
    return verify(outputs, expected, tolerance);
  };
  if (definition.functions) {
    const Functions functions = definition.functions(size);
    operation->cpu = functions.cpu;
    operation->opencl = functions.opencl;
    operation->opencl_function = functions.opencl_function;
    operation->ends_by_itself = functions.ends_by_itself;
    w.make_data = [inputs = w.inputs, parameters = w.parameters,
                   functions](const DataRequest& request) {
      return make_data(request, inputs, parameters, functions);
    };
    if (w.state) {
      w.make_state = [specs = w.state->tensors, functions] {
        auto tensors = make_tensors(specs);
        if (functions.make_state) functions.make_state(tensors);
        return tensors;
      };
    }
    const auto refer = [outputs = w.outputs, functions](std::span<const Tensor> state,
                                                        std::span<Tensor> next, const Data& data) {
      auto tensors = make_tensors(outputs);
      functions.reference(data, state, next, tensors);
      return widened(tensors);
    };
    if (functions.reference && w.state) {
      w.step = [refer](std::span<Tensor> state, const Data& data) {
        auto next = copy_tensors(state);
        auto outputs = refer(state, next, data);
        for (std::size_t i = 0; i < next.size(); ++i) copy_tensor(next[i], state[i]);
        return outputs;
      };
    } else if (functions.reference) {
      w.reference = [refer](const Data& data) { return refer({}, {}, data); };
    }
  }
  w.operation = operation;
  if (is_sized(definition)) {
    w.at_size = [shared](int width, int height) {
      Definition sized = *shared;
      sized.size = Size{width, height};
      check(sized, shared->source);
      return make(shared, *sized.size);
    };
  }
  return w;
}

}  // namespace

std::string to_string(Size size) { return fmt::format("{}x{}", size.width, size.height); }

std::optional<Size> size_from(std::string_view text) {
  const auto by = text.find('x');
  if (by == std::string_view::npos) return std::nullopt;
  const auto width = whole_number(text.substr(0, by), 1, kMostExtent);
  const auto height = whole_number(text.substr(by + 1), 1, kMostExtent);
  if (!width.value || !height.value) return std::nullopt;
  return Size{*width.value, *height.value};
}

std::string plain_name(const std::string& workload) {
  return workload.substr(0, workload.find('@'));
}

std::optional<Size> size_in(const std::string& workload) {
  const auto at = workload.find('@');
  return at == std::string::npos ? std::nullopt : size_from(workload.substr(at + 1));
}

std::optional<Element> element_from(std::string_view text) {
  const auto found =
      std::ranges::find(kElements, text, [](Element element) { return pirt::to_string(element); });
  return found == kElements.end() ? std::nullopt : std::optional(*found);
}

std::optional<std::int64_t> extent_from(std::string_view text) {
  const auto symbol = std::ranges::find(kSymbols, text, &Symbol::name);
  if (symbol != kSymbols.end()) return symbol->value;
  return whole_number<std::int64_t>(text, 1, kMostRow).value;
}

bool is_tensor_name(std::string_view name) { return is_name_of(name, "_-./:"); }

std::vector<TensorSpec> at(std::vector<TensorSpec> specs, Size size) {
  for (TensorSpec& spec : specs) {
    for (std::int64_t& extent : spec.shape) extent = at(extent, size);
  }
  return specs;
}

OpenclSource at(OpenclSource source, Size size) {
  for (std::int64_t& extent : source.global) extent = at(extent, size);
  source.options += fmt::format(" -DPIRT_WIDTH={} -DPIRT_HEIGHT={}", size.width, size.height);
  return source;
}

void check(const OpenclSource& source, const Definition& definition, const std::string& where) {
  std::vector<std::string> known;
  for (const auto* specs : {&definition.inputs, &definition.parameters, &definition.outputs}) {
    for (const TensorSpec& spec : *specs) known.push_back(spec.name);
  }
  for (const TensorSpec& spec : definition.state) {
    known.push_back(spec.name);
    known.push_back("next " + spec.name);
  }
  for (const OpenclArgument& argument : source.arguments) {
    if (!argument.tensor.empty()) {
      if (std::ranges::find(known, argument.tensor) != known.end()) continue;
      throw_bad_input(fmt::format("{}: there is no tensor '{}'{}", where, argument.tensor,
                                  suggestion(argument.tensor, known)));
    }
    const Range most = range_of(argument.element);
    const bool whole =
        !is_integer(argument.element) || std::trunc(argument.value) == argument.value;
    if (!whole || !(argument.value >= most.low && argument.value <= most.high)) {
      throw_bad_input(
          fmt::format("{}: {} is no {}", where, argument.value, pirt::to_string(argument.element)));
    }
  }
  const auto is_given = [&source](const std::string& tensor) {
    return std::ranges::find(source.arguments, tensor, &OpenclArgument::tensor) !=
           source.arguments.end();
  };
  for (const TensorSpec& output : definition.outputs) {
    if (is_given(output.name)) continue;
    throw_bad_input(fmt::format("{}: the kernel is not given output '{}', which nobody would write",
                                where, output.name));
  }
  for (const TensorSpec& state : definition.state) {
    if (is_given("next " + state.name)) continue;
    throw_bad_input(fmt::format(
        "{}: nobody would write what state '{}' becomes; give the kernel 'next {}' as well", where,
        state.name, state.name));
  }
  for (const std::int64_t extent : source.global) {
    const bool is_symbol = extent == kWidth || extent == kHeight;
    if (is_symbol && !definition.size) {
      throw_bad_input(where + " has a global size of `width` or `height`, and no size of its own");
    }
    if (!is_symbol && (extent < 0 || extent > kMostRow)) {
      throw_bad_input(fmt::format("{}: {} is no global size", where, extent));
    }
  }
  for (const std::int64_t extent : source.local) {
    if (extent < 0 || extent > kMostExtent) {
      throw_bad_input(fmt::format("{}: {} is no local size", where, extent));
    }
  }
}

void check(const Definition& definition, const std::string& where) {
  if (const std::string problem = name_problem(definition.name); !problem.empty()) {
    throw_bad_input(
        fmt::format("{}: the name '{}' {}", where, printable(definition.name), problem));
  }
  const std::string place = where + ": " + definition.name;
  if (definition.backends.empty()) throw_bad_input(place + " has no kernel for any backend");
  const bool on_device =
      std::ranges::find(definition.backends, "opencl") != definition.backends.end();
  if (on_device && definition.outputs.empty()) throw_bad_input(place + " has no output");
  if (is_sized(definition) && !definition.size) {
    throw_bad_input(place + " has tensors of `width` or `height`, and no size of its own");
  }
  const auto varies = [](const std::vector<TensorSpec>& specs) {
    return std::ranges::any_of(specs, &TensorSpec::varies);
  };
  if (on_device &&
      (varies(definition.inputs) || varies(definition.outputs) || varies(definition.state))) {
    throw_bad_input(place + " has lists, which a kernel of opencl cannot say the rows of");
  }
  std::set<std::string> names;
  for (const auto* specs : all_specs(definition)) {
    if (specs->size() > kMostTensors)
      throw_bad_input(place + " has more than 64 tensors of a kind");
    for (const TensorSpec& spec : *specs) {
      check_tensor(spec, definition.size.value_or(Size{}), place);
      if (!names.insert(spec.name).second) {
        throw_bad_input(fmt::format("{}: two tensors are called '{}'", place, spec.name));
      }
    }
  }
  if (definition.frames < 1 || definition.frames > 10'000) {
    throw_bad_input(
        fmt::format("{}: {} frames are not within 1 and 10,000", place, definition.frames));
  }
  const double sequence =
      definition.frames * bytes_of(definition.inputs, definition.size.value_or(Size{}));
  if (sequence > static_cast<double>(kMostSequence)) {
    throw_bad_input(fmt::format("{}: inputs of {} frames have {:.3g} bytes; {} are the most", place,
                                definition.frames, sequence, kMostSequence));
  }
  if (definition.slices < 1 || definition.slices > 10'000) {
    throw_bad_input(
        fmt::format("{}: {} slices are not within 1 and 10,000", place, definition.slices));
  }
  if (definition.limit < std::chrono::seconds(1) || definition.limit > std::chrono::hours(3)) {
    throw_bad_input(fmt::format("{}: a limit of {:.3g} s is not within 1 s and 3 h", place,
                                to_s(definition.limit)));
  }
  if (!(definition.ops_per_element >= 0 && definition.ops_per_element <= 1e15)) {
    throw_bad_input(place + ": operations per element are not within 0 and 1e15");
  }
  if (!(definition.tolerance >= 0 && definition.tolerance <= 1)) {
    throw_bad_input(place + ": the tolerance is not within 0 and 1");
  }
}

std::vector<Tensor> widened(std::span<const Tensor> tensors) {
  std::vector<Tensor> made = copy_tensors(tensors);
  for (Tensor& tensor : made) {
    if (tensor.spec().element == Element::kF32) tensor = wide(tensor);
  }
  return made;
}

Workload to_workload(const Definition& definition) {
  return make(std::make_shared<const Definition>(definition), definition.size.value_or(Size{}));
}

std::string tensor_text(const TensorSpec& spec) {
  std::vector<std::string> extents;
  for (const std::int64_t extent : spec.shape) {
    const auto symbol = std::ranges::find(kSymbols, extent, &Symbol::value);
    extents.push_back(symbol != kSymbols.end() ? std::string(symbol->name)
                                               : std::to_string(extent));
  }
  return fmt::format("{}[{}{}]", pirt::to_string(spec.element), spec.varies ? "<=" : "",
                     join(extents, ","));
}

TensorSpec tensor_from(const std::string& name, std::string_view text) {
  const auto fail = [&] {
    throw_bad_input(fmt::format(
        "'{}' is no tensor: an element (u8, i16, i32, f32, f64) and its extents, such as "
        "u8[480,640], f32[<=500,2], i16[height,width]",
        text));
  };
  const auto open = text.find('[');
  if (open == std::string_view::npos || text.back() != ']') fail();
  TensorSpec spec{.name = name, .element = Element::kU8, .shape = {}};
  const auto element = element_from(text.substr(0, open));
  if (!element) fail();
  spec.element = *element;
  std::string inside(text.substr(open + 1, text.size() - open - 2));
  if (inside.starts_with("<=")) {
    spec.varies = true;
    inside.erase(0, 2);
  }
  for (std::string extent : split(inside, ',')) {
    std::erase(extent, ' ');
    const auto number = extent_from(extent);
    if (!number) fail();
    spec.shape.push_back(*number);
  }
  return spec;
}

Json to_json(const Definition& definition) {
  Json json = {{"format", kFormat},
               {"name", definition.name},
               {"description", definition.description},
               {"source", definition.source},
               {"digest", definition.digest},
               {"inputs", tensors_json(definition.inputs)},
               {"parameters", tensors_json(definition.parameters)},
               {"outputs", tensors_json(definition.outputs)},
               {"state", tensors_json(definition.state)},
               {"frames", definition.frames},
               {"slices", definition.slices},
               {"ops_per_element", definition.ops_per_element},
               {"tolerance", definition.tolerance},
               {"verified", definition.verified},
               {"limit_s", to_s(definition.limit)},
               {"backends", definition.backends}};
  if (definition.size) json["size"] = to_string(*definition.size);
  return json;
}

Definition definition_from(const Json& json) {
  if (json.at("format").get<int>() != kFormat) {
    throw_bad_input("it is of another version of pirt; measure it again");
  }
  Definition made;
  made.name = json.at("name").get<std::string>();
  made.description = json.at("description").get<std::string>();
  made.source = json.at("source").get<std::string>();
  made.digest = json.at("digest").get<std::string>();
  made.inputs = tensors_from(json.at("inputs"));
  made.parameters = tensors_from(json.at("parameters"));
  made.outputs = tensors_from(json.at("outputs"));
  made.state = tensors_from(json.at("state"));
  if (json.contains("size")) {
    made.size = size_from(json.at("size").get<std::string>());
    if (!made.size) throw_bad_input("its size is none");
  }
  made.frames = json.at("frames");
  made.slices = json.at("slices");
  made.ops_per_element = json.at("ops_per_element");
  made.tolerance = json.at("tolerance");
  made.verified = json.at("verified");
  const double limit_s = json.value("limit_s", to_s(kDefaultLimit));
  made.limit = from_s(limit_s >= 0 && limit_s <= 1e6 ? limit_s : 0);
  made.backends = json.at("backends").get<std::vector<std::string>>();
  check(made, "workload '" + made.name + "'");
  return made;
}

}  // namespace pirt::own
