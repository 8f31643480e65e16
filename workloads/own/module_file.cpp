// Modules: shared libraries that export pirt_module_v1 (module.h).
#include <dlfcn.h>
#include <fmt/core.h>
#include <link.h>

#include <algorithm>
#include <array>
#include <cfenv>
#include <clocale>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <limits>
#include <memory>
#include <mutex>
#include <stop_token>
#include <type_traits>
#include <utility>

#include "workloads/base/error.h"
#include "workloads/base/text/printable.h"
#include "workloads/model/own_operation.h"
#include "workloads/model/slices.h"
#include "workloads/own/module.h"
#include "workloads/own/own.h"

namespace pirt::own {
namespace {

constexpr std::uint32_t kMostCount = 64;
static_assert(PIRT_U8 == static_cast<int>(Element::kU8) &&
              PIRT_I16 == static_cast<int>(Element::kI16) &&
              PIRT_I32 == static_cast<int>(Element::kI32) &&
              PIRT_F32 == static_cast<int>(Element::kF32) &&
              PIRT_F64 == static_cast<int>(Element::kF64));

/// What a function of the module says of a failure, and what says that its call is wanted no more:
/// that token is of the thread that is called, and the module may ask from others, also by a copy
/// of the call, which has this address too.
class Message {
 public:
  [[nodiscard]] static const Message& of(const pirt_call& call) {
    return *reinterpret_cast<const Message*>(call.message);
  }
  [[nodiscard]] char* data() { return text_.data(); }
  [[nodiscard]] std::size_t size() const { return text_.size(); }
  [[nodiscard]] bool is_stopped() const { return stop_.stop_requested(); }
  /// @throws Error{kEnvironment} unless @p status is 0.
  void check(int status, const std::string& what) {
    if (status != 0) throw_environment(failure(status, what));
  }
  /// @throws CallFailed unless @p status is 0.
  void check_call(int status, const std::string& workload) {
    if (status != 0) throw CallFailed(failure(status, workload));
  }

