// pirt's interface for workloads of your own, for C++17: a thin face on <pirt/module.h>, whose rules hold.
//
// Example, a whole module:
//     #include <pirt/module.hpp>
//     using namespace pirt::module;
//     void threshold(const Call& call) {
//       const auto image = call.input<uint8_t>(0);
//       auto mask = call.output<uint8_t>(0);
//       for (int64_t i = 0; i < image.count(); ++i) mask[i] = image[i] > 128 ? 255 : 0;
//     }
//     PIRT_MODULE(Workload("mine.threshold").size(640, 480)
//                     .input<uint8_t>("image", {kHeight, kWidth})
//                     .output<uint8_t>("mask", {kHeight, kWidth}).cpu<threshold>())
#pragma once

#include <pirt/module.h>

#include <cstring>
#include <deque>
#include <exception>
#include <initializer_list>
#include <memory>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

namespace pirt::module {

inline constexpr int64_t kWidth = PIRT_WIDTH, kHeight = PIRT_HEIGHT;

template <typename T>
constexpr int32_t element_of() {
  using U = std::remove_const_t<T>;
  if constexpr (std::is_same_v<U, uint8_t>) return PIRT_U8;
  else if constexpr (std::is_same_v<U, int16_t>) return PIRT_I16;
  else if constexpr (std::is_same_v<U, int32_t>) return PIRT_I32;
  else if constexpr (std::is_same_v<U, float>) return PIRT_F32;
  else {
    static_assert(std::is_same_v<U, double>, "uint8_t, int16_t, int32_t, float, double");
    return PIRT_F64;
  }
}

/// A tensor's elements.
template <typename T>
class View {
 public:
  explicit View(const pirt_tensor& of) : of_(&of), data_(static_cast<T*>(of.data)) {}
  T& operator[](int64_t i) const { return data_[i]; }
  /// Of the two fastest dimensions, an image's.
  T& at(int64_t y, int64_t x) const { return data_[y * of_->shape[of_->dims - 1] + x]; }
  T& operator()(int64_t y, int64_t x) const { return at(y, x); }
  /// Beyond the border the pixel at it.
  T& clamped(int64_t y, int64_t x) const { return at(within(y, height()), within(x, width())); }
  T* data() const { return data_; }
  T* begin() const { return data_; }
  T* end() const { return data_ + count(); }
  int64_t dim(int axis) const { return of_->shape[axis]; }
  int64_t width() const { return of_->shape[of_->dims - 1]; }
  int64_t height() const { return of_->dims > 1 ? of_->shape[of_->dims - 2] : 1; }
  /// That it has, where it varies.
  int64_t rows() const { return of_->rows; }
  /// Elements of its capacity.
  int64_t count() const {
    int64_t all = 1;
    for (int32_t i = 0; i < of_->dims; ++i) all *= of_->shape[i];
    return all;
  }

 private:
  static int64_t within(int64_t p, int64_t extent) { return p < 0 ? 0 : p < extent ? p : extent - 1; }
  const pirt_tensor* of_;
  T* data_;
};

/// One call.
class Call {
 public:
  explicit Call(const pirt_call& call) : call_(&call) {}
  template <typename T> View<const T> input(int i) const { return View<const T>(call_->inputs[i]); }
  template <typename T> View<T> output(int i) const { return View<T>(call_->outputs[i]); }
  /// Of a reference alone: kernels are given them when they are made.
  template <typename T> View<const T> parameter(int i) const {
    return View<const T>(given(call_->parameters, kNoParameters)[i]);
  }
  template <typename T> View<const T> state(int i) const { return View<const T>(given(call_->state, kNoState)[i]); }
  template <typename T> View<T> next_state(int i) const { return View<T>(given(call_->next_state, kNoState)[i]); }
  /// Of an output that varies.
  void set_rows(int output, int64_t rows) const { call_->outputs[output].rows = rows; }
  int threads() const { return call_->threads; }
  bool is_stopped() const { return call_->is_stopped(call_) != 0; }
  void between_slices() const { call_->between_slices(call_); }
  const pirt_call& raw() const { return *call_; }

