// The AlexNet kernels of the cpu backend: a chain of oneDNN primitives in the layouts that these
// prefer, whether of one layer or of all.
//
// Weights are reordered once. Activations change layout only where two neighbours differ, and at
// the two ends, where the host's plain tensors are used in place if the primitive takes them so.
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "workloads/backends/cpu/dnn_precision.h"
#include "workloads/backends/cpu/kernels.h"
#include "workloads/backends/cpu/onednn.h"
#include "workloads/dnn/dnn.h"
#include "workloads/model/slices.h"

namespace pirt::cpu {
namespace {

using dnnl::memory;
using Format = memory::format_tag;

constexpr auto kF32 = memory::data_type::f32;

memory::desc plain(const memory::dims& dims, memory::data_type type = kF32) {
  constexpr std::array kFormats = {Format::a, Format::ab, Format::abc, Format::abcd};
  return {dims, type, kFormats[dims.size() - 1]};
}

/// The same values in whatever layout the primitive likes best.
memory::desc any(const memory::dims& dims) { return {dims, kF32, Format::any}; }

/// Whether the values of @p part, some output channels of one image, lie in memory one after the
/// other as in @p whole, which has all.
bool is_part_of(const memory::desc& part, const memory::desc& whole) {
  const memory::dims part_strides = strides_of(part), whole_strides = strides_of(whole);
  const memory::dims some = dims_of(part), all = dims_of(whole);
  return some.size() == all.size() && blocks_of(part) == blocks_of(whole) &&
         std::ranges::equal(std::span(part_strides).subspan(1),
                            std::span(whole_strides).subspan(1)) &&
         all[0] == 1 &&
         whole.get_size() * static_cast<std::size_t>(some[1]) ==
             part.get_size() * static_cast<std::size_t>(all[1]);
}

/// Dimensions of an activation with its batch in front, which the tensor of a single image has not.
memory::dims with_batch(const TensorSpec& spec, int batch) {
  memory::dims dims = spec.shape;
  if (batch == 1) dims.insert(dims.begin(), 1);
  return dims;
}

class DnnKernel : public Kernel {
 public:
  /// For @p batch images a call.
  explicit DnnKernel(int batch)
      : batch_(batch), engine_(dnnl::engine::kind::cpu, 0), stream_(engine_) {}

  void bind(std::span<const Tensor> inputs, std::span<Tensor> outputs) override {
    // oneDNN has no view of constant memory; the input is only read.
    input_.set_data_handle(const_cast<std::byte*>(inputs[0].data()));
    output_.set_data_handle(outputs[0].data());
  }

  std::optional<Nanos> execute(int repeats) override {
    for (int i = 0; i < repeats; ++i) {
      for (const auto& step : steps_) {
        step.primitive.execute(stream_, step.arguments);
        if (!step.ends_slice || &step == &steps_.back() || !are_slices_heard()) continue;
        stream_.wait();
        between_slices();
      }
    }
    stream_.wait();
    return std::nullopt;
  }

  void begin(const TensorSpec& input) {
    input_ = current_ = memory(plain(with_batch(input, batch_)), engine_, DNNL_MEMORY_NONE);
  }

  /// Adds the layer that @p layer's operation says. @param parameters  Its own.
  /// @param parts  As dnn::parts_of.
  void add(const Workload& layer, std::span<const Tensor> parameters, int parts = 1) {
    const Operation* op = layer.operation.get();
    if (const auto* conv = dynamic_cast<const dnn::Conv2dRelu*>(op)) {
      add_conv(*conv, arithmetic_of(layer.precision, conv->input, parameters[0]), parameters,
               parts);
    } else if (const auto* pool = dynamic_cast<const dnn::MaxPool*>(op)) {
      add_pool(*pool);
    } else {
      const auto& full = operation_as<dnn::FullyConnected>(layer);
      add_fully_connected(full, arithmetic_of(layer.precision, full.input, parameters[0]),
                          parameters, parts);
    }
    steps_.back().ends_slice = true;
  }

  /// The result goes to the host in its plain layout: by the last step itself, or by one more.
  void end(const TensorSpec& output) {
    steps_.back().ends_slice = false;
    const auto desc = plain(with_batch(output, batch_));
    if (current_.get_desc() == desc) {
      output_ = current_;
      return;
    }
    output_ = memory(desc, engine_, DNNL_MEMORY_NONE);
    add_reorder(current_, output_);
  }

 private:
  struct PrimitiveCall {
    dnnl::primitive primitive;
    Arguments arguments;
    bool ends_slice = false;  ///< The call can be left behind it.
  };

  /// The current activation in the layout and type @p desc, by one more step if it has another.
  memory current_as(const memory::desc& desc, float scale = 1) {
    if (current_.get_desc() == desc) return current_;
    memory reordered(desc, engine_);
    add_reorder(current_, reordered, scale);
    return reordered;
  }