 private:
  std::string failure(int status, const std::string& what) {
    text_.back() = '\0';
    return fmt::format("{} failed with {}{}{}", what, status, text_.front() == '\0' ? "" : ": ",
                       text_.data());
  }
  std::array<char, 512> text_{};  ///< First: its address is the message's.
  std::stop_token stop_ = stop_of_call();
};
static_assert(std::is_standard_layout_v<Message>);

/// Whether a struct of the module is of a version that is known here.
template <typename T>
void check_head(const T& given, const char* type, const std::string& where) {
  constexpr std::uint32_t kLongestStruct = 4096;  // Of any version: whoever has more has no head.
  if (given.version == PIRT_MODULE_VERSION && given.size >= sizeof(T) &&
      given.size <= kLongestStruct && given.size % alignof(T) == 0) {
    return;
  }
  throw_bad_input(
      fmt::format("{}: a {} has version {} and {} bytes; this pirt knows version {} of "
                  "{} bytes; build it with this pirt's <pirt/module.h>",
                  where, type, given.version, given.size, PIRT_MODULE_VERSION, sizeof(T)));
}

void check_count(std::uint32_t count, const void* array, const std::string& where,
                 std::uint32_t most = kMostCount) {
  if (count > most) {
    throw_bad_input(fmt::format("{}: it has {} of a kind; {} are the most", where, count, most));
  }
  if (count > 0 && array == nullptr) throw_bad_input(where + ": a table is null");
}

/// Element @p i of a table whose elements may be longer than this version's.
template <typename T>
const T& element(const T* first, std::uint32_t i) {
  const auto* bytes = reinterpret_cast<const std::byte*>(first);
  return *reinterpret_cast<const T*>(bytes + static_cast<std::size_t>(i) * first->size);
}

TensorSpec spec_of(const pirt_tensor_spec& given, const std::string& where) {
  check_head(given, "pirt_tensor_spec", where);
  TensorSpec spec{.name = given.name == nullptr ? "" : given.name,
                  .element = Element::kU8,
                  .shape = {},
                  .varies = given.varies != 0};
  if (given.element < 0 || given.element > PIRT_F64) {
    throw_bad_input(fmt::format("{}: tensor '{}' has elements of a type {} that there is not",
                                where, printable(spec.name), given.element));
  }
  if (given.dims < 1 || given.dims > PIRT_MOST_DIMS) {
    throw_bad_input(fmt::format("{}: tensor '{}' has {} dimensions; 1 to {} are possible", where,
                                spec.name, given.dims, PIRT_MOST_DIMS));
  }
  spec.element = static_cast<Element>(given.element);
  spec.shape.assign(given.shape, given.shape + given.dims);
  if (given.has_range != 0) spec.ranges = {{given.low, given.high}};
  return spec;
}

std::vector<TensorSpec> specs_of(const pirt_tensor_spec* first, std::uint32_t count,
                                 const std::string& where) {
  check_count(count, first, where);
  std::vector<TensorSpec> specs;
  for (std::uint32_t i = 0; i < count; ++i) specs.push_back(spec_of(element(first, i), where));
  return specs;
}

pirt_tensor tensor_of(const Tensor& tensor) {
  pirt_tensor made{PIRT_HEAD(pirt_tensor),
                   const_cast<std::byte*>(tensor.data()),
                   static_cast<std::int32_t>(tensor.spec().element),
                   static_cast<std::int32_t>(tensor.spec().shape.size()),
                   {},
                   tensor.rows()};
  std::ranges::copy(tensor.spec().shape, made.shape);
  return made;
}

std::vector<pirt_tensor> tensors_of(std::span<const Tensor> tensors) {
  std::vector<pirt_tensor> made;
  for (const Tensor& tensor : tensors) made.push_back(tensor_of(tensor));
  return made;
}

/// The rows that the module gave lists.
/// @throws CallFailed
void take_rows(const std::vector<pirt_tensor>& from, std::span<Tensor> to,
               const std::string& what) {
  for (std::size_t i = 0; i < to.size(); ++i) {
    if (!to[i].spec().varies) continue;
    if (from[i].rows < 0 || from[i].rows > to[i].dim(0)) {
      throw CallFailed(
          fmt::format("{} gave {} {} rows", what, to[i].spec().describe(), from[i].rows));
    }
    to[i].set_rows(from[i].rows);
  }
}

std::int32_t is_stopped(const pirt_call* call) { return Message::of(*call).is_stopped() ? 1 : 0; }

void on_slice(const pirt_call* call) {
  static_cast<void>(call);
  between_slices();
}

/// A call of one of the module's functions on these tensors.
struct CallOfModule {
  std::vector<pirt_tensor> inputs, outputs, parameters, state, next;
  Message message;

  [[nodiscard]] pirt_call call(Size size, int threads) {
    const auto or_null = [](std::vector<pirt_tensor>& tensors) {
      return tensors.empty() ? nullptr : tensors.data();
    };
    return {PIRT_HEAD(pirt_call), inputs.data(),  outputs.data(),
            or_null(parameters),  or_null(state), or_null(next),
            size.width,           size.height,    threads,
            is_stopped,           on_slice,       message.data(),
            message.size()};
  }
};

/// A prepared kernel of the host's cores.
class ModuleKernel final : public Kernel {
 public:
  ModuleKernel(std::string name, const pirt_cpu_kernel& functions, Size size,
               std::span<const Tensor> parameters, int threads)
      : name_(std::move(name)), functions_(functions), size_(size), threads_(threads) {
    if (functions_.make == nullptr) return;
    const auto given = tensors_of(parameters);
    Message message;
    const pirt_setup setup{PIRT_HEAD(pirt_setup), size.width,    size.height, given.data(), threads,
                           message.data(),        message.size()};
    message.check(functions_.make(&setup, &kernel_), name_ + ": making its kernel");
    made_ = true;
  }
  ~ModuleKernel() override {
    if (made_ && functions_.release != nullptr) functions_.release(kernel_);
  }
  ModuleKernel(const ModuleKernel&) = delete;
  ModuleKernel& operator=(const ModuleKernel&) = delete;

