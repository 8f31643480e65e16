// Host tensors: what workloads take and give. Dense, row-major, aligned to a cache line, or a page
// where they have one, owned, or shared with another tensor where somebody asks for that.
#pragma once

#include <cassert>
#include <cstddef>
#include <cstdint>
#include <functional>
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

/// What a value may be, ends included.
struct Range {
  double low = 0, high = 0;
};

struct TensorSpec {
  std::string name;
  Element element = Element::kF32;
  std::vector<std::int64_t> shape;  ///< Slowest dimension first; all extents >= 1.
  /// The slowest dimension is a capacity; each tensor says how many of its rows it has.
  bool varies = false;
  /// Of all its values, or one for each column (of the fastest dimension); empty = any that is a
  /// number. Two specs are the same whatever these say.
  std::vector<Range> ranges = {};

  [[nodiscard]] std::int64_t count() const;       ///< Of the capacity.
  [[nodiscard]] std::int64_t size_bytes() const;  ///< Of the capacity.
  /// "image u8[480,640]", "corners f32[<=500,2]"
  [[nodiscard]] std::string describe() const;
  friend bool operator==(const TensorSpec& a, const TensorSpec& b) {
    return a.name == b.name && a.element == b.element && a.shape == b.shape && a.varies == b.varies;
  }
};

/// Where the memory of tensors can come from besides the host's heap: such as a device reads and
/// writes at once. Any thread.
class TensorMemory {
 public:
  virtual ~TensorMemory() = default;
  /// Whole cache lines, mostly aligned to a page; whoever lets go of it last gives it back, also
  /// after this is gone. Null where there is no more: the heap has some.
  [[nodiscard]] virtual std::shared_ptr<std::byte> take(std::size_t size_bytes) = 0;
  /// Whether it is memory of this.
  [[nodiscard]] virtual bool holds(const std::byte* data) const = 0;
};

class Tensor {
 public:
  Tensor() = default;
  /// Zeroed; every page touched.
  /// @param memory  Null = the heap.
  explicit Tensor(TensorSpec spec, TensorMemory* memory = nullptr);
  Tensor(Tensor&&) = default;
  Tensor& operator=(Tensor&&) = default;

  /// Over memory of somebody else's, such as the picture in a camera driver's buffer, which is not
  /// copied. Nobody may write to it until it is released, and no task may write to the tensor.
  /// @param data     spec.size_bytes() bytes, aligned to kAlignment. Where it is not aligned to a
  ///                 page, or its last cache line has bytes of others, a driver may copy.
  /// @param release  Called once, when the last tensor that shares it lets go, from whichever
  ///                 thread does; must not throw, and not wait for tasks. Empty = nobody has to
  ///                 know.
  /// @throws Error{kBadInput} if it is null or not aligned; it is not released then.
  [[nodiscard]] static Tensor over(TensorSpec spec, const std::byte* data,
                                   std::function<void()> release = {});
  /// Of every tensor's memory: kernels read it by vectors.
  static constexpr std::size_t kAlignment = 64;

  [[nodiscard]] const TensorSpec& spec() const { return spec_; }
  /// Elements of the capacity.
  [[nodiscard]] std::int64_t count() const { return spec_.count(); }
  [[nodiscard]] std::int64_t dim(std::size_t axis) const { return spec_.shape[axis]; }

  /// Another tensor of the same elements, not of copies: whoever shares one says who may write.
  [[nodiscard]] Tensor share() const;
  /// Whether another tensor has the same elements. Others may let go of them at any time.
  [[nodiscard]] bool is_shared() const { return data_.use_count() > 1; }

  /// How many of its rows (entries of the slowest dimension) the tensor has: all, unless the spec
  /// varies and somebody said otherwise. What lies behind them means nothing.
  [[nodiscard]] std::int64_t rows() const { return rows_; }
  /// @param rows  0 to shape[0].
  /// @throws std::logic_error for others, and where the spec does not vary.
  void set_rows(std::int64_t rows);
  /// Elements of the rows that it has.
  [[nodiscard]] std::int64_t used_count() const;

  [[nodiscard]] std::byte* data() { return data_.get(); }
  [[nodiscard]] const std::byte* data() const { return data_.get(); }
  [[nodiscard]] std::span<const std::byte> bytes() const {
    return {data(), static_cast<std::size_t>(spec_.size_bytes())};
  }
  /// Of the rows that it has: what a transfer has to move.
  [[nodiscard]] std::span<const std::byte> used_bytes() const {
    return bytes().first(static_cast<std::size_t>(used_count()) * pirt::size_bytes(spec_.element));
  }

  /// All of the capacity.
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
  /// The rows that it has.
  template <typename T>
  [[nodiscard]] std::span<T> used() {
    return as<T>().first(static_cast<std::size_t>(used_count()));
  }
  template <typename T>
  [[nodiscard]] std::span<const T> used() const {
    return as<T>().first(static_cast<std::size_t>(used_count()));
  }

 private:
  TensorSpec spec_;
  std::int64_t rows_ = 0;
  std::shared_ptr<std::byte> data_;
};

/// @param memory  As of Tensor.
[[nodiscard]] std::vector<Tensor> make_tensors(std::span<const TensorSpec> specs,
                                               TensorMemory* memory = nullptr);

/// The first value of the rows that it has that is no number, or out of the spec's ranges, in one
/// line: what comes from outside is judged before anything computes with it. Empty = none.
[[nodiscard]] std::string out_of_range(const Tensor& tensor);

/// Elements and rows of @p from. The specs are the same, but for their names.
/// @throws std::logic_error if they are not.
void copy_tensor(const Tensor& from, Tensor& to);
[[nodiscard]] std::vector<Tensor> copy_tensors(std::span<const Tensor> tensors);

}  // namespace pirt
