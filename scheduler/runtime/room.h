// How many tasks have not ended, and who waits until there are fewer.
#pragma once

#include <atomic>
#include <condition_variable>
#include <cstddef>
#include <mutex>

namespace pirt::runtime {

/// Any thread may call it. Who leaves wakes only where somebody waits.
class Room {
 public:
  /// @param most  Tasks, at least 1. Who finds as many goes on when a quarter of them has ended.
  explicit Room(std::size_t most) : most_(most), resume_at_(most - 1 - (most - 1) / 4) {}

  /// One more.
  /// @return  False if there are as many as there may be.
  [[nodiscard]] bool try_enter() {
    if (tasks_.fetch_add(1) < most_) return true;
    tasks_.fetch_sub(1);
    return false;
  }
  /// The same, however many there are.
  void enter() { tasks_.fetch_add(1); }
  void leave() {
    const std::size_t remaining = tasks_.fetch_sub(1) - 1;
    if ((remaining <= resume_at_ && waiting_for_room_ > 0) || (remaining == 0 && waiting_ > 0))
      notify();
  }

  void wait_for_room() {
    wait(waiting_for_room_, [this] { return tasks_ <= resume_at_; });
  }
  void wait_until_empty() {
    wait(waiting_, [this] { return tasks_ == 0; });
  }
  /// Until something else has come, of which look_again tells.
  template <typename Done>
  void wait_until(const Done& done) {
    wait(waiting_, done);
  }
  void look_again() {
    if (waiting_ > 0) notify();
  }

 private:
  template <typename Done>
  void wait(std::atomic<int>& waiting, const Done& done) {
    std::unique_lock lock(mutex_);
    ++waiting;
    fewer_.wait(lock, done);
    --waiting;
  }
  void notify() {
    const std::lock_guard lock(mutex_);
    fewer_.notify_all();
  }

  const std::size_t most_, resume_at_;
  std::atomic<std::size_t> tasks_ = 0;
  std::atomic<int> waiting_ = 0;           ///< For the end of all tasks, or for something else.
  std::atomic<int> waiting_for_room_ = 0;  ///< To submit.
  std::mutex mutex_;
  std::condition_variable fewer_;
};

}  // namespace pirt::runtime