 private:
  static constexpr const char* kNoParameters =
      "parameters are given when a kernel is made: take them in the constructor of cpu_class<K>()";
  static constexpr const char* kNoState = "the workload has no state";
  template <typename Tensor>
  static Tensor* given(Tensor* tensors, const char* why_not) {
    if (tensors == nullptr) throw std::logic_error(why_not);
    return tensors;
  }
  const pirt_call* call_;
};

namespace detail {

/// One of the interface's structs, with its head and zeros.
template <typename T>
T headed() {
  T made{};
  made.size = sizeof(T);
  made.version = PIRT_MODULE_VERSION;
  return made;
}

/// What it throws becomes a status and a message.
template <typename Function>
int guarded(char* message, size_t size, const Function& function) noexcept {
  const auto say = [=](const char* text) {
    if (message == nullptr || size == 0) return;
    std::strncpy(message, text, size - 1);
    message[size - 1] = '\0';
  };
  try {
    function();
    return 0;
  } catch (const std::exception& error) {
    say(error.what());
  } catch (...) {
    say("it threw what is no std::exception");
  }
  return 1;
}

template <void (*kRun)(const Call&)>
int run(void*, const pirt_call* call) {
  return guarded(call->message, call->message_size, [call] { kRun(Call(*call)); });
}

template <void (*kRun)(const Call&)>
int refer(const pirt_call* call) {
  return run<kRun>(nullptr, call);
}

}  // namespace detail

/// A workload in the making; see pirt_workload for what each of them means.
class Workload {
 public:
  explicit Workload(const std::string& name) : kept_(std::make_shared<Kept>()) {
    kept_->all = detail::headed<pirt_workload>();
    kept_->all.name = text(name);
    kept_->all.description = text("");
  }
  Workload& description(const std::string& what) { return kept_->all.description = text(what), *this; }
  Workload& size(int64_t width, int64_t height) {
    kept_->all.width = width, kept_->all.height = height;
    return *this;
  }
  template <typename T>
  Workload& input(const std::string& name, std::initializer_list<int64_t> shape) {
    return add(kept_->inputs, kept_->all.inputs, kept_->all.input_count, spec<T>(name, shape));
  }
  template <typename T>
  Workload& output(const std::string& name, std::initializer_list<int64_t> shape) {
    return add(kept_->outputs, kept_->all.outputs, kept_->all.output_count, spec<T>(name, shape));
  }
  template <typename T>
  Workload& parameter(const std::string& name, std::initializer_list<int64_t> shape) {
    return add(kept_->parameters, kept_->all.parameters, kept_->all.parameter_count, spec<T>(name, shape));
  }
  template <typename T>
  Workload& state(const std::string& name, std::initializer_list<int64_t> shape) {
    return add(kept_->state, kept_->all.state, kept_->all.state_count, spec<T>(name, shape));
  }
  Workload& operations_per_element(double count) { return kept_->all.operations_per_element = count, *this; }
  Workload& tolerance(double share_of_peak) { return kept_->all.tolerance = share_of_peak, *this; }
  Workload& frames(int count) { return kept_->all.frames = count, *this; }
  Workload& slices(int count) { return kept_->all.slices = count, *this; }
  /// A function of the host's cores.
  template <void (*kRun)(const Call&)>
  Workload& cpu() {
    kept_->cpu = {PIRT_HEAD(pirt_cpu_kernel), nullptr, detail::run<kRun>, nullptr};
    kept_->all.cpu = &kept_->cpu;
    return *this;
  }
  /// The same of a class: `explicit K(const pirt_setup&)`, `void operator()(const Call&)`.
  template <typename K>
  Workload& cpu_class() {
    kept_->cpu = {PIRT_HEAD(pirt_cpu_kernel),
                  [](const pirt_setup* setup, void** kernel) {
                    return detail::guarded(setup->message, setup->message_size, [=] { *kernel = new K(*setup); });
                  },
                  [](void* kernel, const pirt_call* call) {
                    return detail::guarded(call->message, call->message_size,
                                           [=] { (*static_cast<K*>(kernel))(Call(*call)); });
                  },
                  [](void* kernel) { delete static_cast<K*>(kernel); }};
    kept_->all.cpu = &kept_->cpu;
    return *this;
  }
  template <void (*kRun)(const Call&)>
  Workload& reference() { return kept_->all.reference = detail::refer<kRun>, *this; }
  /// A source whose kernel gets the tensors of those names, in that order, for each pixel.
  Workload& opencl(const std::string& source, const std::string& kernel,
                   std::initializer_list<const char*> tensors, int64_t columns = kWidth, int64_t rows = kHeight) {
    kept_->opencl = detail::headed<pirt_opencl_kernel>();
    kept_->opencl.source = text(source);
    kept_->opencl.kernel = text(kernel);
    kept_->opencl.global[0] = columns, kept_->opencl.global[1] = rows;
    for (const char* tensor : tensors) {
      kept_->arguments.push_back({PIRT_HEAD(pirt_opencl_argument), text(tensor), 0, 0});
    }
    kept_->opencl.arguments = kept_->arguments.data();
    kept_->opencl.argument_count = static_cast<uint32_t>(kept_->arguments.size());
    kept_->all.opencl = &kept_->opencl;
    return *this;
  }
  /// For what is not above.
  pirt_workload& raw() { return kept_->all; }
  const pirt_workload& raw() const { return kept_->all; }

