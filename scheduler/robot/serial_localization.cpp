#include <algorithm>
#include <numeric>
#include <thread>
#include <utility>

#include "scheduler/robot/localization.h"

namespace pirt {
namespace {

constexpr Nanos kLook = std::chrono::milliseconds(50);

Nanos steps_of(const slam::FrameResult& frame) {
  return std::accumulate(frame.stage_time.begin(), frame.stage_time.end(), Nanos::zero());
}

class SerialLocalization {
 public:
  SerialLocalization(const Sequence& sequence, LocalizationOptions options)
      : sequence_(sequence), options_(std::move(options)) {}

  LocalizationResult run() {
    slam::RunOptions run;
    run.setup = options_.setup;
    run.clock = &clock_;
    run.start = std::move(options_.start);
    run.spoil = options_.spoil;
    run.next = [this](std::size_t frame) { return next(frame); };
    run.seen = [this](std::size_t frame, const slam::State& state, const GreyImage& image,
                      const slam::FrameResult& seen) {
      if (options_.show && frame >= *options_.show) {
        result_.shown = slam::show(state, image);
        options_.show.reset();
      }
      done_ = clock_.now();
      result_.latencies.push_back(options_.own_rate ? done_ - arrived_ : steps_of(seen));
    };
    begin_ = clock_.now();
    result_.run = slam::run_serially(sequence_, run);
    result_.duration = options_.own_rate ? done_ - first_
                                         : std::accumulate(result_.latencies.begin(),
                                                           result_.latencies.end(), Nanos::zero());
    result_.stopped = stops() > 0;
    return std::move(result_);
  }

 private:
  [[nodiscard]] int stops() const { return options_.stops ? options_.stops() : 0; }
  [[nodiscard]] Nanos due(std::size_t frame) const {
    return begin_ + (sequence_.frames[frame].time - sequence_.frames.front().time);
  }

  slam::Next next(std::size_t frame) {
    while (options_.own_rate && stops() == 0 && clock_.now() < due(frame)) {
      std::this_thread::sleep_for(std::min(due(frame) - clock_.now(), kLook));
    }
    if (stops() > 0) return slam::Next::kStop;
    const bool late =
        options_.own_rate && frame + 1 < sequence_.frames.size() && clock_.now() >= due(frame + 1);
    arrived_ = options_.own_rate ? due(frame) : clock_.now();
    if (result_.arrived++ == 0) first_ = arrived_;
    if (!late) return slam::Next::kTake;
    ++result_.dropped;
    return slam::Next::kDrop;
  }

  const Sequence& sequence_;
  LocalizationOptions options_;
  MachineClock clock_;
  Nanos begin_{0}, first_{0}, arrived_{0}, done_{0};
  LocalizationResult result_;
};

}  // namespace

LocalizationResult localize_serially(const Sequence& sequence, LocalizationOptions options) {
  return SerialLocalization(sequence, std::move(options)).run();
}

}  // namespace pirt
