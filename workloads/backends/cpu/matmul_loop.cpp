// oneDNN's matrix products as candidates for the peaks: it knows instructions that no loop here is
// written in.
#include <fmt/core.h>

#include <array>
#include <cmath>
#include <cstring>

#include "workloads/backends/cpu/onednn.h"
#include "workloads/backends/cpu/peak_loops.h"
#include "workloads/backends/cpu/threads.h"
#include "workloads/base/math/peak_math.h"

namespace pirt::cpu {
namespace {

using dnnl::memory;

/// Large enough for a library's blocking to pay, small enough to stay in caches.
constexpr int kSize = 768;
/// Elements that verify() computes anew, one to a stretch of the result.
constexpr int kChecked = 64;

/// C = A * B, [kSize, kSize] each, with values that sum exactly whatever the order: small integers.
template <typename A, typename B, typename C>
class MatmulPeak final : public PeakLoop {
 public:
  MatmulPeak(PeakKind kind, memory::data_type a, memory::data_type b, memory::data_type c,
             int threads)
      : kind_(kind),
        threads_(threads),
        engine_(dnnl::engine::kind::cpu, 0),
        stream_(engine_),
        a_(desc(a), engine_),
        b_(desc(b), engine_),
        c_(desc(c), engine_),
        matmul_(describe_matmul(engine_, desc(a), desc(b), desc(c))) {
    for (int i = 0; i < kSize * kSize; ++i) {
      const auto at = static_cast<std::uint64_t>(i);
      static_cast<A*>(a_.get_data_handle())[i] = static_cast<A>(hash_u64(1, at) % 16);
      static_cast<B*>(b_.get_data_handle())[i] =
          static_cast<B>(static_cast<int>(hash_u64(2, at) % 16) - 8);
    }
  }

  [[nodiscard]] PeakKind kind() const override { return kind_; }
  [[nodiscard]] std::string variant() const override {
    return fmt::format("oneDNN matrix product of {0} x {0}", kSize);
  }
  [[nodiscard]] double work() const override { return 2.0 * kSize * kSize * kSize; }

  void run(int repeats) override {
    set_openmp_threads(threads_);
    // What an earlier run left must not pass for this one's result.
    std::memset(c_.get_data_handle(), 0xFF, sizeof(C) * kSize * kSize);
    for (int r = 0; r < repeats; ++r) {
      matmul_.execute(stream_, {{DNNL_ARG_SRC, a_}, {DNNL_ARG_WEIGHTS, b_}, {DNNL_ARG_DST, c_}});
    }
    stream_.wait();
  }

  [[nodiscard]] Verdict verify() const override {
    const auto* const a = static_cast<const A*>(a_.get_data_handle());
    const auto* const b = static_cast<const B*>(b_.get_data_handle());
    const auto* const c = static_cast<const C*>(c_.get_data_handle());
    for (int n = 0; n < kChecked; ++n) {
      const auto at = static_cast<int>(hash_u64(3, static_cast<std::uint64_t>(n)) %
                                       (std::uint64_t{kSize} * kSize));
      std::int64_t expected = 0;
      for (int k = 0; k < kSize; ++k) {
        expected += static_cast<std::int64_t>(a[at / kSize * kSize + k]) *
                    static_cast<std::int64_t>(b[k * kSize + at % kSize]);
      }
      if (c[at] == static_cast<C>(expected)) continue;
      return {.ok = false,
              .detail = fmt::format("element {} is {} instead of {}", at, c[at], expected)};
    }
    return {.ok = true, .detail = fmt::format("{} elements are exact", kChecked)};
  }

 private:
  static memory::desc desc(memory::data_type type) {
    return {{kSize, kSize}, type, memory::format_tag::ab};
  }

  PeakKind kind_;
  int threads_;
  dnnl::engine engine_;
  dnnl::stream stream_;
  memory a_, b_, c_;
  dnnl::matmul matmul_;
};

}  // namespace

std::unique_ptr<PeakLoop> make_matmul_loop(PeakKind kind, int threads) {
  using Element = memory::data_type;
  set_openmp_threads(threads);
  if (kind == PeakKind::kF32) {
    return std::make_unique<MatmulPeak<float, float, float>>(kind, Element::f32, Element::f32,
                                                             Element::f32, threads);
  }
  return std::make_unique<MatmulPeak<std::uint8_t, std::int8_t, std::int32_t>>(
      kind, Element::u8, Element::s8, Element::s32, threads);
}

}  // namespace pirt::cpu
