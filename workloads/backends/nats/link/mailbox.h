// What the one thread that drives a state machine is told, by any others: in order, each with
// whatever it needs. Its wall time is read here and nowhere else of the driver.
#pragma once

#include <algorithm>
#include <condition_variable>
#include <deque>
#include <functional>
#include <mutex>
#include <utility>

#include "workloads/base/time.h"

namespace pirt::cloud {

class Mailbox {
 public:
  using Letter = std::function<void()>;

  /// Any thread. After close() it is dropped.
  void post(Letter letter) {
    {
      const std::lock_guard lock(mutex_);
      if (closed_) return;
      letters_.push_back(std::move(letter));
    }
    changed_.notify_one();
  }
  void close() {
    {
      const std::lock_guard lock(mutex_);
      closed_ = true;
    }
    changed_.notify_all();
  }
  /// The next one, or none at time @p until, of MachineClock. @return  Whether it is still open.
  [[nodiscard]] bool next(Nanos until, Letter& letter) {
    std::unique_lock lock(mutex_);
    const Nanos left = std::min<Nanos>(until - std::min(until, clock_.now()), kLongest);
    changed_.wait_for(lock, left, [this] { return closed_ || !letters_.empty(); });
    letter = nullptr;
    if (letters_.empty()) return !closed_;
    letter = std::move(letters_.front());
    letters_.pop_front();
    return true;
  }
  [[nodiscard]] Nanos now() const { return clock_.now(); }

 private:
  static constexpr Nanos kLongest = std::chrono::hours(1);
  MachineClock clock_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<Letter> letters_;
  bool closed_ = false;
};

}  // namespace pirt::cloud
