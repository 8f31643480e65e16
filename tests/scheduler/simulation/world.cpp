#include "tests/scheduler/simulation/world.h"

#include <fmt/format.h>
#include <linux/futex.h>
#include <pthread.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cstdio>
#include <cstdlib>
#include <system_error>
#include <thread>
#include <utility>

namespace pirt::simulated {

struct SimThread {
  enum class State : std::uint8_t { kRunnable, kWaits, kOver };
  std::uint64_t number = 0;
  std::uint64_t priority = 0;
  State state = State::kRunnable;
  const void* on = nullptr;
  Nanos until = Nanos::max();
  std::atomic<std::uint32_t> baton = 0;
  pthread_t handle{};

  [[nodiscard]] std::string name() const {
    char text[16] = "?";
    static_cast<void>(::pthread_getname_np(handle, text, sizeof text));
    return fmt::format("{} ({})", number, text);
  }
  void wait_for_baton() {
    while (baton.exchange(0) == 0) {
      ::syscall(SYS_futex, reinterpret_cast<std::uint32_t*>(&baton), FUTEX_WAIT_PRIVATE, 0, nullptr,
                nullptr, 0);
    }
  }
  void give_baton() {
    baton.store(1);
    ::syscall(SYS_futex, reinterpret_cast<std::uint32_t*>(&baton), FUTEX_WAKE_PRIVATE, 1, nullptr,
              nullptr, 0);
  }
};

namespace {

constexpr std::int64_t kMostSteps = 4'000'000;

thread_local World* world_here = nullptr;

std::uint64_t one_of(Random& random, std::initializer_list<std::uint64_t> values) {
  return values.begin()[random.below(values.size())];
}

}  // namespace

World* World::here() { return world_here; }

World::World(const Options& options)
    : random_(derive_seed(options.seed, "threads")), tells_(options.tells) {
  tick_ = Nanos(static_cast<std::int64_t>(one_of(random_, {1, 20, 100, 500})));
  switch_one_in_ = one_of(random_, {3, 8, 20, 60, 200});
  stall_one_in_ = one_of(random_, {10, 50, 1'000'000'000});
  by_priority_ = random_.below(3) == 0;
  draw_next_event();
}

World::~World() = default;

void World::refuse_threads(int after, int times) {
  refuse_after_ = after;
  refuse_times_ = times;
}

void World::run(const std::function<void()>& body) {
  auto first = std::make_shared<SimThread>();
  first->handle = ::pthread_self();
  first->number = started_++;
  threads_ = {first};
  running_ = first.get();
  world_here = this;
  body();
  while (threads_.size() > 1) wait(&threads_);
  threads_.clear();
  running_ = nullptr;
  world_here = nullptr;
}

void World::draw_next_event() {
  until_event_ = 1 + static_cast<std::int64_t>(random_.below(2 * switch_one_in_ - 1));
}

void World::step() {
  now_ += tick_;
  if (++steps_ > kMostSteps) fail("no end after many steps: " + who_waits());
  if (--until_event_ > 0) return;
  draw_next_event();
  if (now_ >= next_due_) release_due();
  if (random_.below(stall_one_in_) == 0) {
    // The operating system has something else to do with its core.
    constexpr std::int64_t kLongest = 2'000'000;
    sleep_until(now_ + Nanos(static_cast<std::int64_t>(random_.below(kLongest))));
    return;
  }
  running_->priority = random_.next();
  SimThread* const next = choose();
  if (next != running_) pass_to(next, true);
}

/// Whoever sleeps until now, and when the next is to wake: then, or earlier.
void World::release_due() {
  next_due_ = Nanos::max();
  for (const auto& each : threads_) {
    if (each->state != SimThread::State::kWaits || each->until == Nanos::max()) continue;
    if (each->until <= now_) {
      each->state = SimThread::State::kRunnable;
    } else {
      next_due_ = std::min(next_due_, each->until);
    }
  }
}

void World::list_runnable() {
  runnable_.clear();
  for (const auto& each : threads_) {
    if (each->state == SimThread::State::kRunnable) runnable_.push_back(each.get());
  }
}

/// Who goes on; time jumps if nobody can.
SimThread* World::choose() {
  for (list_runnable(); runnable_.empty(); list_runnable()) {
    if (next_due_ == Nanos::max()) fail("all wait for ever: " + who_waits());
    now_ = std::max(now_, next_due_);
    release_due();
  }
  SimThread* chosen = runnable_.front();
  if (by_priority_) {
    chosen = *std::ranges::max_element(runnable_, {}, &SimThread::priority);
  } else if (runnable_.size() > 1) {
    chosen = runnable_[random_.below(runnable_.size())];
  }
  trail_ = hash_u64(trail_, chosen->number + static_cast<std::uint64_t>(now_.count()));
  return chosen;
}

void World::pass_to(SimThread* next, bool waits) {
  SimThread* const self = running_;
  running_ = next;
  if (tells_) {
    std::fprintf(stderr, "  %.6f ms, step %lld: %s goes on\n", to_ms(now_),
                 static_cast<long long>(steps_), next->name().c_str());
  }
  next->give_baton();
  if (waits) self->wait_for_baton();
}

void World::sleep_until(Nanos until) {
  if (until > now_) wait(nullptr, until);
}

void World::wait(const void* on, std::optional<Nanos> until) {
  SimThread& self = *running_;
  self.state = SimThread::State::kWaits;
  self.on = on;
  self.until = until.value_or(Nanos::max());
  next_due_ = std::min(next_due_, self.until);
  SimThread* const next = choose();
  if (next != &self) pass_to(next, true);
  self.on = nullptr;
  self.until = Nanos::max();
}

void World::wake(const void* on, int most) {
  std::vector<SimThread*> asleep;
  for (const auto& each : threads_) {
    if (each->state == SimThread::State::kWaits && each->on == on) asleep.push_back(each.get());
  }
  for (; most > 0 && !asleep.empty(); --most) {
    const auto at = static_cast<std::ptrdiff_t>(random_.below(asleep.size()));
    asleep[static_cast<std::size_t>(at)]->state = SimThread::State::kRunnable;
    asleep.erase(asleep.begin() + at);
  }
}

std::shared_ptr<SimThread> World::start(std::function<void()> body) {
  if (refuse_times_ > 0 && --refuse_after_ < 0) {
    --refuse_times_;
    throw std::system_error(std::make_error_code(std::errc::resource_unavailable_try_again));
  }
  auto thread = std::make_shared<SimThread>();
  thread->number = started_++;
  thread->priority = random_.next();
  threads_.push_back(thread);
  std::thread system([this, thread, body = std::move(body)]() mutable {
    thread->wait_for_baton();
    world_here = this;
    body();
    body = nullptr;  // What it holds goes while others stand still.
    std::erase(threads_, thread);
    thread->state = SimThread::State::kOver;
    wake(&*thread, 1);
    if (threads_.size() == 1) wake(&threads_, 1);
    pass_to(choose(), false);
  });
  thread->handle = system.native_handle();
  system.detach();
  step();
  return thread;
}

void World::join(SimThread& thread) {
  while (thread.state != SimThread::State::kOver) wait(&thread);
}

void World::note(const std::string& what) {
  if (tells_) {
    std::fprintf(stderr, "%.6f ms, thread %s: %s\n", to_ms(now_), running_->name().c_str(),
                 what.c_str());
  }
}

void World::fail(const std::string& what) {
  std::fprintf(stderr, "%.6f ms, step %lld, thread %s: %s\n", to_ms(now_),
               static_cast<long long>(steps_), running_->name().c_str(), what.c_str());
  if (explain_) std::fprintf(stderr, "%s\n", explain_().c_str());
  std::fflush(stderr);
  std::_Exit(1);
}

std::string World::who_waits() const {
  std::string all;
  for (const auto& each : threads_) {
    all += fmt::format("{}{} {}", all.empty() ? "" : ", ", each->name(),
                       each->state == SimThread::State::kRunnable ? "runs"
                       : each->until == Nanos::max()
                           ? "waits"
                           : fmt::format("waits until {:.6f} ms", to_ms(each->until)));
  }
  return all;
}

void wake(const void* on, int most) {
  World* const world = World::here();
  if (world == nullptr) return;
  world->wake(on, most);
  world->step();
}

void sleep_for(Nanos time) {
  if (World* const world = World::here()) world->sleep_until(world->now() + time);
}

Nanos now() {
  World* const world = World::here();
  return world == nullptr ? Nanos(0) : world->now();
}

}  // namespace pirt::simulated
