// Host tensors: what workloads take and give. Dense, row-major, 64-byte aligned, owned.
#pragma once

#include <cassert>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace pirt {

enum class Element : std::uint8_t { kU8, kI16, kI32, kF32, kF64 };

[[nodiscard]] std::string_view to_string(Element element);
[[nodiscard]] std::size_t size_bytes(Element element);

template <typename T>
[[nodiscard]] constexpr Element element_of() {
  if constexpr (std::is_same_v<T, std::uint8_t>)
    return Element::kU8;
  else if constexpr (std::is_same_v<T, std::int16_t>)
    return Element::kI16;
  else if constexpr (std::is_same_v<T, std::int32_t>)
    return Element::kI32;
  else if constexpr (std::is_same_v<T, float>)
    return Element::kF32;
  else {
    static_assert(std::is_same_v<T, double>);
    return Element::kF64;
  }
}

struct TensorSpec {
  std::string name;
  Element element = Element::kF32;
  std::vector<std::int64_t> shape;  ///< Slowest dimension first; all extents >= 1.

  [[nodiscard]] std::int64_t count() const;
  [[nodiscard]] std::int64_t size_bytes() const;
  /// "image u8[480,640]"
  [[nodiscard]] std::string describe() const;
  friend bool operator==(const TensorSpec&, const TensorSpec&) = default;
};

class Tensor {
 public:
  Tensor() = default;
  /// Zeroed; every page touched.
  explicit Tensor(TensorSpec spec);

  [[nodiscard]] const TensorSpec& spec() const { return spec_; }
  [[nodiscard]] std::int64_t count() const { return spec_.count(); }
  [[nodiscard]] std::int64_t dim(std::size_t axis) const { return spec_.shape[axis]; }

  [[nodiscard]] std::byte* data() { return data_.get(); }
  [[nodiscard]] const std::byte* data() const { return data_.get(); }
  [[nodiscard]] std::span<const std::byte> bytes() const {
    return {data(), static_cast<std::size_t>(spec_.size_bytes())};
  }

  template <typename T>
  [[nodiscard]] std::span<T> as() {
    assert(element_of<T>() == spec_.element);
    return {reinterpret_cast<T*>(data()), static_cast<std::size_t>(count())};
  }
  template <typename T>
  [[nodiscard]] std::span<const T> as() const {
    assert(element_of<T>() == spec_.element);
    return {reinterpret_cast<const T*>(data()), static_cast<std::size_t>(count())};
  }

 private:
  struct Free {
    void operator()(std::byte* p) const;
  };
  TensorSpec spec_;
  std::unique_ptr<std::byte[], Free> data_;
};

[[nodiscard]] std::vector<Tensor> make_tensors(std::span<const TensorSpec> specs);

}  // namespace pirt
