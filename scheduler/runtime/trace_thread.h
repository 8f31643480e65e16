// A trace is written by a thread of its own: whoever runs something live leaves what happened, as a
// few numbers, and goes on; the text is made of it elsewhere, and is in the file a tenth of a
// second later at most.
//
// Threads: what an observer hears may come from any thread, one at a time. Memory is bounded: who
// is more than some thousands of events ahead of the writer waits for it.
#pragma once

#include <exception>
#include <mutex>
#include <tuple>
#include <variant>
#include <vector>

#include "scheduler/runtime/threads.h"
#include "scheduler/trace/trace_writer.h"

namespace pirt {

class TraceThread final : public DispatcherObserver, public RunObserver {
 public:
  /// @param writer  Hears, on the thread, all that this hears and in the same order; nobody else
  /// may use it until finish() or the end.
  /// @param cores   As begin_thread.
  /// @throws Error{kEnvironment} if the thread cannot be started.
  explicit TraceThread(TraceWriter& writer, std::vector<int> cores = {});
  ~TraceThread();
  TraceThread(const TraceThread&) = delete;
  TraceThread& operator=(const TraceThread&) = delete;

  void on_input(const DispatcherInput& input, const Answer& answer) override;
  void submitted(TaskId task, std::size_t pipeline, std::size_t position,
                 std::uint64_t firing) override {
    note(&RunObserver::submitted, task, pipeline, position, firing);
  }
  void arrived(std::size_t servers_index, std::uint32_t job, double power_w) override {
    note(&RunObserver::arrived, servers_index, job, power_w);
  }
  void departed(std::size_t servers_index, std::uint32_t job) override {
    note(&RunObserver::departed, servers_index, job);
  }
  void drawing(std::size_t servers_index, double by_w) override {
    note(&RunObserver::drawing, servers_index, by_w);
  }
  void preparing(TaskId task, Nanos now, Nanos takes) override {
    note(&RunObserver::preparing, task, now, takes);
  }
  void settled(Nanos now, std::span<const int> waiting) override;

  /// Until the writer has heard all. Nothing may be told afterwards.
  /// @throws What the writer threw.
  void finish();

 private:
  struct Input {
    DispatcherInput input;  ///< Of tasks and decisions only the number counts.
    Answer answer;
  };
  /// Something that an observer was told, with all that it shows.
  template <typename... Args>
  struct Told {
    void (RunObserver::*what)(Args...);
    std::tuple<Args...> args;
  };
  struct Settled {
    Nanos now;
    std::size_t waiting;
  };
  using Event =
      std::variant<Input, Settled, Told<TaskId, std::size_t, std::size_t, std::uint64_t>,
                   Told<std::size_t, std::uint32_t, double>, Told<std::size_t, std::uint32_t>,
                   Told<std::size_t, double>, Told<TaskId, Nanos, Nanos>>;
  /// Events in order, and what they show, each kind in order too. Keeps its memory.
  struct Batch {
    std::vector<Event> events;
    std::vector<Task> tasks;  ///< Of their predecessors and series only the number counts.
    std::vector<TaskId> after;
    std::vector<std::uint32_t> after_own;
    std::vector<SeriesId> reads;
    Effects effects;
    std::vector<int> waiting;
    void clear();
  };
  class Teller;

  [[nodiscard]] std::unique_lock<runtime::Mutex> room();
  void add(const Event& event);
  template <typename... Args>
  void note(void (RunObserver::*what)(Args...), Args... args) {
    const auto lock = room();
    add(Told<Args...>{what, {args...}});
  }
  void write();
  void stop();

  TraceWriter& writer_;
  std::exception_ptr failure_;  ///< Of the thread until it is joined.
  runtime::Mutex mutex_;
  runtime::Condition changed_;
  Batch filling_;
  bool stopping_ = false;
  runtime::Thread thread_;  ///< Last: it uses all of it.
};

}  // namespace pirt
