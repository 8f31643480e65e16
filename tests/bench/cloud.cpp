// The cloud's queue over a real nats-server on loopback: how many tasks a second, how long each
// takes, where it saturates; and what a task costs beside the same messages by hand.
//
// Usage: cloud scale [SECONDS]      default 20, for each of 1, 2, 4 workers and 1 to 64 robots
//        cloud overhead [TASKS]     default 500
//        cloud greedy [SECONDS]     default 10: 15 robots, alone and beside a greedy one
//        cloud memory [TASKS]       default 100000: a worker's memory over so many
//        cloud hedge [TASKS]        default 2000: two workers, of which one stalls 3 % of its calls
// A worker has one slot and sleeps 10 ms for a task, so that two cores do not measure themselves.
#include <fmt/format.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <condition_variable>
#include <cstdlib>
#include <mutex>
#include <string_view>
#include <thread>
#include <vector>

#include "tests/workloads/backends/nats/nats_server.h"
#include "workloads/backends/nats/wire/wire.h"
#include "workloads/base/text/json.h"

namespace {

using namespace std::chrono_literals;
using namespace pirt::cloud;
using pirt::Nanos;
using pirt::Workload;

constexpr Nanos kLong = 30s;
constexpr double kGoal = 1.6;
constexpr int kServiceMs = 10;
constexpr int kUnderWay = 2;  // Tasks of a robot.
constexpr double kRowS = 20;

double quantile(std::vector<double>& values, double q) {
  if (values.empty()) return 0;
  std::ranges::sort(values);
  return values[static_cast<std::size_t>(q * static_cast<double>(values.size() - 1))];
}

void start(test::NatsServer& server, const Setup& setup) {
  if (!server.start()) throw std::runtime_error("nats-server does not start: " + server.log());
  administer({.server = server.url()}, setup);
}

RobotOptions robot_options(const std::string& url, const std::string& name) {
  RobotOptions options;
  options.connection.server = url;
  options.robot = name;
  return options;
}

WorkerOptions worker_options(const std::string& url, int number) {
  WorkerOptions options;
  options.connection.server = url;
  options.name = "worker-" + std::to_string(number);
  options.hello = 500ms;
  options.make_computer = test::make_adding_computer;
  return options;
}

/// A robot that has kUnderWay tasks on their way at any time, as long as it is told to.
class Robot {
 public:
  Robot(const std::string& url, const std::string& name, const Workload& workload)
      : link_(robot_options(url, name)), workload_(workload) {}
  void wait_until_up() {
    if (!link_.wait_until_up(kLong)) throw std::runtime_error(link_.why_down());
  }
  void begin() {
    for (int i = 0; i < kUnderWay; ++i) callers_.emplace_back([this] { call(); });
  }
  void end() { ends_ = true; }
  /// @return  Milliseconds of each task.
  std::vector<double> take() {
    callers_.clear();
    return std::move(took_ms_);
  }

 private:
  void call() {
    while (!ends_) {
      const Nanos begin = pirt::MachineClock().now();
      const auto task = test::make_message(workload_, {.tens_of_ms = kServiceMs / 10});
      if (!test::Submitted(link_, task).end(kLong).problem.empty()) continue;
      const std::lock_guard lock(mutex_);
      took_ms_.push_back(pirt::to_ms(pirt::MachineClock().now() - begin));
    }
  }

