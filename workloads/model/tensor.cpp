#include "workloads/model/tensor.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <functional>
#include <limits>
#include <new>
#include <numeric>
#include <stdexcept>
#include <type_traits>
#include <utility>

#include "workloads/base/error.h"
#include "workloads/model/ranges.h"

namespace pirt {
namespace {

constexpr std::size_t kCacheLine = Tensor::kAlignment;
constexpr std::size_t kPage = 4096;

/// Of a page where there is one: drivers that work on the host's memory copy what begins within a
/// page or ends within a cache line (Intel, OpenCL zero copy).
std::align_val_t alignment_of(std::size_t size_bytes) {
  return std::align_val_t{size_bytes < kPage ? kCacheLine : kPage};
}

std::size_t whole_lines(std::size_t size_bytes) {
  return std::max<std::size_t>((size_bytes + kCacheLine - 1) / kCacheLine, 1) * kCacheLine;
}

}  // namespace

std::string_view to_string(Element element) {
  switch (element) {
    case Element::kU8:
      return "u8";
    case Element::kI16:
      return "i16";
    case Element::kI32:
      return "i32";
    case Element::kF32:
      return "f32";
    case Element::kF64:
      return "f64";
  }
  return "?";
}

std::size_t size_bytes(Element element) {
  switch (element) {
    case Element::kU8:
      return 1;
    case Element::kI16:
      return 2;
    case Element::kI32:
    case Element::kF32:
      return 4;
    case Element::kF64:
      return 8;
  }
  return 0;
}

std::int64_t TensorSpec::count() const {
  return std::accumulate(shape.begin(), shape.end(), std::int64_t{1}, std::multiplies<>());
}

std::int64_t TensorSpec::size_bytes() const {
  return count() * static_cast<std::int64_t>(pirt::size_bytes(element));
}

std::string TensorSpec::describe() const {
  std::string text = name + " " + std::string(to_string(element)) + "[";
  for (std::size_t i = 0; i < shape.size(); ++i) {
    text += i != 0 ? "," : varies ? "<=" : "";
    text += std::to_string(shape[i]);
  }
  return text + "]";
}

Tensor::Tensor(TensorSpec spec, TensorMemory* memory)
    : spec_(std::move(spec)), rows_(spec_.shape.empty() ? 1 : spec_.shape.front()) {
  const auto bytes = static_cast<std::size_t>(spec_.size_bytes());
  if (memory != nullptr) data_ = memory->take(bytes);
  if (data_ == nullptr) {
    const std::align_val_t alignment = alignment_of(bytes);
    data_.reset(static_cast<std::byte*>(::operator new[](whole_lines(bytes), alignment)),
                [alignment](std::byte* p) { ::operator delete[](p, alignment); });
  }
  std::memset(data_.get(), 0, bytes);
}

Tensor Tensor::over(TensorSpec spec, const std::byte* data, std::function<void()> release) {
  if (data == nullptr || reinterpret_cast<std::uintptr_t>(data) % kAlignment != 0) {
    throw_bad_input(spec.describe() +
                    (data == nullptr ? " over no memory" : " over memory that is not aligned") +
                    "; a tensor needs memory aligned to " + std::to_string(kAlignment) +
                    " bytes: copy what is not into a tensor of its own");
  }
  Tensor tensor;
  tensor.spec_ = std::move(spec);
  tensor.rows_ = tensor.spec_.shape.empty() ? 1 : tensor.spec_.shape.front();
  tensor.data_ = {const_cast<std::byte*>(data), [release = std::move(release)](std::byte*) {
                    if (release) release();
                  }};
  return tensor;
}

Tensor Tensor::share() const {
  Tensor shared;
  shared.spec_ = spec_;
  shared.rows_ = rows_;
  shared.data_ = data_;
  return shared;
}

void Tensor::set_rows(std::int64_t rows) {
  if (!spec_.varies || rows < 0 || rows > spec_.shape.front()) {
    throw std::logic_error(spec_.describe() + " cannot have " + std::to_string(rows) + " rows");
  }
  rows_ = rows;
}

std::int64_t Tensor::used_count() const {
  return spec_.varies ? count() / spec_.shape.front() * rows_ : count();
}

std::vector<Tensor> make_tensors(std::span<const TensorSpec> specs, TensorMemory* memory) {
  std::vector<Tensor> tensors;
  tensors.reserve(specs.size());
  for (const auto& spec : specs) tensors.emplace_back(spec, memory);
  return tensors;
}

namespace {

/// Of the exponents' bits, without a branch: compilers make vectors of it.
template <typename T>
bool all_finite(std::span<const T> values) {
  using Bits = std::conditional_t<sizeof(T) == 4, std::uint32_t, std::uint64_t>;
  const auto exponent = std::bit_cast<Bits>(std::numeric_limits<T>::infinity());
  Bits none = 0;
  for (const T value : values) {
    none |= Bits{(std::bit_cast<Bits>(value) & exponent) == exponent};
  }
  return none == 0;
}

template <typename T>
std::string out_of_range_as(const Tensor& tensor, const std::vector<Range>& ranges) {
  const auto values = tensor.used<T>();
  if constexpr (std::is_integral_v<T>) {
    if (ranges.empty()) return "";
  } else {
    if (ranges.empty() && all_finite<T>(values)) return "";
  }
  for (std::size_t i = 0; i < values.size(); ++i) {
    const auto value = static_cast<double>(values[i]);
    const bool fits = ranges.empty() ? std::isfinite(value)
                                     : value >= ranges[i % ranges.size()].low &&
                                           value <= ranges[i % ranges.size()].high;
    if (fits) continue;
    std::string text =
        tensor.spec().describe() + ": " + std::to_string(value) + " at " + std::to_string(i);
    if (ranges.empty()) return text + " is no number";
    const Range& range = ranges[i % ranges.size()];
    return text + " is not from " + std::to_string(range.low) + " to " + std::to_string(range.high);
  }
  return "";
}

}  // namespace

std::string out_of_range(const Tensor& tensor, const TensorSpec& spec) {
  switch (tensor.spec().element) {
    case Element::kU8:
      return out_of_range_as<std::uint8_t>(tensor, spec.ranges);
    case Element::kI16:
      return out_of_range_as<std::int16_t>(tensor, spec.ranges);
    case Element::kI32:
      return out_of_range_as<std::int32_t>(tensor, spec.ranges);
    case Element::kF32:
      return out_of_range_as<float>(tensor, spec.ranges);
    case Element::kF64:
      return out_of_range_as<double>(tensor, spec.ranges);
  }
  return "";
}

std::string out_of_range(const Tensor& tensor) { return out_of_range(tensor, tensor.spec()); }

void copy_tensor(const Tensor& from, Tensor& to) {
  const TensorSpec& a = from.spec();
  const TensorSpec& b = to.spec();
  if (a.element != b.element || a.shape != b.shape || a.varies != b.varies) {
    throw std::logic_error(a.describe() + " does not fit into " + b.describe());
  }
  if (a.varies) to.set_rows(from.rows());
  const auto bytes = from.used_bytes();
  if (!bytes.empty()) std::memcpy(to.data(), bytes.data(), bytes.size());
}

std::vector<Tensor> copy_tensors(std::span<const Tensor> tensors) {
  std::vector<Tensor> copies;
  copies.reserve(tensors.size());
  for (const Tensor& tensor : tensors) {
    copies.emplace_back(tensor.spec());
    copy_tensor(tensor, copies.back());
  }
  return copies;
}

}  // namespace pirt