  void bind(std::span<const Tensor> inputs, std::span<Tensor> outputs) override {
    inputs_ = inputs;
    outputs_ = outputs;
  }
  void bind_state(std::span<const Tensor> current, std::span<Tensor> next) override {
    current_ = current;
    next_ = next;
  }
  std::optional<Nanos> execute(int repeats) override {
    CallOfModule tensors{.inputs = tensors_of(inputs_),
                         .outputs = tensors_of(outputs_),
                         .parameters = {},
                         .state = tensors_of(current_),
                         .next = tensors_of(next_),
                         .message = {}};
    const pirt_call call = tensors.call(size_, threads_);
    for (int i = 0; i < repeats; ++i) {
      tensors.message.check_call(functions_.run(kernel_, &call), name_);
    }
    take_rows(tensors.outputs, outputs_, name_);
    take_rows(tensors.next, next_, name_);
    return std::nullopt;
  }

 private:
  std::string name_;
  const pirt_cpu_kernel& functions_;
  Size size_;
  int threads_;
  void* kernel_ = nullptr;
  bool made_ = false;
  std::span<const Tensor> inputs_, current_;
  std::span<Tensor> outputs_, next_;
};

/// What enqueues by the module's functions, and lets go of its kernel.
class ModuleEnqueue {
 public:
  ModuleEnqueue(std::string name, const pirt_opencl_kernel& functions, Size size,
                const OpenclUnit& unit)
      : name_(std::move(name)), functions_(functions), size_(size), unit_(unit) {
    if (functions_.make == nullptr) return;
    const pirt_opencl_unit given = raw();
    message_.check(functions_.make(&given, &kernel_), name_ + ": making its kernel");
    made_ = true;
  }
  ~ModuleEnqueue() {
    if (made_ && functions_.release != nullptr) functions_.release(kernel_);
  }
  ModuleEnqueue(const ModuleEnqueue&) = delete;
  ModuleEnqueue& operator=(const ModuleEnqueue&) = delete;

  void operator()() {
    const pirt_opencl_unit given = raw();
    message_.check(functions_.enqueue(kernel_, &given), name_);
  }