  void add_reorder(const memory& from, const memory& to, float scale = 1) {
    Reorder reorder(engine_, from, to, scale);
    steps_.push_back({std::move(reorder.primitive), std::move(reorder.arguments)});
  }

  /// A copy of the values in the primitive's layout, made now.
  memory parameter_as(const memory::desc& desc, memory from) {
    memory to(desc, engine_);
    dnnl::reorder(from, to).execute(stream_, from, to);
    stream_.wait();
    return to;
  }
  memory parameter_as(const memory::desc& desc, const memory::dims& dims, const float* values) {
    return parameter_as(desc, memory(plain(dims), engine_, const_cast<float*>(values)));
  }
  /// The same of values that are multiplied by the scale of their output channel and rounded.
  memory quantized_as(const memory::desc& desc, const memory::dims& dims,
                      std::span<const float> values, const std::vector<float>& scales) {
    const std::size_t length = values.size() / scales.size();
    std::vector<std::int8_t> rounded;
    rounded.reserve(values.size());
    for (std::size_t i = 0; i < values.size(); ++i) {
      using Limits = std::numeric_limits<std::int8_t>;
      rounded.push_back(
          static_cast<std::int8_t>(std::clamp(std::nearbyint(values[i] * scales[i / length]),
                                              float{Limits::min()}, float{Limits::max()})));
    }
    return parameter_as(desc, memory(plain(dims, memory::data_type::s8), engine_, rounded.data()));
  }

  /// One step of a layer with weights and bias.
  template <typename Primitive, typename Description>
  void add_weighted(const Description& primitive, const memory::dims& weights,
                    const Arithmetic& arithmetic, std::span<const Tensor> parameters) {
    const memory source = current_as(primitive.src_desc(), arithmetic.source_scale);
    const auto unscaled = parameters[1].as<float>();
    const std::vector<float> bias = kScalesBias
                                        ? arithmetic.scaled_bias(parameters[1])
                                        : std::vector<float>(unscaled.begin(), unscaled.end());
    const auto values = parameters[0].as<float>();
    current_ = memory(primitive.dst_desc(), engine_);
    Arguments arguments = {
        {DNNL_ARG_SRC, source},
        {DNNL_ARG_WEIGHTS,
         arithmetic.quantized()
             ? quantized_as(primitive.weights_desc(), weights, values, arithmetic.weight_scales)
             : parameter_as(primitive.weights_desc(), weights, values.data())},
        {DNNL_ARG_BIAS, parameter_as(primitive.bias_desc(), {weights[0]}, bias.data())},
        {DNNL_ARG_DST, current_}};
    if (arithmetic.quantized()) {
      add_scales(arguments, DNNL_ARG_WEIGHTS, engine_, arithmetic.output_scales());
    }
    steps_.push_back({Primitive(primitive), std::move(arguments)});
  }

  /// The same in several steps, each of as many output channels, in f32.
  /// @param whole    Of all of them; it says how the result lies.
  /// @param part     Of those of one step.
  /// @param weights  Dimensions of one step's.
  template <typename Primitive, typename Description>
  void add_in_parts(const Description& whole, const Description& part, const memory::dims& weights,
                    std::span<const Tensor> parameters) {
    const memory source = current_as(part.src_desc());
    const memory::desc result = part.dst_desc();
    const bool in_place = is_part_of(result, whole.dst_desc());
    current_ = memory(whole.dst_desc(), engine_);
    auto* const begin = static_cast<std::byte*>(current_.get_data_handle());
    const std::span<const float> values = parameters[0].as<float>();
    const std::span<const float> biases = parameters[1].as<float>();
    const auto channels = static_cast<std::size_t>(weights[0]);
    const std::size_t steps = biases.size() / channels;
    for (std::size_t i = 0; i < steps; ++i) {
      const memory to = in_place ? memory(result, engine_, begin + i * result.get_size())
                                 : memory(result, engine_);
      steps_.push_back(
          {Primitive(part),
           {{DNNL_ARG_SRC, source},
            {DNNL_ARG_WEIGHTS,
             parameter_as(part.weights_desc(), weights, &values[i * (values.size() / steps)])},
            {DNNL_ARG_BIAS, parameter_as(part.bias_desc(), {weights[0]}, &biases[i * channels])},
            {DNNL_ARG_DST, to}}});
      if (!in_place) {
        // Channels-last: they lie between those of other parts.
        memory::dims offsets(dims_of(result).size(), 0);
        offsets[1] = static_cast<memory::dim>(i * channels);
        const memory place(whole.dst_desc().submemory_desc(dims_of(result), offsets), engine_,
                           begin);
        add_reorder(to, place);
      }
      steps_.back().ends_slice = true;
    }
  }

