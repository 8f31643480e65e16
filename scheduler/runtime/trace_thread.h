// A trace is written by a thread of its own: whoever runs something live leaves what happened, as a
// few numbers, and goes on; the text is made of it elsewhere, and is in the file a tenth of a
// second later at most.
//
// Threads: what an observer hears may come from any thread, one at a time. Memory is bounded: who
// is more than some thousands of events ahead of the writer waits for it.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <exception>
#include <memory>
#include <memory_resource>
#include <mutex>
#include <span>
#include <type_traits>
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
    note([=](TraceWriter& writer) { writer.submitted(task, pipeline, position, firing); });
  }
  void arrived(std::size_t servers_index, std::uint32_t job, double power_w) override {
    note([=](TraceWriter& writer) { writer.arrived(servers_index, job, power_w); });
  }
  void departed(std::size_t servers_index, std::uint32_t job) override {
    note([=](TraceWriter& writer) { writer.departed(servers_index, job); });
  }
  void draws(std::size_t servers_index, std::uint32_t job, double power_w) override {
    note([=](TraceWriter& writer) { writer.draws(servers_index, job, power_w); });
  }
  void drawing(std::size_t servers_index, double by_w) override {
    note([=](TraceWriter& writer) { writer.drawing(servers_index, by_w); });
  }
  void preparing(TaskId task, Nanos now, Nanos takes) override {
    note([=](TraceWriter& writer) { writer.preparing(task, now, takes); });
  }
  void settled(Nanos now, std::span<const int> waiting) override;

  /// Until the writer has heard all. Nothing may be told afterwards.
  /// @throws What the writer threw.
  void finish();

 private:
  /// The thread writes when there are so many events, or a while after the first.
  static constexpr std::size_t kWakes = 4096;

  /// What the writer is told of something that happened.
  struct Event {
    void (*tell)(const void* what, TraceWriter& writer);
    const void* what;
  };
  /// In order, and behind each all that it shows.
  struct Batch {
    std::vector<Event> events;
    std::pmr::monotonic_buffer_resource memory{std::size_t{1} << 16U};
  };

  /// The mutex, once there is room for another event: what follows is with it.
  [[nodiscard]] std::unique_lock<runtime::Mutex> room();
  /// A copy as long as the batch is there.
  template <typename T>
  std::span<T> keep(std::span<const T> from) {
    static_assert(std::is_trivially_destructible_v<T>);  // Nobody destroys it.
    T* const copy = std::pmr::polymorphic_allocator<T>(&filling_->memory).allocate(from.size());
    std::uninitialized_copy(from.begin(), from.end(), copy);
    return {copy, from.size()};
  }
  /// @param tell  void(TraceWriter&): shows what is kept alone.
  template <typename Tell>
  void add(const Tell& tell) {
    const auto call = [](const void* what, TraceWriter& writer) {
      (*static_cast<const Tell*>(what))(writer);
    };
    filling_->events.push_back({call, keep(std::span<const Tell>(&tell, 1)).data()});
    const std::size_t size = filling_->events.size();
    if (size == 1 || size == kWakes) changed_.notify_all();
  }
  template <typename Tell>
  void note(const Tell& tell) {
    const auto lock = room();
    add(tell);
  }
  void write();
  void stop();

  TraceWriter& writer_;
  std::exception_ptr failure_;  ///< Of the thread until it is joined.
  runtime::Mutex mutex_;
  runtime::Condition changed_;
  std::array<Batch, 2> batches_;
  Batch* filling_ = &batches_[0];
  bool stopping_ = false;
  runtime::Thread thread_;  ///< Last: it uses all of it.
};

}  // namespace pirt