 private:
  struct Kept {
    pirt_workload all;
    std::deque<std::string> texts;
    std::vector<pirt_tensor_spec> inputs, outputs, parameters, state;
    std::vector<pirt_opencl_argument> arguments;
    pirt_cpu_kernel cpu;
    pirt_opencl_kernel opencl;
  };
  const char* text(const std::string& of) { return kept_->texts.emplace_back(of).c_str(); }
  template <typename T>
  pirt_tensor_spec spec(const std::string& name, std::initializer_list<int64_t> shape) {
    auto made = detail::headed<pirt_tensor_spec>();
    made.name = text(name);
    made.element = element_of<T>();
    for (const int64_t extent : shape) {
      if (made.dims < PIRT_MOST_DIMS) made.shape[made.dims] = extent;
      ++made.dims;  // Too many are refused by name when the module is loaded.
    }
    return made;
  }
  Workload& add(std::vector<pirt_tensor_spec>& to, const pirt_tensor_spec*& first, uint32_t& count,
                const pirt_tensor_spec& spec) {
    to.push_back(spec);
    first = to.data(), count = static_cast<uint32_t>(to.size());
    return *this;
  }
  std::shared_ptr<Kept> kept_;
};

/// The table of a module. @param workloads  Stay as they are from then on.
inline const pirt_module* table_of(std::vector<Workload> workloads) {
  struct Table {
    std::vector<Workload> workloads;
    std::vector<const pirt_workload*> all;
    pirt_module module;
  };
  auto* table = new Table{std::move(workloads), {}, detail::headed<pirt_module>()};  // Never unloaded.
  for (const Workload& each : table->workloads) table->all.push_back(&each.raw());
  table->module.workloads = table->all.data();
  table->module.workload_count = static_cast<uint32_t>(table->all.size());
  return &table->module;
}

}  // namespace pirt::module

/// Defines what the module exports: its workloads, with commas.
#define PIRT_MODULE(...)                                                                     \
  extern "C" PIRT_EXPORT const pirt_module* pirt_module_v1(void) {                           \
    static const pirt_module* const table = ::pirt::module::table_of({__VA_ARGS__});         \
    return table;                                                                            \
  }
