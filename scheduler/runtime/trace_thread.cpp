#include "scheduler/runtime/trace_thread.h"

#include <chrono>
#include <utility>

#include "scheduler/runtime/begin_thread.h"

namespace pirt {
namespace {

/// After the first: a crash costs no more. It never wakes for nothing.
constexpr std::chrono::milliseconds kLatest(100);

}  // namespace

TraceThread::TraceThread(TraceWriter& writer, std::vector<int> cores)
    : writer_(writer), thread_(runtime::start_thread([this, cores = std::move(cores)] {
        runtime::begin_thread("pirt-trace", cores);
        write();
      })) {}

TraceThread::~TraceThread() { stop(); }

void TraceThread::stop() {
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
  }
  changed_.notify_all();
  if (thread_.joinable()) thread_.join();
}

void TraceThread::finish() {
  stop();
  if (failure_ != nullptr) std::rethrow_exception(failure_);
}

void TraceThread::write() {
  Batch* batch = &batches_[1];
  std::unique_lock lock(mutex_);
  while (true) {
    changed_.wait(lock, [this] { return stopping_ || !filling_->events.empty(); });
    changed_.wait_for(lock, kLatest,
                      [this] { return stopping_ || filling_->events.size() >= kWakes; });
    if (filling_->events.empty()) return;
    std::swap(batch, filling_);
    lock.unlock();
    changed_.notify_all();
    try {
      if (failure_ == nullptr) {
        for (const Event& each : batch->events) each.tell(each.what, writer_);
        writer_.flush();
      }
    } catch (...) {
      failure_ = std::current_exception();
    }
    batch->events.clear();
    batch->memory.release();
    lock.lock();
  }
}

void TraceThread::on_input(const DispatcherInput& input, const Answer& answer) {
  const auto lock = room();
  const std::span<Task> tasks = keep(input.tasks);
  for (Task& task : tasks) {
    task.after = keep(task.after);
    task.after_own = keep(task.after_own);
    task.reads = keep(task.reads);
  }
  DispatcherInput kept = input;
  kept.tasks = tasks;
  const Answer brought{.taken = answer.taken,
                       .submitted = keep(answer.submitted),
                       .started = keep(answer.started),
                       .ended = keep(answer.ended),
                       .suspended = keep(answer.suspended),
                       .resumed = keep(answer.resumed)};
  add([=](TraceWriter& writer) { writer.on_input(kept, brought); });
}

void TraceThread::settled(Nanos now, std::span<const int> waiting) {
  const auto lock = room();
  add([now, kept = keep(waiting)](TraceWriter& writer) { writer.settled(now, kept); });
}

std::unique_lock<runtime::Mutex> TraceThread::room() {
  constexpr std::size_t kMost = 4 * kWakes;
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [this] { return filling_->events.size() < kMost; });
  return lock;
}

}  // namespace pirt
