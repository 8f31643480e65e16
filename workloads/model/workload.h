// What is computed, and nothing about where: tensors, operations, reference, tolerance, tags.
//
// A workload is data plus pure functions. It knows no backend; a backend looks at `kernel` and
// `operation` and says whether it has a kernel for it. Most are one call on tensors of fixed sizes;
// some have a state that goes from call to call, lists whose length varies, or inputs that come as
// a sequence.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "workloads/model/image_source.h"
#include "workloads/model/tensor.h"

namespace pirt {

/// Base of the shape records that tell a kernel what to compute (one type a kernel name; see
/// vision/ and dnn/).
struct Operation {
  virtual ~Operation() = default;
  /// Why backends other than the host's cores have no kernel for it; empty where one may have.
  [[nodiscard]] virtual std::string_view host_only() const { return {}; }
};

/// What Operation::host_only says of those that are functions of the host.
inline constexpr std::string_view kHostFunction =
    "the host's own functions, sequential, in f64 or of another library: backend cpu has them";

/// What one verification found.
struct Verdict {
  bool ok = false;
  double worst_error =
      0.0;             ///< In the unit of `detail`; how close to the tolerance the output came.
  std::string detail;  ///< One line: what was compared, worst error and where, the bound.
};

/// The tensors of one run of a workload on seeded or user-given data.
struct Data {
  std::vector<Tensor> inputs;      ///< As Workload::inputs; change with each call.
  std::vector<Tensor> parameters;  ///< As Workload::parameters; given once to `prepare`.
  std::vector<std::string> notes;  ///< E.g. "input_resized"; end up in the profile row.
};

struct DataRequest {
  std::uint64_t seed = 1;
  const ImageSource* images = nullptr;  ///< Never null when make_data is called.
  int frame = 0;                        ///< Which input of the sequence; below Workload::frames.
};

/// What a workload keeps from call to call: a filter, a map.
struct StateSpec {
  std::string name;  ///< Workloads may share a state: same name and equal tensors.
  std::vector<TensorSpec> tensors;
  friend bool operator==(const StateSpec&, const StateSpec&) = default;
};

/// One call of a played sequence, for judging it.
struct PlayedFrame {
  const Data* data = nullptr;
  std::span<const Tensor> outputs;   ///< A backend's.
  std::span<const Tensor> expected;  ///< The reference's.
};

/// What the products of a layer are computed in. Its tensors are f32 all the same: whoever computes
/// converts at both ends.
enum class Precision : std::uint8_t {
  kF32,
  kBf16,  ///< Weights and inputs rounded to bfloat16, sums in f32.
  kInt8,  ///< Weights and inputs quantized to 8 bits by fixed scales, sums in 32-bit integers.
};
/// "f32", "bf16", "int8".
[[nodiscard]] std::string_view to_string(Precision precision);

struct Workload {
  std::string name;               ///< "gaussian_blur", "conv1"; unique in the catalog.
  std::string description;        ///< One line with the sizes.
  std::vector<std::string> tags;  ///< "table1", "vision", "dnn", "image" (takes pictures).
  /// How it is computed where that is not the plain way, a name of variants() (catalog.h); empty =
  /// plain. The workload's name ends in "@<variant>" then.
  std::string variant = {};
  Precision precision = Precision::kF32;
  /// Images or activations a call; where above 1, all inputs and outputs have it as their leading
  /// dimension.
  int batch = 1;
  std::string kernel;  ///< Key of the backends' kernel tables, e.g. "conv2d_relu".
  std::shared_ptr<const Operation> operation;

  std::vector<TensorSpec> inputs;
  std::vector<TensorSpec> parameters;
  std::vector<TensorSpec> outputs;
  /// Absent for most: a call depends on its inputs alone.
  std::optional<StateSpec> state = std::nullopt;
  /// How many inputs the sequence has that it is measured with; parameters are those of the first.
  int frames = 1;

