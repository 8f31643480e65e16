// What is computed, and nothing about where: tensors, operations, reference, tolerance, tags.
//
// A workload is data plus three pure functions. It knows no backend; a backend looks at `kernel`
// and `operation` and says whether it has a kernel for it.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

#include "workloads/images.h"
#include "workloads/tensor.h"

namespace pirt {

/// Base of the shape records that tell a kernel what to compute (one type a kernel name; see
/// vision/ and dnn/).
struct Operation {
  virtual ~Operation() = default;
};

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

  /// Operations a call, 2 a multiply-add, bias and activation excluded; absent where
  /// data-dependent.
  std::optional<std::int64_t> ops;
  /// Of `ops`, those on zeros around the input, which a kernel may leave out.
  std::int64_t padding_ops = 0;
  /// Of `ops`, those that no kernel can leave out.
  [[nodiscard]] std::optional<std::int64_t> needed_ops() const;
  /// Bytes a call has to move at least: inputs + parameters + outputs, each once, weights as they
  /// are stored in `precision`.
  [[nodiscard]] std::int64_t bytes() const;

  [[nodiscard]] bool has_tag(std::string_view tag) const;

  /// Inputs and parameters, a pure function of the request; non-constant, every page touched.
  std::function<Data(const DataRequest&)> make_data;
  /// The definition: plain double precision or exact integers, written for clarity. Integer outputs
  /// have the outputs' element type; floating-point outputs come as f64. Same shapes as `outputs`.
  std::function<std::vector<Tensor>(const Data&)> reference;
  /// Compares a backend's outputs with the reference's. NaN is never ok.
  std::function<Verdict(std::span<const Tensor> outputs, std::span<const Tensor> expected)> verify;
};

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

/// A verify function for integer outputs: every element equal.
[[nodiscard]] Verdict verify_exact(std::span<const Tensor> outputs,
                                   std::span<const Tensor> expected);

/// A verify function for f32 outputs against f64: |out - ref| <= relative_to_peak * max|ref| for
/// each tensor.
[[nodiscard]] std::function<Verdict(std::span<const Tensor>, std::span<const Tensor>)> verify_close(
    double relative_to_peak);

}  // namespace pirt