  void add_conv(const dnn::Conv2dRelu& op, const Arithmetic& arithmetic,
                std::span<const Tensor> parameters, int parts) {
    dnn::Conv2dRelu some = op;
    some.shape.out_c /= parts;
    const dnn::ConvShape& s = some.shape;
    const auto whole = describe(op, batch_, arithmetic, engine_);
    const memory::dims weights = {s.out_c, s.in_c, s.k_h, s.k_w};
    if (parts == 1) {
      return add_weighted<dnnl::convolution_forward>(whole, weights, arithmetic, parameters);
    }
    add_in_parts<dnnl::convolution_forward>(whole, describe(some, batch_, arithmetic, engine_),
                                            weights, parameters);
  }

  void add_pool(const dnn::MaxPool& op) {
    // Pooling plain channels one by one took 4.5 ms for pool1 where channels-last takes 0.5 with
    // both changes of layout (oneDNN 2.6, AVX2); after a convolution the activation is blocked
    // already and stays so.
    const memory::dims source_dims = {batch_, op.channels, op.in_h, op.in_w};
    const memory source = current_.get_desc() == plain(source_dims)
                              ? current_as({source_dims, kF32, Format::nhwc})
                              : current_;
    const auto primitive = describe_max_pool(engine_, source.get_desc(),
                                             any({batch_, op.channels, op.out_h(), op.out_w()}),
                                             {op.stride, op.stride}, {op.size, op.size});
    current_ = memory(primitive.dst_desc(), engine_);
    steps_.push_back(
        {dnnl::pooling_forward(primitive), {{DNNL_ARG_SRC, source}, {DNNL_ARG_DST, current_}}});
  }

  void add_fully_connected(const dnn::FullyConnected& op, const Arithmetic& arithmetic,
                           std::span<const Tensor> parameters, int parts) {
    // After a convolution or a pool the activation keeps its three dimensions, and the weights are
    // laid out to fit.
    const memory::dims source = dims_of(current_.get_desc());
    memory::dims weights = source;
    dnn::FullyConnected some = op;
    some.out /= parts;
    weights[0] = some.out;
    const auto whole = describe(op, source, arithmetic, engine_);
    if (parts == 1) {
      add_weighted<dnnl::inner_product_forward>(whole, weights, arithmetic, parameters);
    } else {
      add_in_parts<dnnl::inner_product_forward>(whole, describe(some, source, arithmetic, engine_),
                                                weights, parameters);
    }
    if (op.activation == dnn::Activation::kSoftmax) add_softmax();
  }

  /// In place.
  void add_softmax() {
    const auto primitive = describe_softmax(engine_, current_.get_desc(), 1);
    steps_.push_back(
        {dnnl::softmax_forward(primitive), {{DNNL_ARG_SRC, current_}, {DNNL_ARG_DST, current_}}});
  }

  int batch_;
  dnnl::engine engine_;
  dnnl::stream stream_;
  std::vector<PrimitiveCall> steps_;
  memory input_, output_;  ///< The host's tensors, plain.
  memory current_;         ///< Output of the last step added.
};

std::unique_ptr<Kernel> make_layer(const Workload& workload, std::span<const Tensor> parameters,
                                   const std::shared_ptr<BandTeam>&) {
  auto kernel = std::make_unique<DnnKernel>(workload.batch);
  kernel->begin(workload.inputs[0]);
  kernel->add(workload, parameters);
  kernel->end(workload.outputs[0]);
  return kernel;
}

std::unique_ptr<Kernel> make_fully_connected(const Workload& workload,
                                             std::span<const Tensor> parameters,
                                             const std::shared_ptr<BandTeam>& team) {
  return workload.precision == Precision::kInt8 && workload.batch == 1
             ? make_int8_product(workload, parameters, team)
             : make_layer(workload, parameters, team);
}

std::unique_ptr<Kernel> make_sequence(const Workload& workload, std::span<const Tensor> parameters,
                                      const std::shared_ptr<BandTeam>&) {
  auto kernel = std::make_unique<DnnKernel>(workload.batch);
  kernel->begin(workload.inputs[0]);
  for (const auto& layer : operation_as<dnn::Sequence>(workload).layers) {
    kernel->add(layer, parameters.first(layer.parameters.size()),
                dnn::parts_of(layer, workload.batch));
    parameters = parameters.subspan(layer.parameters.size());
  }
  kernel->end(workload.outputs[0]);
  return kernel;
}

constexpr std::array<CpuKernelEntry, 4> kDnnKernels = {{{"conv2d_relu", make_layer},
                                                        {"max_pool", make_layer},
                                                        {"fully_connected", make_fully_connected},
                                                        {"sequence", make_sequence}}};

}  // namespace

std::span<const CpuKernelEntry> dnn_kernels() { return kDnnKernels; }

}  // namespace pirt::cpu