  std::mutex mutex_;
  std::vector<double> took_ms_;
  std::atomic<bool> ends_ = false;
  RobotLink link_;
  const Workload& workload_;
  std::vector<std::jthread> callers_;  // They use the rest.
};

/// One row: so many workers and robots for so long.
void measure_fleet(int workers, int robots, double seconds) {
  const Workload small = test::adding("small", 1000);
  const std::vector<const Workload*> known = {&small};
  test::NatsServer server;
  Setup setup;
  setup.robots.clear();
  for (int r = 0; r < robots; ++r) setup.robots.push_back("r" + std::to_string(r));
  start(server, setup);
  std::vector<std::unique_ptr<WorkerLink>> all;
  for (int w = 0; w < workers; ++w) {
    all.push_back(std::make_unique<WorkerLink>(worker_options(server.url(), w), known));
  }
  std::vector<std::unique_ptr<Robot>> fleet;
  for (const std::string& name : setup.robots) {
    fleet.push_back(std::make_unique<Robot>(server.url(), name, small));
  }
  for (const auto& each : fleet) each->wait_until_up();
  const auto begin = std::chrono::steady_clock::now();
  for (const auto& each : fleet) each->begin();
  std::this_thread::sleep_for(std::chrono::duration<double>(seconds));
  for (const auto& each : fleet) each->end();
  std::vector<double> took;
  std::size_t least = SIZE_MAX, most = 0;
  for (const auto& each : fleet) {
    const auto of_one = each->take();
    least = std::min(least, of_one.size());
    most = std::max(most, of_one.size());
    took.insert(took.end(), of_one.begin(), of_one.end());
  }
  const std::chrono::duration<double> passed = std::chrono::steady_clock::now() - begin;
  const double rate = static_cast<double>(took.size()) / passed.count();
  const double busy = kServiceMs * 1e-3 * rate / workers;
  fmt::print(
      "| {} | {} | {:.0f} | {:.0f} | {:.1f} | {:.1f} | {:.1f} to {:.1f} | {:.0f} | {:.0f} |\n",
      workers, robots, rate, 100 * busy, quantile(took, 0.5), quantile(took, 0.99),
      static_cast<double>(least) / passed.count(), static_cast<double>(most) / passed.count(),
      test::resident_mb("self"), test::resident_mb(std::to_string(server.process())));
  std::fflush(stdout);
}

/// Each row in a process of its own, so that its memory is its own.
/// @return  Whether all of them came to their end.
bool scale(double seconds) {
  fmt::print(
      "A worker has one slot and sleeps {} ms for a task; a robot has {} tasks of 1 KB each way on "
      "their way at a time; {} s a row, on {} cores.\n\n"
      "| workers | robots | tasks/s | of the workers' most, % | median ms | p99 ms | tasks/s of a "
      "robot | robots and workers, MB | server, MB |\n|---|---|---|---|---|---|---|---|---|\n",
      kServiceMs, kUnderWay, seconds, std::thread::hardware_concurrency());
  for (const int workers : {1, 2, 4}) {
    for (const int robots : {1, 4, 16, 64}) {
      std::fflush(stdout);
      const pid_t child = ::fork();
      if (child == 0) {
        try {
          measure_fleet(workers, robots, seconds);
        } catch (const std::exception& error) {
          fmt::print(stderr, "{} workers, {} robots: {}\n", workers, robots, error.what());
          std::_Exit(4);
        }
        std::_Exit(0);
      }
      int status = 0;
      ::waitpid(child, &status, 0);
      if (!WIFEXITED(status) || WEXITSTATUS(status) != 0) return false;
    }
  }
  return true;
}

/// The same messages by hand: an offer, a claim, the task and its answer; the worker is an echo.
class ByHand {
 public:
  explicit ByHand(const std::string& url)
      : robot_({.server = url}, {}), worker_({.server = url}, {}) {
    if (!robot_.wait_until_up(kLong) || !worker_.wait_until_up(kLong)) {
      throw std::runtime_error("no connection");
    }
    worker_.subscribe("bench.offer",
                      [this](const Incoming&) { worker_.publish("bench.claim", {}); });
    robot_.subscribe("bench.claim", [this](const Incoming&) {
      robot_.publish("bench.task", encode(TaskMessage{.inputs = {*data_, {}}}));
    });
    worker_.subscribe("bench.task", [this](const Incoming& message) {
      auto task = decode_as<TaskMessage>(message.data);
      worker_.publish("bench.answer", encode(ReplyMessage{.kind = ReplyKind::kRunning}));
      worker_.publish("bench.answer", encode(ReplyMessage{.outputs = std::move(task.inputs)}));
    });
    robot_.subscribe("bench.answer", [this](const Incoming& message) {
      const auto reply = decode_as<ReplyMessage>(message.data);
      if (reply.kind == ReplyKind::kRunning) return;
      came();
    });
    worker_.subscribe("bench.echo", [this](const Incoming& message) {
      worker_.publish("bench.reply", message.data);
    });
    robot_.subscribe("bench.reply", [this](const Incoming&) { came(); });
    // The server knows of all that, once it answers.
    static_cast<void>(worker_.request("$JS.API.INFO", {}, kLong));
    static_cast<void>(robot_.request("$JS.API.INFO", {}, kLong));
  }
  void call(const Bytes& data) {
    data_ = &data;
    say("bench.offer", {});
  }
  void request(const Bytes& data) { say("bench.echo", data); }

 private:
  /// Until its reply has come.
  void say(const std::string& subject, pirt::cloud::ByteView data) {
    robot_.publish(subject, data);
    std::unique_lock lock(mutex_);
    if (!changed_.wait_for(lock, kLong, [this] { return came_; })) {
      throw std::runtime_error("no reply");
    }
    came_ = false;
  }
  void came() {
    const std::lock_guard lock(mutex_);
    came_ = true;
    changed_.notify_all();
  }

