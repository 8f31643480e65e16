// Threads of a program, of which one runs at a time: a seed says which, and for how long. Time is
// made up: it moves a little with each step, and to the next event when all threads wait.
//
// It sees interleavings, not memory order: what a thread writes, the others see at once. What goes
// wrong ends the process with a line on standard error that says what, and exit code 1: the
// threads that are under way could not be ended otherwise.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "workloads/base/math/random.h"
#include "workloads/base/time.h"

namespace pirt::simulated {

/// One thread, of the operating system too: so it has what is its own (thread_local).
struct SimThread;

class World {
 public:
  struct Options {
    std::uint64_t seed = 1;
    bool tells = false;  ///< On standard error, who is handed on to, and what note() says.
  };
  explicit World(const Options& options);
  ~World();
  World(const World&) = delete;
  World& operator=(const World&) = delete;

  /// Runs the body, and returns when all threads that it started, and those that they did, have
  /// ended: one that never does is a failure.
  void run(const std::function<void()>& body);
  /// A hash of all that was decided: the same seed gives the same.
  [[nodiscard]] std::uint64_t trail() const { return trail_; }
  /// Is asked what there is to say where something goes wrong.
  void explain_by(std::function<std::string()> explain) { explain_ = std::move(explain); }
  /// Threads that are started from now on are refused so often, after the first @p after.
  void refuse_threads(int after, int times);

  /// That of the calling thread; null = it is in none, and nothing is simulated.
  static World* here();

  // Of the threads of a world.

  [[nodiscard]] Nanos now() const { return now_; }
  /// A place where another thread may go on.
  void step();
  void sleep_until(Nanos until);
  /// Sleeps until woken by that address, or @p until has come.
  void wait(const void* on, std::optional<Nanos> until = {});
  /// Those that sleep there, @p most of them, drawn; they go on later.
  void wake(const void* on, int most);
  /// Now and then, by the seed: what may happen at any time, such as waking up for no reason.
  bool once_in(std::uint64_t times) { return random_.below(times) == 0; }
  /// @throws std::system_error if the world refuses it.
  std::shared_ptr<SimThread> start(std::function<void()> body);
  void join(SimThread& thread);

  /// What happens, for whoever follows.
  void note(const std::string& what);
  [[noreturn]] void fail(const std::string& what);

 private:
  void list_runnable();
  SimThread* choose();
  void pass_to(SimThread* next, bool waits);
  void release_due();
  void draw_next_event();
  [[nodiscard]] std::string who_waits() const;

  Random random_;
  std::function<std::string()> explain_;
  bool tells_;
  Nanos now_{1'000'000'000};
  Nanos tick_{0};
  Nanos next_due_ = Nanos::max();
  std::uint64_t switch_one_in_ = 0, stall_one_in_ = 0;
  bool by_priority_ = false;
  std::int64_t until_event_ = 0;
  std::int64_t steps_ = 0;
  std::uint64_t trail_ = 0;
  int refuse_after_ = 0, refuse_times_ = 0;
  std::vector<std::shared_ptr<SimThread>> threads_;  ///< Those that have not ended.
  std::vector<SimThread*> runnable_;                 ///< For its memory.
  SimThread* running_ = nullptr;
  std::uint64_t started_ = 0;
};

/// As World's, and nothing outside of one.
inline void step() {
  if (World* const world = World::here()) world->step();
}
void wake(const void* on, int most);
void sleep_for(Nanos time);
[[nodiscard]] Nanos now();

}  // namespace pirt::simulated
