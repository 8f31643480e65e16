// The loops behind measured peaks beside what else reaches for the same limits: oneDNN's matrix
// product, and a plain read as STREAM would do it. Interleaved, on all cores.
//
// Usage: peaks [BACKEND]   default: cpu; e.g. opencl
#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <map>
#include <thread>

#include "characterize/worker/measure.h"
#include "workloads/backends/registry.h"
#include "workloads/base/error.h"
#include "workloads/base/math/peak_math.h"

namespace {

using pirt::Nanos;

constexpr int kRounds = 40;
constexpr Nanos kSample = std::chrono::milliseconds(4);

/// A contender and its fastest sample.
struct Contender {
  std::string name;
  pirt::PeakKind kind;
  double work;
  std::function<void(int)> run;
  int repeats = 1;
  double best_per_second = 0;
};

/// What a user would write: each thread sums its part of a vector.
class PlainRead {
 public:
  explicit PlainRead(std::size_t size_bytes) : words_(size_bytes / 4) {
    pirt::peak_math::fill_words(words_, 1);
  }
  [[nodiscard]] double work() const { return 4.0 * static_cast<double>(words_.size()); }
  void run(int repeats) {
    const std::size_t threads = std::thread::hardware_concurrency();
    std::vector<std::uint32_t> sums(threads);
    std::vector<std::jthread> team;
    for (std::size_t t = 0; t < threads; ++t) {
      team.emplace_back([&, t] {
        const std::size_t part = words_.size() / threads;
        for (int r = 0; r < repeats; ++r) {
          std::uint32_t sum = 0;
          for (std::size_t i = t * part; i < (t + 1) * part; ++i) sum += words_[i];
          sums[t] += sum;
        }
      });
    }
    team.clear();
    for (const std::uint32_t sum : sums) total_ = total_ + sum;
  }

 private:
  std::vector<std::uint32_t> words_;
  volatile std::uint32_t total_ = 0;  ///< Keeps the sums from being left out.
};

void sample(Contender& contender, const pirt::MachineClock& clock) {
  const Nanos start = clock.now();
  contender.run(contender.repeats);
  const Nanos took = clock.now() - start;
  if (took < kSample) {
    contender.repeats *= 2;
    return;
  }
  contender.best_per_second =
      std::max(contender.best_per_second, contender.work * contender.repeats / pirt::to_s(took));
}

int run(const std::string& backend) {
  const auto device =
      pirt::find_backend(backend).open({.unit = "bench", .cores = {}, .device = {}, .script = {}});
  const auto loops = device->peak_loops();
  PlainRead plain(std::size_t{128} << 20U);
  std::vector<Contender> contenders;
  for (const auto& loop : loops.loops) {
    contenders.push_back({loop->variant(), loop->kind(), loop->work(),
                          [&l = *loop](int repeats) { l.run(repeats); }});
  }
  contenders.push_back({"plain sum of a vector, threads", pirt::PeakKind::kBandwidthMemory,
                        plain.work(), [&plain](int repeats) { plain.run(repeats); }});
  const pirt::MachineClock clock;
  for (int round = 0; round < kRounds; ++round) {
    for (auto& contender : contenders) sample(contender, clock);
  }
  std::map<pirt::PeakKind, double> best;
  for (const auto& c : contenders) best[c.kind] = std::max(best[c.kind], c.best_per_second);
  fmt::print("{} on {}\n", backend, device->info().name);
  for (const auto& c : contenders) {
    fmt::print("{:17} {:60} {:8.1f} G/s {:5.2f} of the best\n", to_string(c.kind), c.name,
               c.best_per_second / 1e9, c.best_per_second / best[c.kind]);
  }
  for (const auto& [kind, why] : loops.unavailable) {
    fmt::print("{:17} unavailable: {}\n", to_string(kind), why);
  }
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  try {
    return run(argc > 1 ? argv[1] : "cpu");
  } catch (const pirt::Error& error) {
    fmt::print(stderr, "peaks: {}\n", error.what());
    return pirt::exit_code(error.code());
  }
}
