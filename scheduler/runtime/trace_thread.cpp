#include "scheduler/runtime/trace_thread.h"

#include <chrono>
#include <utility>

#include "scheduler/runtime/begin_thread.h"

namespace pirt {
namespace {

/// The thread writes when there are so many, or when so much time has passed since the first: a
/// crash costs no more. It never wakes for nothing.
constexpr std::chrono::milliseconds kLatest(100);
constexpr std::size_t kWakes = 4096;
/// So many there are before whoever has more waits for it.
constexpr std::size_t kMost = 4 * kWakes;

template <typename To, typename From>
void append(std::vector<To>& to, const From& from) {
  to.insert(to.end(), from.begin(), from.end());
}

}  // namespace

void TraceThread::Batch::clear() {
  events.clear();
  tasks.clear();
  after.clear();
  after_own.clear();
  reads.clear();
  effects.clear();
  waiting.clear();
}

/// Tells the writer what is in a batch.
class TraceThread::Teller {
 public:
  Teller(Batch& batch, TraceWriter& writer) : batch_(batch), writer_(writer) {}

  void tell() {
    for (const Event& event : batch_.events) std::visit(*this, event);
  }
  void operator()(const Input& event) {
    const auto tasks = take(batch_.tasks, tasks_, event.input.tasks.size());
    for (Task& task : tasks) {
      task.after = take(batch_.after, after_, task.after.size());
      task.after_own = take(batch_.after_own, after_own_, task.after_own.size());
      task.reads = take(batch_.reads, reads_, task.reads.size());
    }
    DispatcherInput input = event.input;
    input.tasks = tasks;
    Effects& effects = batch_.effects;
    Answer answer = event.answer;
    answer.submitted = take(effects.submitted, submitted_, answer.submitted.size());
    answer.started = take(effects.started, started_, answer.started.size());
    answer.ended = take(effects.ended, ended_, answer.ended.size());
    answer.suspended = take(effects.suspended, suspended_, answer.suspended.size());
    answer.resumed = take(effects.resumed, resumed_, answer.resumed.size());
    writer_.on_input(input, answer);
  }
  template <typename... Args>
  void operator()(const Told<Args...>& event) {
    std::apply([&](Args... args) { (writer_.*event.what)(args...); }, event.args);
  }
  void operator()(const Settled& event) {
    writer_.settled(event.now, take(batch_.waiting, waiting_, event.waiting));
  }

 private:
  /// The next ones.
  template <typename T>
  static std::span<T> take(std::vector<T>& all, std::size_t& at, std::size_t count) {
    return std::span(all).subspan(std::exchange(at, at + count), count);
  }

  Batch& batch_;
  TraceWriter& writer_;
  std::size_t tasks_ = 0, after_ = 0, after_own_ = 0, reads_ = 0, submitted_ = 0, started_ = 0;
  std::size_t ended_ = 0, suspended_ = 0, resumed_ = 0, waiting_ = 0;
};

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
  Batch batch;
  std::unique_lock lock(mutex_);
  while (true) {
    changed_.wait(lock, [this] { return stopping_ || !filling_.events.empty(); });
    changed_.wait_for(lock, kLatest,
                      [this] { return stopping_ || filling_.events.size() >= kWakes; });
    if (filling_.events.empty()) return;
    std::swap(batch, filling_);
    lock.unlock();
    changed_.notify_all();
    try {
      if (failure_ == nullptr) {
        Teller(batch, writer_).tell();
        writer_.flush();
      }
    } catch (...) {
      failure_ = std::current_exception();
    }
    batch.clear();
    lock.lock();
  }
}

/// With the mutex, after what the event shows.
void TraceThread::add(const Event& event) {
  filling_.events.push_back(event);
  if (filling_.events.size() == 1 || filling_.events.size() == kWakes) changed_.notify_all();
}

void TraceThread::on_input(const DispatcherInput& input, const Answer& answer) {
  const auto lock = room();
  append(filling_.tasks, input.tasks);
  for (const Task& task : input.tasks) {
    append(filling_.after, task.after);
    append(filling_.after_own, task.after_own);
    append(filling_.reads, task.reads);
  }
  append(filling_.effects.submitted, answer.submitted);
  append(filling_.effects.started, answer.started);
  append(filling_.effects.ended, answer.ended);
  append(filling_.effects.suspended, answer.suspended);
  append(filling_.effects.resumed, answer.resumed);
  add(Input{input, answer});
}

void TraceThread::settled(Nanos now, std::span<const int> waiting) {
  const auto lock = room();
  append(filling_.waiting, waiting);
  add(Settled{now, waiting.size()});
}

/// The mutex, once there is room for another event.
std::unique_lock<runtime::Mutex> TraceThread::room() {
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [this] { return filling_.events.size() < kMost; });
  return lock;
}

}  // namespace pirt