  std::mutex mutex_;
  std::condition_variable changed_;
  const Bytes* data_ = nullptr;
  bool came_ = false;
  Connection robot_, worker_;
};

template <typename Call>
std::vector<double> times_ms(int tasks, const Call& call) {
  std::vector<double> took;
  for (int i = -tasks / 10; i < tasks; ++i) {
    const auto begin = std::chrono::steady_clock::now();
    call();
    const std::chrono::duration<double, std::milli> ms = std::chrono::steady_clock::now() - begin;
    if (i >= 0) took.push_back(ms.count());
  }
  return took;
}

/// A task, and until it has ended.
void call_and_wait(RobotLink& robot, const TaskMessage& task) {
  const ReplyMessage end = test::Submitted(robot, task).end(kLong);
  if (!end.problem.empty()) fmt::print(stderr, "{}\n", end.problem), std::abort();
}

/// @return  Whether the goal is met.
bool overhead(int tasks) {
  test::NatsServer server;
  start(server, {.robots = {"robot"}});
  const Bytes data(64 << 10, std::byte{7});
  const Workload echo = test::adding("echo", 64 << 10);
  const std::vector<const Workload*> known = {&echo};
  const WorkerLink worker(worker_options(server.url(), 0), known);
  RobotLink robot(robot_options(server.url(), "robot"));
  if (!robot.wait_until_up(kLong)) throw std::runtime_error(robot.why_down());
  ByHand plain(server.url());
  const TaskMessage task = test::make_message(echo, {});
  std::vector<double> request, hand, ours;
  for (int round = 0; round < 5; ++round) {  // In turns.
    const auto add = [](std::vector<double>& to, std::vector<double> more) {
      to.insert(to.end(), more.begin(), more.end());
    };
    add(request, times_ms(tasks / 5, [&] { plain.request(data); }));
    add(hand, times_ms(tasks / 5, [&] { plain.call(data); }));
    add(ours, times_ms(tasks / 5, [&] { call_and_wait(robot, task); }));
  }
  fmt::print("one task of 64 KiB each way at a time, {} of each; medians, ms\n", tasks);
  const auto line = [](std::string_view what, double ms) {
    fmt::print("  {:<58} {:.3f}\n", what, ms);
  };
  line("request and reply", quantile(request, 0.5));
  line("the same messages by hand: offer, claim, task, answer", quantile(hand, 0.5));
  line("pirt", quantile(ours, 0.5));
  const double ratio = quantile(ours, 0.5) / quantile(hand, 0.5);
  fmt::print("pirt: {:.2f} of the same by hand (goal {}), {:.1f} of request and reply\n", ratio,
             kGoal, quantile(ours, 0.5) / quantile(request, 0.5));
  return ratio <= kGoal;
}

/// Fifteen robots that submit a task each kEveryMs, on one worker, and what each gets a second.
std::vector<double> rates(double seconds, bool greedy) {
  constexpr int kOthers = 15, kEveryMs = 250;
  const Workload small = test::adding("small", 1000);
  const std::vector<const Workload*> known = {&small};
  test::NatsServer server;
  Setup setup{.robots = {"greedy"}};
  for (int r = 0; r < kOthers; ++r) setup.robots.push_back("r" + std::to_string(r));
  start(server, setup);
  const WorkerLink worker(worker_options(server.url(), 0), known);
  std::vector<std::unique_ptr<RobotLink>> links;
  for (const std::string& name : setup.robots) {
    links.push_back(std::make_unique<RobotLink>(robot_options(server.url(), name)));
    if (!links.back()->wait_until_up(kLong)) throw std::runtime_error(links.back()->why_down());
  }
  const TaskMessage task = test::make_message(small, {.tens_of_ms = kServiceMs / 10});
  const auto submit = [&](RobotLink& link) { static_cast<void>(test::Submitted(link, task)); };
  if (greedy) {
    for (int i = 0; i < 100 * static_cast<int>(seconds); ++i) submit(*links[0]);
  }
  const auto begin = std::chrono::steady_clock::now();
  for (auto next = begin; next < begin + std::chrono::duration<double>(seconds);
       next += std::chrono::milliseconds(kEveryMs)) {
    std::this_thread::sleep_until(next);
    for (int r = 1; r <= kOthers; ++r) submit(*links[static_cast<std::size_t>(r)]);
  }
  std::vector<double> all;
  for (int r = 1; r <= kOthers; ++r) {
    const auto& link = *links[static_cast<std::size_t>(r)];
    all.push_back(static_cast<double>(link.ask(&Caller::counts).done) / seconds);
  }
  return all;
}

bool greedy(double seconds) {
  std::vector<double> alone = rates(seconds, false), beside = rates(seconds, true);
  double least = 1;
  for (std::size_t i = 0; i < alone.size(); ++i) least = std::min(least, beside[i] / alone[i]);
  fmt::print(
      "15 robots with 4 tasks of 10 ms a second each on one worker, tasks/s of one: {:.2f} "
      "(median); beside a greedy one {:.2f}, of its own rate at least {:.2f}\n",
      quantile(alone, 0.5), quantile(beside, 0.5), least);
  return least >= 0.9;
}

bool memory(int tasks) {
  const Workload small = test::adding("small", 1000);
  const std::vector<const Workload*> known = {&small};
  test::NatsServer server;
  start(server, {.robots = {"robot"}});
  const WorkerLink worker(worker_options(server.url(), 0), known);
  RobotLink robot(robot_options(server.url(), "robot"));
  if (!robot.wait_until_up(kLong)) throw std::runtime_error(robot.why_down());
  const TaskMessage task = test::make_message(small, {});
  double first = 0, last = 0;
  for (int i = 0; i < tasks; ++i) {
    call_and_wait(robot, task);
    if (i == tasks / 10) first = test::resident_mb("self");
  }
  last = test::resident_mb("self");
  fmt::print("robot and worker: {:.1f} MB after {} tasks, {:.1f} after {}\n", first, tasks / 10,
             last, tasks);
  return last < first + 2;
}

/// Sleeps 10 ms for a call, and ten times that for 3 of 100.
class Stalling : public Computer {
 public:
  explicit Stalling(bool stalls) : stalls_(stalls) {}
  ReplyMessage compute(const Call& call) override {
    const bool now = stalls_ && ++calls_ % 33 == 0;
    std::this_thread::sleep_for(std::chrono::milliseconds(now ? 10 * kServiceMs : kServiceMs));
    return {.outputs = {encode_tensors(pirt::make_tensors(call.workload->outputs)), {}}};
  }