 private:
  pirt_opencl_unit raw() {
    return {PIRT_HEAD(pirt_opencl_unit),
            unit_.context,
            unit_.device,
            unit_.queue,
            unit_.inputs.data(),
            unit_.outputs.data(),
            unit_.parameters.data(),
            size_.width,
            size_.height,
            message_.data(),
            message_.size()};
  }
  std::string name_;
  const pirt_opencl_kernel& functions_;
  Size size_;
  OpenclUnit unit_;
  Message message_;
  void* kernel_ = nullptr;
  bool made_ = false;
};

/// Without a size.
OpenclSource source_of(const pirt_opencl_kernel& given, const std::string& where) {
  if (given.kernel == nullptr) throw_bad_input(where + ": its OpenCL kernel has no name");
  OpenclSource source{.file = where,
                      .text = given.source,
                      .kernel = given.kernel,
                      .options = given.options == nullptr ? "" : std::string(" ") + given.options};
  std::ranges::copy(given.global, source.global.begin());
  std::ranges::copy(given.local, source.local.begin());
  check_count(given.argument_count, given.arguments, where);
  for (std::uint32_t i = 0; i < given.argument_count; ++i) {
    const pirt_opencl_argument& argument = element(given.arguments, i);
    check_head(argument, "pirt_opencl_argument", where);
    if (argument.element < 0 || argument.element > PIRT_F64) {
      throw_bad_input(where + ": an argument is of a type that there is not");
    }
    source.arguments.push_back({.tensor = argument.tensor == nullptr ? "" : argument.tensor,
                                .element = static_cast<Element>(argument.element),
                                .value = argument.value});
  }
  return source;
}

Functions functions_of(const pirt_workload& given, const std::string& where, Size size) {
  const std::string name = given.name;
  Functions made;
  if (given.make_inputs != nullptr) {
    made.make_inputs = [&given, name](const DataRequest& request, std::span<Tensor> inputs,
                                      std::span<Tensor> parameters) {
      auto to = tensors_of(inputs);
      auto constants = tensors_of(parameters);
      Message().check(given.make_inputs(request.seed, request.frame, to.data(), constants.data()),
                      name + ": making its inputs");
      take_rows(to, inputs, name);
      take_rows(constants, parameters, name);
    };
  }
  if (given.make_state != nullptr) {
    made.make_state = [&given, name](std::span<Tensor> state) {
      auto to = tensors_of(state);
      Message().check(given.make_state(to.data()), name + ": making its state");
      take_rows(to, state, name);
    };
  }
  if (given.reference != nullptr) {
    made.reference = [&given, name, size](const Data& data, std::span<const Tensor> state,
                                          std::span<Tensor> next, std::span<Tensor> outputs) {
      CallOfModule tensors{.inputs = tensors_of(data.inputs),
                           .outputs = tensors_of(outputs),
                           .parameters = tensors_of(data.parameters),
                           .state = tensors_of(state),
                           .next = tensors_of(next),
                           .message = {}};
      const pirt_call call = tensors.call(size, 1);
      tensors.message.check(given.reference(&call), name + ": its reference");
      take_rows(tensors.outputs, outputs, name);
      take_rows(tensors.next, next, name);
    };
  }
  if (given.cpu != nullptr) {
    made.cpu = [&given, name, size](std::span<const Tensor> parameters, int threads) {
      return std::make_unique<ModuleKernel>(name, *given.cpu, size, parameters, threads);
    };
  }
  if (given.opencl != nullptr && given.opencl->source != nullptr) {
    made.opencl = at(source_of(*given.opencl, where), size);
  } else if (given.opencl != nullptr) {
    made.opencl_function = [&given, name, size](const OpenclUnit& unit) {
      auto enqueue = std::make_shared<ModuleEnqueue>(name, *given.opencl, size, unit);
      return [enqueue] { (*enqueue)(); };
    };
  }
  return made;
}

void check_kernels(const pirt_workload& given, const std::string& where) {
  if (given.cpu != nullptr) {
    check_head(*given.cpu, "pirt_cpu_kernel", where);
    if (given.cpu->run == nullptr) throw_bad_input(where + ": its cpu kernel has no `run`");
  }
  if (given.opencl != nullptr) {
    check_head(*given.opencl, "pirt_opencl_kernel", where);
    if (given.opencl->source == nullptr && given.opencl->enqueue == nullptr) {
      throw_bad_input(where + ": its opencl kernel has neither a source nor `enqueue`");
    }
  }
}

Definition definition_of(const pirt_workload& given, const std::string& file) {
  check_head(given, "pirt_workload", file);
  if (given.name == nullptr) throw_bad_input(file + ": a workload has no name");
  const std::string where = file + ": " + printable(given.name);
  check_kernels(given, where);
  Definition made;
  made.name = given.name;
  if (given.description != nullptr) made.description = printable(given.description);
  made.inputs = specs_of(given.inputs, given.input_count, where);
  made.outputs = specs_of(given.outputs, given.output_count, where);
  if (made.outputs.empty()) throw_bad_input(where + " has no output");
  made.parameters = specs_of(given.parameters, given.parameter_count, where);
  made.state = specs_of(given.state, given.state_count, where);
  if (given.width != 0 || given.height != 0) {
    made.size = size_from(fmt::format("{}x{}", given.width, given.height));
    if (!made.size) {
      throw_bad_input(fmt::format("{}: {}x{} is no size", where, given.width, given.height));
    }
  }
  made.frames = given.frames == 0 ? 1 : given.frames;
  made.slices = given.slices == 0 ? 1 : given.slices;
  made.ops_per_element = given.operations_per_element;
  made.tolerance = given.tolerance;
  made.verified = given.reference != nullptr;
  if (given.cpu != nullptr) made.backends.emplace_back("cpu");
  if (given.opencl != nullptr) made.backends.emplace_back("opencl");
  if (given.opencl != nullptr && given.opencl->source == nullptr && !made.state.empty()) {
    throw_bad_input(where + ": functions of opencl get no state; give a source");
  }
  if (given.opencl != nullptr && given.opencl->source != nullptr) {
    check(source_of(*given.opencl, where), made, where);
  }
  made.functions = [&given, where](Size size) { return functions_of(given, where, size); };
  return made;
}

/// The loader maps what a library says it has: of one that is cut off, the first look at what is
/// missing would end the process.
void check_whole(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  const auto size = std::filesystem::file_size(file);
  ElfW(Ehdr) head{};
  in.read(reinterpret_cast<char*>(&head), sizeof head);
  bool whole = in.good() && head.e_phentsize == sizeof(ElfW(Phdr));
  in.seekg(static_cast<std::streamoff>(head.e_phoff));
  for (int i = 0; whole && i < head.e_phnum; ++i) {
    ElfW(Phdr) part{};
    in.read(reinterpret_cast<char*>(&part), sizeof part);
    whole = in.good() && (part.p_type != PT_LOAD ||
                          (part.p_offset <= size && part.p_filesz <= size - part.p_offset));
  }
  if (!whole) throw_bad_input(file.string() + " is no library, or is cut off; build it again");
}

/// What a library's constructors may set for all that the process computes is as it was: how
/// floats are computed (-ffast-math makes denormals 0), and the locale.
class AsBefore {
 public:
  AsBefore() { std::fegetenv(&floats_); }
  ~AsBefore() {
    std::fesetenv(&floats_);
    if (locale_ != std::setlocale(LC_ALL, nullptr)) std::setlocale(LC_ALL, locale_.c_str());
  }
  AsBefore(const AsBefore&) = delete;
  AsBefore& operator=(const AsBefore&) = delete;

