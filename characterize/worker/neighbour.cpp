#include "characterize/worker/neighbour.h"

#include <algorithm>
#include <array>
#include <exception>
#include <latch>
#include <memory>
#include <stop_token>

#include "workloads/base/system/affinity.h"
#include "workloads/base/system/caches.h"
#include "workloads/base/system/thread.h"

namespace pirt {
namespace {

constexpr std::size_t kLineBytes = 64;
constexpr std::int64_t kLeastStreamed = std::int64_t{32} << 20;

void stream(const std::stop_token& stop, std::vector<char>& bytes) {
  constexpr std::size_t kBetweenLooks = std::size_t{1} << 18;
  for (std::size_t at = 0; !stop.stop_requested(); at = (at + kBetweenLooks) % bytes.size()) {
    const std::size_t end = std::min(at + kBetweenLooks, bytes.size());
    for (std::size_t i = at; i < end; i += kLineBytes) ++bytes[i];
  }
}

void compute(const std::stop_token& stop) {
  constexpr int kBetweenLooks = 20'000;
  std::array<float, 64> sums{};
  volatile float kept = 0;
  while (!stop.stop_requested()) {
    for (int i = 0; i < kBetweenLooks; ++i) {
      for (float& sum : sums) sum = sum * 0.999F + 0.5F;
    }
    kept = sums[0];
  }
  static_cast<void>(kept);
}

}  // namespace

Neighbour::Neighbour(const std::vector<int>& cores, Work work) {
  // The threads', too: who is not started keeps nobody waiting.
  struct Start {
    explicit Start(std::size_t threads)
        : begun(static_cast<std::ptrdiff_t>(threads)), failures(threads) {}
    std::latch begun;
    std::vector<std::exception_ptr> failures;
  };
  const auto start = std::make_shared<Start>(cores.size());
  for (std::size_t i = 0; i < cores.size(); ++i) {
    threads_.push_back(start_thread([core = cores[i], work, start, i](const std::stop_token& stop) {
      std::vector<char> bytes;
      try {
        bind_to_cores({&core, 1}, "neighbour");
        if (work == Work::kStreams) {
          const std::int64_t own = own_cache_bytes({&core, 1}).value_or(0);
          bytes.assign(static_cast<std::size_t>(std::max(kLeastStreamed, 2 * own)), 1);
        }
      } catch (...) {
        start->failures[i] = std::current_exception();
      }
      start->begun.count_down();
      if (start->failures[i] != nullptr) return;
      if (work == Work::kStreams) {
        stream(stop, bytes);
      } else {
        compute(stop);
      }
    }));
  }
  start->begun.wait();
  for (const auto& failure : start->failures) {
    if (failure != nullptr) std::rethrow_exception(failure);
  }
}

}  // namespace pirt