 private:
  bool stalls_;
  int calls_ = 0;
};

bool hedge(int tasks) {
  const Workload small = test::adding("small", 1000);
  const std::vector<const Workload*> known = {&small};
  std::vector<std::vector<double>> took;
  double extra = 0;
  for (const bool hedges : {false, true}) {
    test::NatsServer server;
    start(server, {.robots = {"robot"}});
    std::vector<std::unique_ptr<WorkerLink>> workers;
    for (int w = 0; w < 2; ++w) {
      WorkerOptions options = worker_options(server.url(), w);
      options.make_computer = [w] { return std::make_unique<Stalling>(w == 0); };
      workers.push_back(std::make_unique<WorkerLink>(options, known));
    }
    RobotOptions options = robot_options(server.url(), "robot");
    options.limits.hedge_p95 = hedges;
    RobotLink robot(options);
    if (!robot.wait_until_up(kLong)) throw std::runtime_error(robot.why_down());
    const TaskMessage task = test::make_message(small, {});
    took.push_back(times_ms(tasks, [&] { call_and_wait(robot, task); }));
    if (hedges) {
      const CallerCounts counts = robot.ask(&Caller::counts);
      extra = static_cast<double>(counts.hedged) / static_cast<double>(counts.done);
    }
  }
  const double without = quantile(took[0], 0.99), with = quantile(took[1], 0.99);
  fmt::print(
      "p50 {:.1f} and p99 {:.1f} ms; with hedge: p95 {:.1f} and {:.1f} ms, {:.2f} of it (goal "
      "0.4), {:.1f} % more calls (goal 6)\n",
      quantile(took[0], 0.5), without, quantile(took[1], 0.5), with, with / without, 100 * extra);
  return with <= 0.4 * without && extra <= 0.06;
}

}  // namespace

int main(int argc, char** argv) {
  const std::string_view what = argc > 1 ? argv[1] : "";
  try {
    if (what == "scale") {
      return scale(argc > 2 ? std::atof(argv[2]) : kRowS) ? 0 : 4;
    }
    if (what == "overhead") return overhead(argc > 2 ? std::atoi(argv[2]) : 500) ? 0 : 1;
    if (what == "greedy") return greedy(argc > 2 ? std::atof(argv[2]) : 10) ? 0 : 1;
    if (what == "memory") return memory(argc > 2 ? std::atoi(argv[2]) : 100'000) ? 0 : 1;
    if (what == "hedge") return hedge(argc > 2 ? std::atoi(argv[2]) : 2000) ? 0 : 1;
  } catch (const std::exception& error) {
    fmt::print(stderr, "{}\n", error.what());
    return 4;
  }
  fmt::print(
      stderr,
      "usage: cloud scale [SECONDS] | overhead [TASKS] | greedy [SECONDS] | memory [TASKS] | hedge "
      "[TASKS]\n");
  return 2;
}