  /// Operations a call, 2 a multiply-add, bias and activation excluded; absent where
  /// data-dependent.
  std::optional<std::int64_t> ops;
  /// Operations of the call on these data, where they follow from them; may be empty.
  std::function<std::int64_t(const Data&)> ops_of = {};
  /// Of `ops`, those on zeros around the input, which a kernel may leave out.
  std::int64_t padding_ops = 0;
  /// Of `ops`, those that no kernel can leave out.
  [[nodiscard]] std::optional<std::int64_t> needed_ops() const;
  /// Bytes a call has to move at least: inputs + parameters + outputs, each once, weights as they
  /// are stored in `precision`, and the state, which is read and written. Lists count as full.
  [[nodiscard]] std::int64_t bytes() const;
  /// The same of one call, with the rows that its tensors have.
  /// @param outputs  As Workload::outputs, in whatever type of element.
  [[nodiscard]] std::int64_t bytes(const Data& data, std::span<const Tensor> outputs) const;

  [[nodiscard]] bool has_tag(std::string_view tag) const;
  /// Whether it is measured by playing a sequence; the others repeat one call.
  [[nodiscard]] bool is_played() const { return frames > 1 || state.has_value(); }

  /// The same for pictures of another size, where it is made for them; its name stays. Empty where
  /// it is not. @throws Error{kBadInput} for a size that it cannot have.
  std::function<Workload(int width, int height)> at_size = {};

  /// Inputs and parameters, a pure function of the request; non-constant, every page touched.
  std::function<Data(const DataRequest&)> make_data;
  /// The definition: plain double precision or exact integers, written for clarity. Integer outputs
  /// have the outputs' element type; floating-point outputs come as f64. Same shapes as `outputs`.
  /// Empty if there is a state.
  std::function<std::vector<Tensor>(const Data&)> reference;
  /// The definition of one call of a workload with a state, which it advances: tensors as
  /// state->tensors, whose values it takes and leaves. Empty if there is none.
  std::function<std::vector<Tensor>(std::span<Tensor> state, const Data&)> step = {};
  /// The state before the first call, a constant; empty if there is none.
  std::function<std::vector<Tensor>()> make_state = {};
  /// Compares a backend's outputs of one call with the reference's. NaN is never ok.
  std::function<Verdict(std::span<const Tensor> outputs, std::span<const Tensor> expected)> verify;
  /// Judges a whole sequence by a measure of the workload with a bound; empty = `verify` on each
  /// call. NaN is never ok.
  std::function<Verdict(std::span<const PlayedFrame> sequence)> judge = {};
};

/// The reference's outputs of a sequence of calls, one element a frame; with a state from its
/// initial value on.
[[nodiscard]] std::vector<std::vector<Tensor>> reference_of(const Workload& workload,
                                                            std::span<const Data> frames);

/// By Workload::judge, or else by `verify` on each frame: the first that fails, or else the one
/// that came closest to failing; says which.
[[nodiscard]] Verdict verify_sequence(const Workload& workload,
                                      std::span<const PlayedFrame> sequence);

/// The operation as the type that kernel @p T expects.
/// @throws std::logic_error if it is another one: a kernel table and a workload disagree.
template <typename T>
[[nodiscard]] const T& operation_as(const Workload& workload) {
  const auto* operation = dynamic_cast<const T*>(workload.operation.get());
  if (operation == nullptr) {
    throw std::logic_error("kernel '" + workload.kernel + "' does not compute what '" +
                           workload.name + "' is");
  }
  return *operation;
}

/// A verify function for integer outputs: as many rows, and every element equal.
[[nodiscard]] Verdict verify_exact(std::span<const Tensor> outputs,
                                   std::span<const Tensor> expected);

/// A verify function for f32 or f64 outputs against f64: as many rows, and |out - ref| <=
/// relative_to_peak * max|ref|, for each tensor.
[[nodiscard]] std::function<Verdict(std::span<const Tensor>, std::span<const Tensor>)> verify_close(
    double relative_to_peak);
/// For outputs of both kinds: as verify_close where f64 is expected, else as verify_exact.
[[nodiscard]] std::function<Verdict(std::span<const Tensor>, std::span<const Tensor>)> verify_mixed(
    double relative_to_peak);

}  // namespace pirt
