// One thread pinned to each core of a unit, for loops that must not share a core.
#pragma once

#include <barrier>
#include <exception>
#include <functional>
#include <mutex>
#include <thread>
#include <vector>

namespace pirt::cpu {

/// Used by one thread at a time; joins its threads when it goes.
class CoreTeam {
 public:
  /// @throws Error{kEnvironment} if not all threads can be started.
  explicit CoreTeam(const std::vector<int>& cores);
  ~CoreTeam();
  CoreTeam(const CoreTeam&) = delete;
  CoreTeam& operator=(const CoreTeam&) = delete;

  [[nodiscard]] int size() const { return static_cast<int>(threads_.size()); }
  /// Runs @p body(index) on every core at once, and waits for all. What one throws is thrown
  /// here then.
  void run(const std::function<void(int index)>& body);

 private:
  void work(int index, int core);

  std::barrier<> begin_, end_;
  const std::function<void(int)>* body_ = nullptr;  ///< Null between the barriers = stop.
  std::mutex mutex_;
  std::exception_ptr failure_;  ///< Of the run's bodies, the first.
  std::vector<std::jthread> threads_;
};

}  // namespace pirt::cpu
