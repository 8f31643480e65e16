#include "characterize/worker/reread.h"

#include <array>
#include <cstring>
#include <thread>

#include "workloads/base/error.h"
#include "workloads/base/system/affinity.h"
#include "workloads/base/system/caches.h"
#include "workloads/base/system/control_groups.h"

namespace pirt {
namespace {

using std::chrono::microseconds;
using std::chrono::milliseconds;

constexpr std::array<SleepPlan, 5> kPlans = {{{Nanos(0), 20},
                                              {microseconds(100), 20},
                                              {milliseconds(1), 20},
                                              {milliseconds(10), 20},
                                              {milliseconds(100), 20}}};
constexpr std::int64_t kPartOfLast = 8;

std::int64_t last_of(const std::vector<int>& cores) {
  const auto bytes = reached_cache_bytes(cores);
  if (!bytes) throw_environment("the machine does not say how much its caches hold");
  return *bytes;
}

}  // namespace

bool Reread::possible(const std::vector<int>& cores) {
  const auto bytes = reached_cache_bytes(cores);
  return bytes && *bytes <= most_filled_bytes();
}

std::span<const SleepPlan> Reread::plans() { return kPlans; }

Reread::Reread(std::vector<int> cores)
    : cores_(std::move(cores)),
      memory_(static_cast<std::size_t>(last_of(cores_) / kPartOfLast)),
      sweep_(cores_, last_of(cores_)) {
  std::memset(memory_.as<std::byte>(), 1, memory_.size_bytes());  // what is untouched has no bytes
}

Nanos Reread::read() const {
  const MachineClock clock;
  const Nanos begin = clock.now();
  const auto* const words = memory_.as<std::uint64_t>();
  const std::size_t count = memory_.size_bytes() / sizeof(std::uint64_t);
  // Four sums: additions must not wait for each other, only for memory.
  std::array<std::uint64_t, 4> sums{};
  for (std::size_t word = 0; word + 4 * kLineWords <= count; word += 4 * kLineWords) {
    for (std::size_t i = 0; i < sums.size(); ++i) sums[i] += words[word + i * kLineWords];
  }
  volatile std::uint64_t kept = sums[0] + sums[1] + sums[2] + sums[3];
  static_cast<void>(kept);
  return clock.now() - begin;
}

std::vector<Nanos> Reread::after(const SleepPlan& plan) {
  const CoresRestored restored;
  bind_to_cores({cores_.data(), 1}, "reread");
  std::vector<Nanos> times;
  static_cast<void>(read());
  for (int i = 0; i < plan.samples; ++i) {
    if (plan.sleep > Nanos(0)) std::this_thread::sleep_for(plan.sleep);
    times.push_back(read());
  }
  return times;
}

std::vector<Nanos> Reread::cold(int samples) {
  std::vector<Nanos> times;
  for (int i = 0; i < samples; ++i) {
    sweep_.run();
    const CoresRestored restored;
    bind_to_cores({cores_.data(), 1}, "reread");
    times.push_back(read());
  }
  return times;
}

}  // namespace pirt
