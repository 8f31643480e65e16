// What all workloads share: their counters and the two ways of comparing outputs with a reference.
#include "workloads/model/workload.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <optional>

namespace pirt {
namespace {

std::int64_t total_bytes(std::span<const TensorSpec> specs) {
  return std::transform_reduce(specs.begin(), specs.end(), std::int64_t{0}, std::plus<>(),
                               [](const TensorSpec& spec) { return spec.size_bytes(); });
}

/// Of a layer's parameters, weights have two dimensions or more; a bias has one and stays f32.
std::int64_t parameter_bytes(const TensorSpec& spec, Precision precision) {
  const bool weights = spec.element == Element::kF32 && spec.shape.size() >= 2;
  if (!weights || precision == Precision::kF32) return spec.size_bytes();
  return spec.count() * (precision == Precision::kBf16 ? 2 : 1);
}

/// "[y,x]" of a flat position.
std::string position(const TensorSpec& spec, std::int64_t flat) {
  std::vector<std::int64_t> indices;
  for (auto extent = spec.shape.rbegin(); extent != spec.shape.rend(); ++extent) {
    indices.push_back(flat % *extent);
    flat /= *extent;
  }
  std::ranges::reverse(indices);
  return fmt::format("[{}]", fmt::join(indices, ","));
}

Verdict failure(std::string detail) {
  return {false, std::numeric_limits<double>::infinity(), std::move(detail)};
}

/// Whether the two lists can be compared at all; if not, why.
std::optional<Verdict> mismatch(std::span<const Tensor> outputs, std::span<const Tensor> expected) {
  if (outputs.size() != expected.size()) {
    return failure(
        fmt::format("{} outputs where {} are expected", outputs.size(), expected.size()));
  }
  for (std::size_t i = 0; i < outputs.size(); ++i) {
    if (outputs[i].spec().shape != expected[i].spec().shape) {
      return failure(fmt::format("output {} has another shape than {}",
                                 outputs[i].spec().describe(), expected[i].spec().describe()));
    }
    if (outputs[i].rows() != expected[i].rows()) {
      return failure(fmt::format("output {} has {} rows where {} are expected",
                                 outputs[i].spec().describe(), outputs[i].rows(),
                                 expected[i].rows()));
    }
  }
  return std::nullopt;
}

template <typename T>
Verdict compare_exact(const Tensor& output, const Tensor& expected) {
  const auto got = output.used<T>();
  const auto want = expected.used<T>();
  std::int64_t differing = 0;
  std::int64_t worst = 0;
  std::size_t worst_at = 0;
  for (std::size_t i = 0; i < got.size(); ++i) {
    const std::int64_t error = std::abs(std::int64_t{got[i]} - std::int64_t{want[i]});
    differing += error != 0 ? 1 : 0;
    if (error > worst) {
      worst = error;
      worst_at = i;
    }
  }
  const auto& name = output.spec().name;
  if (differing == 0) return {true, 0.0, fmt::format("{}: all {} equal", name, got.size())};
  return {false, static_cast<double>(worst),
          fmt::format("{}: {} of {} differ, the worst by {} at {}: got {}, expected {}", name,
                      differing, got.size(), worst,
                      position(output.spec(), static_cast<std::int64_t>(worst_at)), got[worst_at],
                      want[worst_at])};
}

Verdict compare_exact_any(const Tensor& output, const Tensor& expected) {
  if (output.spec().element != expected.spec().element) {
    return failure(fmt::format("output {} has another type than {}", output.spec().describe(),
                               expected.spec().describe()));
  }
  switch (output.spec().element) {
    case Element::kU8:
      return compare_exact<std::uint8_t>(output, expected);
    case Element::kI16:
      return compare_exact<std::int16_t>(output, expected);
    case Element::kI32:
      return compare_exact<std::int32_t>(output, expected);
    case Element::kF32:
    case Element::kF64:
      break;
  }
  return failure(fmt::format("output {} is not of integers", output.spec().describe()));
}

/// @tparam T  Of the output.
template <typename T>
Verdict compare_close(const Tensor& output, const Tensor& expected, double relative_to_peak) {
  const auto got = output.used<T>();
  const auto want = expected.used<double>();
  if (got.empty()) return {true, 0.0, fmt::format("{}: both have no rows", output.spec().name)};
  double peak = 0.0;
  for (const double value : want) peak = std::max(peak, std::abs(value));
  double worst = 0.0;
  std::size_t worst_at = 0;
  for (std::size_t i = 0; i < got.size(); ++i) {
    if (!std::isfinite(got[i]) || !std::isfinite(want[i])) {
      return failure(fmt::format("{}: {} at {}, expected {:.7g}", output.spec().name, got[i],
                                 position(output.spec(), static_cast<std::int64_t>(i)), want[i]));
    }
    const double error = std::abs(static_cast<double>(got[i]) - want[i]);
    if (error > worst) {
      worst = error;
      worst_at = i;
    }
  }
  const double relative = worst == 0.0 ? 0.0 : worst / peak;
  return {worst <= relative_to_peak * peak, relative,
          fmt::format("{}: worst error {:.3g} of the peak {:.4g} at {} (got {:.7g}, expected "
                      "{:.7g}), bound {:.3g}",
                      output.spec().name, relative, peak,
                      position(output.spec(), static_cast<std::int64_t>(worst_at)), got[worst_at],
                      want[worst_at], relative_to_peak)};
}

Verdict compare_close_any(const Tensor& output, const Tensor& expected, double relative_to_peak) {
  const Element element = output.spec().element;
  if (expected.spec().element == Element::kF64) {
    if (element == Element::kF32) return compare_close<float>(output, expected, relative_to_peak);
    if (element == Element::kF64) return compare_close<double>(output, expected, relative_to_peak);
  }
  return failure(fmt::format("output {} against {}: f32 or f64 against f64 is expected",
                             output.spec().describe(), expected.spec().describe()));
}

/// Compares pairwise; the verdict is the first failing one, or else the one that came closest to
/// failing.
template <typename Compare>
Verdict compare_all(std::span<const Tensor> outputs, std::span<const Tensor> expected,
                    const Compare& compare) {
  if (auto wrong = mismatch(outputs, expected)) return *wrong;
  Verdict closest{true, 0.0, "nothing to compare"};
  for (std::size_t i = 0; i < outputs.size(); ++i) {
    Verdict verdict = compare(outputs[i], expected[i]);
    if (!verdict.ok) return verdict;
    if (i == 0 || verdict.worst_error > closest.worst_error) closest = std::move(verdict);
  }
  return closest;
}

}  // namespace

std::string_view to_string(Precision precision) {
  switch (precision) {
    case Precision::kF32:
      return "f32";
    case Precision::kBf16:
      return "bf16";
    case Precision::kInt8:
      return "int8";
  }
  return "";
}

std::int64_t Workload::bytes() const {
  std::int64_t bytes = total_bytes(inputs) + total_bytes(outputs);
  for (const TensorSpec& spec : parameters) bytes += parameter_bytes(spec, precision);
  if (state) bytes += 2 * total_bytes(state->tensors);
  return bytes;
}

std::int64_t Workload::bytes(const Data& data, std::span<const Tensor> given) const {
  std::int64_t saved = 0;  // Of the capacities.
  const auto add = [&saved](std::span<const Tensor> tensors, std::span<const TensorSpec> specs) {
    for (std::size_t i = 0; i < specs.size(); ++i) {
      const TensorSpec& spec = specs[i];
      if (spec.varies)
        saved += spec.size_bytes() / spec.shape[0] * (spec.shape[0] - tensors[i].rows());
    }
  };
  add(data.inputs, inputs);
  add(given, outputs);
  return bytes() - saved;
}

std::optional<std::int64_t> Workload::needed_ops() const {
  if (!ops) return std::nullopt;
  return *ops - padding_ops;
}

bool Workload::has_tag(std::string_view tag) const {
  return std::ranges::find(tags, tag) != tags.end();
}

std::vector<std::vector<Tensor>> reference_of(const Workload& workload,
                                              std::span<const Data> frames) {
  std::vector<std::vector<Tensor>> expected;
  std::vector<Tensor> state;
  if (workload.state) state = workload.make_state();
  for (const Data& data : frames) {
    expected.push_back(workload.state ? workload.step(state, data) : workload.reference(data));
  }
  return expected;
}

Verdict verify_sequence(const Workload& workload, std::span<const PlayedFrame> sequence) {
  if (workload.judge) return workload.judge(sequence);
  Verdict closest{true, 0.0, "nothing to compare"};
  for (std::size_t i = 0; i < sequence.size(); ++i) {
    Verdict verdict = workload.verify(sequence[i].outputs, sequence[i].expected);
    if (sequence.size() > 1) {
      verdict.detail = fmt::format("frame {} of {}: {}", i + 1, sequence.size(), verdict.detail);
    }
    if (!verdict.ok) return verdict;
    if (i == 0 || verdict.worst_error > closest.worst_error) closest = std::move(verdict);
  }
  return closest;
}

Verdict verify_exact(std::span<const Tensor> outputs, std::span<const Tensor> expected) {
  return compare_all(outputs, expected, compare_exact_any);
}

std::function<Verdict(std::span<const Tensor>, std::span<const Tensor>)> verify_close(
    double relative_to_peak) {
  return [relative_to_peak](std::span<const Tensor> outputs, std::span<const Tensor> expected) {
    return compare_all(outputs, expected, [=](const Tensor& output, const Tensor& want) {
      return compare_close_any(output, want, relative_to_peak);
    });
  };
}

std::function<Verdict(std::span<const Tensor>, std::span<const Tensor>)> verify_mixed(
    double relative_to_peak) {
  return [relative_to_peak](std::span<const Tensor> outputs, std::span<const Tensor> expected) {
    return compare_all(outputs, expected, [=](const Tensor& output, const Tensor& want) {
      return want.spec().element == Element::kF64
                 ? compare_close_any(output, want, relative_to_peak)
                 : compare_exact_any(output, want);
    });
  };
}

int picture_index(std::uint64_t seed) {
  constexpr std::uint64_t kPictures = std::numeric_limits<int>::max();
  return static_cast<int>((seed + kPictures - 1) % kPictures);
}

}  // namespace pirt
