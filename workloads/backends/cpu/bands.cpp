#include "workloads/backends/cpu/bands.h"

#include <algorithm>
#include <functional>
#include <opencv2/core.hpp>

#include "workloads/base/system/thread.h"
#include "workloads/recognition/opencv_threads.h"

namespace pirt::cpu {
namespace {

/// Turns to wait awake before sleeping: kernels of some ten microseconds follow each other, and
/// waking up takes as long. Each gives its core to whoever else wants it.
constexpr int kTurnsAwake = 200;

/// Returns when @p value is no longer @p old. @param is  Compares two of them.
template <typename T, typename Is>
void wait_while(const std::atomic<T>& value, T old, const Is& is) {
  for (int turn = 0; turn < kTurnsAwake; ++turn) {
    if (!is(value.load(std::memory_order_acquire), old)) return;
    std::this_thread::yield();
  }
  value.wait(old, std::memory_order_acquire);
}

/// These rows as a picture of its own, of which no function sees that there are others.
cv::Mat picture(const cv::Mat& of, const cv::Range& rows) {
  const auto* first = of.ptr(rows.start);
  // OpenCV has no view of constant memory; inputs are only read.
  return {rows.size(), of.cols, of.type(), const_cast<uchar*>(first), of.step};
}

Mats parts(const Mats& of, const cv::Range& rows) {
  Mats all;
  for (const cv::Mat& each : of) all.push_back(each.rowRange(rows));
  return all;
}

}  // namespace

BandTeam::BandTeam(int threads) {
  try {
    for (int i = 1; i < threads; ++i) workers_.push_back(start_thread([this] { work(); }));
  } catch (...) {
    end();
    throw;
  }
}

/// The workers end, and are joined as members.
void BandTeam::end() {
  ending_ = true;
  State next = state_;
  ++next.round;
  state_ = next;
  state_.notify_all();
}

void BandTeam::run(int parts, const std::function<void(int)>& body) {
  recognition::compute_on_calling_thread();  // Whoever else uses OpenCV may have set another count.
  if (parts <= 1 || workers_.empty()) {
    for (int part = 0; part < parts; ++part) body(part);
    return;
  }
  body_ = &body;
  failure_ = nullptr;
  done_ = 0;
  state_ = State{
      .round = state_.load().round + 1, .parts = static_cast<std::uint16_t>(parts), .taken = 0};
  state_.notify_all();
  take_parts();
  for (int done = done_; done < parts; done = done_) wait_while(done_, done, std::equal_to<>());
  if (failure_) std::rethrow_exception(failure_);
}

void BandTeam::work() {
  const auto same = [](State a, State b) {
    return a.round == b.round && a.parts == b.parts && a.taken == b.taken;
  };
  while (true) {
    const State seen = take_parts();
    // After the state that it goes by: whoever has seen the last one sees this too.
    if (ending_) return;
    wait_while(state_, seen, same);
  }
}

/// Does parts until none is left to take; the state that said so.
BandTeam::State BandTeam::take_parts() {
  State state = state_;
  while (state.taken < state.parts) {
    State next = state;
    ++next.taken;
    // Taken, a part keeps its run from ending, so that body_ is that run's.
    if (!state_.compare_exchange_weak(state, next)) continue;
    do_part(state.taken);
    if (++done_ == next.parts) done_.notify_one();
    state = state_;
  }
  return state;
}

void BandTeam::do_part(int part) {
  try {
    (*body_)(part);
  } catch (...) {
    const std::lock_guard guard(mutex_);
    if (!failure_) failure_ = std::current_exception();
  }
}

cv::Mat Band::surroundings(const cv::Mat& input) const { return picture(input, around); }

cv::Mat Band::alone(const cv::Mat& input) const { return picture(input, rows); }

cv::Mat Band::part(const cv::Mat& input) const {
  return surroundings(input).rowRange(rows.start - around.start, rows.end - around.start);
}

void for_bands(BandTeam& team, int rows, Halo halo, const std::function<void(const Band&)>& body) {
  const int bands = std::min(rows, team.size());
  const auto cut = [&](int band) {
    return static_cast<int>(std::int64_t{rows} * band / std::max(bands, 1));
  };
  team.run(bands, [&](int index) {
    const cv::Range own(cut(index), cut(index + 1));
    body({.rows = own,
          .around = {std::max(own.start - halo.rows(), 0), std::min(own.end + halo.rows(), rows)}});
  });
}

void filter_in_bands(BandTeam& team, const cv::Mat& input, Mats& outputs, Halo halo,
                     const std::function<void(const cv::Mat&, Mats&)>& filter) {
  const int h = halo.rows();
  /// @p rows of the output, from @p seen of the input.
  const auto repair = [&](const cv::Range& rows, const cv::Range& seen) {
    Mats scratch;
    for (const cv::Mat& each : outputs) scratch.emplace_back(seen.size(), each.cols, each.type());
    filter(picture(input, seen), scratch);
    const cv::Range within(rows.start - seen.start, rows.end - seen.start);
    for (std::size_t i = 0; i < outputs.size(); ++i) {
      scratch[i].rowRange(within).copyTo(outputs[i].rowRange(rows));
    }
  };
  for_bands(team, input.rows, halo, [&](const Band& band) {
    const auto [begin, end] = std::pair(band.rows.start, band.rows.end);
    Mats own = parts(outputs, band.rows);
    filter(picture(input, band.rows), own);
    if (h == 0) return;
    if (begin > 0) {
      const cv::Range rows(begin, std::min(begin + h, end));
      repair(rows, {band.around.start, std::min(rows.end + h, input.rows)});
    }
    if (end < input.rows) {
      const cv::Range rows(std::max(end - h, begin), end);
      repair(rows, {std::max(rows.start - h, 0), band.around.end});
    }
  });
}

}  // namespace pirt::cpu
