// What scheduler/runtime/threads.h is where the runtime is simulated: the same names, each of whose
// operations is a place where the world may hand on to another thread. What may happen at any time
// does now and then: waking up for no reason, a weak exchange that fails. What a std::stop_callback
// calls must make none of these steps: its end would wait for it outside of the world.
#pragma once

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <exception>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <stop_token>
#include <system_error>
#include <type_traits>
#include <utility>

#include "tests/scheduler/simulation/world.h"
#include "workloads/base/error.h"
#include "workloads/base/system/thread.h"
#include "workloads/base/time.h"

namespace pirt::runtime {

/// Where a world is, at that; elsewhere a thread is alone.
[[nodiscard]] inline bool now_and_then(std::uint64_t times) {
  auto* const world = simulated::World::here();
  return world != nullptr && world->once_in(times);
}

template <typename T>
class Atomic {
 public:
  constexpr Atomic() = default;
  constexpr Atomic(T value) : value_(value) {}  // NOLINT: as std::atomic.
  Atomic(const Atomic&) = delete;
  Atomic& operator=(const Atomic&) = delete;

  using Order = std::memory_order;
  static constexpr Order kInOrder = std::memory_order_seq_cst;
  [[nodiscard]] T load(Order order = kInOrder) const { return at_step().load(order); }
  operator T() const { return load(); }  // NOLINT
  void store(T value, Order order = kInOrder) { at_step().store(value, order); }
  T operator=(T value) {  // NOLINT
    store(value);
    return value;
  }
  T exchange(T value, Order order = kInOrder) { return at_step().exchange(value, order); }
  bool compare_exchange_strong(T& expected, T wanted) {
    return at_step().compare_exchange_strong(expected, wanted);
  }
  bool compare_exchange_weak(T& expected, T wanted) {
    if (!now_and_then(16)) return compare_exchange_strong(expected, wanted);
    expected = load();
    return false;
  }
  T fetch_add(T more, Order order = kInOrder) { return at_step().fetch_add(more, order); }
  T fetch_sub(T less, Order order = kInOrder) { return at_step().fetch_sub(less, order); }
  T fetch_or(T bits, Order order = kInOrder) { return at_step().fetch_or(bits, order); }
  T operator++() { return fetch_add(1) + 1; }
  T operator--() { return fetch_sub(1) - 1; }

  /// Sleeps if it is that value, with no step between.
  void sleep_if(T value, std::optional<Nanos> until) const {
    auto* const world = simulated::World::here();
    if (value_.load() != value || world == nullptr || now_and_then(32)) return;
    world->wait(this, until);
  }

 private:
  const std::atomic<T>& at_step() const {
    simulated::step();
    return value_;
  }
  std::atomic<T>& at_step() {
    simulated::step();
    return value_;
  }
  std::atomic<T> value_ = {};
};

class Mutex {
 public:
  constexpr Mutex() = default;
  Mutex(const Mutex&) = delete;
  Mutex& operator=(const Mutex&) = delete;

  void lock() {
    simulated::step();
    while (locked_) simulated::World::here()->wait(this);
    locked_ = true;
  }
  void unlock() {
    leave();
    simulated::step();
  }
  /// Without a step.
  void leave() {
    locked_ = false;
    if (auto* const world = simulated::World::here()) world->wake(this, 1);
  }

 private:
  bool locked_ = false;
};

class Condition {
 public:
  using Lock = std::unique_lock<Mutex>;
  using Time = std::chrono::steady_clock::time_point;

  void notify_all() { simulated::wake(this, INT32_MAX); }
  void wait(Lock& lock) { sleep(lock, {}); }
  template <typename Done>
  void wait(Lock& lock, Done done) {
    while (!done()) sleep(lock, {});
  }
  void wait_until(Lock& lock, Time until) { sleep(lock, until.time_since_epoch()); }
  template <typename Done>
  bool wait_for(Lock& lock, Nanos most, Done done) {
    const Nanos until = later_by(simulated::now(), most);
    while (!done()) {
      if (simulated::now() >= until) return done();
      sleep(lock, until);
    }
    return true;
  }

 private:
  void sleep(Lock& lock, std::optional<Nanos> until) {
    lock.mutex()->leave();
    if (!now_and_then(32)) simulated::World::here()->wait(this, until);
    lock.mutex()->lock();
  }
};

class LiveClock final : public Clock {
 public:
  [[nodiscard]] Nanos now() const override {
    simulated::step();
    return simulated::now();
  }
};

/// As std::jthread.
class Thread {
 public:
  Thread() = default;
  Thread(std::shared_ptr<simulated::SimThread> thread, std::stop_source stop)
      : thread_(std::move(thread)), stop_(std::move(stop)) {}
  Thread(Thread&& other) noexcept = default;
  Thread& operator=(Thread&& other) noexcept {
    end();
    thread_ = std::move(other.thread_);
    stop_ = std::move(other.stop_);
    return *this;
  }
  ~Thread() { end(); }
  bool request_stop() { return stop_.request_stop(); }
  [[nodiscard]] bool joinable() const { return thread_ != nullptr; }
  void join() {
    simulated::World::here()->join(*thread_);
    thread_ = nullptr;
  }
  void detach() { thread_ = nullptr; }

 private:
  void end() {
    if (!joinable()) return;
    static_cast<void>(request_stop());
    join();
  }
  std::shared_ptr<simulated::SimThread> thread_;
  std::stop_source stop_{std::nostopstate};
};

template <typename Body>
[[nodiscard]] Thread start_thread(Body&& body) {
  const std::stop_source stop;
  auto shared = std::make_shared<std::decay_t<Body>>(std::forward<Body>(body));
  const auto run = [shared = std::move(shared), token = stop.get_token()] {
    try {
      if constexpr (std::is_invocable_v<Body&, std::stop_token>) {
        (*shared)(token);
      } else {
        (*shared)();
      }
    } catch (const std::exception& error) {
      simulated::World::here()->fail(std::string("a thread has ended early: ") + error.what());
    }
  };
  try {
    return {simulated::World::here()->start(run), stop};
  } catch (const std::system_error& error) {
    throw_environment("cannot start a thread: " + error.code().message());
  }
}

using FutexWord = Atomic<std::uint32_t>;

inline void futex_wait(FutexWord& word, std::uint32_t value, Nanos most = Nanos::max()) {
  simulated::step();
  word.sleep_if(value, later_by(simulated::now(), most));
}

inline void futex_wake(FutexWord& word, int sleepers) { simulated::wake(&word, sleepers); }

}  // namespace pirt::runtime
