#include "characterize/worker/injection.h"

#include <fmt/core.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "workloads/base/error.h"
#include "workloads/base/text/text.h"

namespace pirt {
namespace {

double parse_factor(const std::string& text, const std::string& whole) {
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size() || !(value >= 1 && value <= 100)) {
    throw_bad_input(fmt::format(
        "'{}' in '{}' is no factor between 1 and 100; try execute=1.1 for 10 % more work", text,
        whole));
  }
  return value;
}

class SlowedKernel final : public Kernel {
 public:
  SlowedKernel(std::unique_ptr<Kernel> kernel, std::int64_t steps)
      : kernel_(std::move(kernel)), steps_(steps) {}

  void bind(std::span<const Tensor> inputs, std::span<Tensor> outputs) override {
    kernel_->bind(inputs, outputs);
  }
  void upload() override { kernel_->upload(); }
  std::optional<Nanos> stamped_launch() override { return kernel_->stamped_launch(); }
  std::optional<Nanos> execute(int repeats) override {
    const auto launch = kernel_->execute(repeats);
    ExtraWork::run(steps_ * repeats);
    return launch;
  }
  void download() override { kernel_->download(); }
  void scribble(std::byte with) override { kernel_->scribble(with); }
  [[nodiscard]] std::optional<Nanos> bound(Phase phase) const override {
    return kernel_->bound(phase);
  }
  void bind_state(std::span<const Tensor> current, std::span<Tensor> next) override {
    kernel_->bind_state(current, next);
  }
  void upload_state() override { kernel_->upload_state(); }
  void commit_state() override { kernel_->commit_state(); }

 private:
  std::unique_ptr<Kernel> kernel_;
  std::int64_t steps_;
};

}  // namespace

Injection parse_injection(const std::string& text) {
  Injection injection;
  for (const std::string& part : split(text, ',')) {
    const auto equals = part.find('=');
    const std::string step = part.substr(0, equals);
    double* factor = step == "execute"     ? &injection.execute
                     : step == "prepare"   ? &injection.prepare
                     : step == "scheduler" ? &injection.scheduler
                                           : nullptr;
    if (factor == nullptr || equals == std::string::npos) {
      throw_bad_input(fmt::format(
          "'{}' is no slowdown to inject; try execute=1.1, prepare=1.2 or scheduler=1.1", part));
    }
    *factor = parse_factor(part.substr(equals + 1), text);
  }
  return injection;
}

std::string to_string(const Injection& injection) {
  std::vector<std::string> parts;
  const auto add = [&](const char* step, double factor) {
    if (factor > 1) parts.push_back(fmt::format("{}={}", step, factor));
  };
  add("execute", injection.execute);
  add("prepare", injection.prepare);
  add("scheduler", injection.scheduler);
  return join(parts, ",");
}

ExtraWork::ExtraWork(const Clock& clock) {
  constexpr std::int64_t kSteps = 200'000;
  Nanos shortest = Nanos::max();
  for (int i = 0; i < 5; ++i) {
    const Nanos begin = clock.now();
    run(kSteps);
    shortest = std::min(shortest, clock.now() - begin);
  }
  steps_per_ns_ = kSteps / static_cast<double>(std::max<std::int64_t>(shortest.count(), 1));
}

std::int64_t ExtraWork::steps_for(Nanos time) const {
  return std::llround(steps_per_ns_ * static_cast<double>(time.count()));
}

void ExtraWork::run(std::int64_t steps) {
  std::uint64_t state = 1;
  for (std::int64_t i = 0; i < steps; ++i) {
    state = state * 6364136223846793005ULL + 1442695040888963407ULL;
    asm volatile("" : "+r"(state));  // each step needs the one before it
  }
}

std::unique_ptr<Kernel> slowed(std::unique_ptr<Kernel> kernel, double factor, const Clock& clock) {
  if (factor <= 1) return kernel;
  const ExtraWork work(clock);
  Nanos shortest = Nanos::max();
  for (int i = 0; i < 5; ++i) {
    const Nanos begin = clock.now();
    static_cast<void>(kernel->execute(1));
    shortest = std::min(shortest, clock.now() - begin);
  }
  return std::make_unique<SlowedKernel>(std::move(kernel),
                                        work.steps_for(scaled(shortest, factor - 1)));
}

}  // namespace pirt