 private:
  std::fenv_t floats_{};
  std::string locale_ = std::setlocale(LC_ALL, nullptr);
};

}  // namespace

std::vector<Definition> load_module(const std::filesystem::path& file) {
  check_whole(file);
  const AsBefore kept;
  // What one library brings does not meet what another one calls the same.
  void* const library = ::dlopen(file.c_str(), RTLD_NOW | RTLD_LOCAL);
  if (library == nullptr) {
    const char* const why = ::dlerror();
    throw_environment(fmt::format("cannot load {}: {}", file.string(),
                                  why == nullptr ? "the loader does not say why" : why));
  }
  auto* const entry =
      reinterpret_cast<decltype(&pirt_module_v1)>(::dlsym(library, "pirt_module_v1"));
  if (entry == nullptr) {
    throw_bad_input(file.string() +
                    " is no module of pirt: it has no function pirt_module_v1 (<pirt/module.h>)");
  }
  const pirt_module* const module = entry();
  if (module == nullptr) throw_bad_input(file.string() + ": pirt_module_v1 returned null");
  check_head(*module, "pirt_module", file.string());
  check_count(module->workload_count, module->workloads, file.string(), 1000);
  std::vector<Definition> all;
  for (std::uint32_t i = 0; i < module->workload_count; ++i) {
    if (module->workloads[i] == nullptr) throw_bad_input(file.string() + ": a workload is null");
    all.push_back(definition_of(*module->workloads[i], file.string()));
  }
  return all;
}

}  // namespace pirt::own
