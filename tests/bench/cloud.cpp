// The cloud's queue over a real nats-server on loopback: how many tasks a second, how long each
// takes, where it saturates; and what a task costs beside bare JetStream.
//
// Usage: cloud scale [SECONDS]      default 20, for each of 1, 2, 4 workers and 1 to 64 robots:
// five
//                                   minutes, and a table for README.md
//        cloud overhead [TASKS]     default 500
// A worker has one slot and sleeps 10 ms for a task, so that two cores do not measure themselves.
#include <fmt/format.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <condition_variable>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <mutex>
#include <string_view>
#include <thread>
#include <vector>

#include "tests/workloads/backends/nats/nats_server.h"
#include "workloads/backends/nats/robot/outbox.h"
#include "workloads/backends/nats/wire/subjects.h"
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

/// In MB. @param process  Its id, or "self".
double resident_mb(const std::string& process) {
  std::ifstream statm("/proc/" + process + "/statm");
  std::uint64_t total = 0, resident = 0;
  statm >> total >> resident;
  return static_cast<double>(resident) * 4096e-6;
}

void start(test::NatsServer& server, const Setup& setup) {
  if (!server.start()) throw std::runtime_error("nats-server does not start: " + server.log());
  Connection admin({.server = server.url()}, {});
  if (!admin.wait_until_up(kLong)) throw std::runtime_error("no connection");
  set_up(admin, setup);
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
    for (int i = 0; i < kUnderWay; ++i) submit();
  }
  void end() {
    const std::lock_guard lock(mutex_);
    ends_ = true;
  }
  /// @return  Milliseconds of each task.
  std::vector<double> take() {
    std::unique_lock lock(mutex_);
    changed_.wait_for(lock, kLong, [this] { return under_way_ == 0; });
    return std::move(took_ms_);
  }

 private:
  void submit() {
    {
      const std::lock_guard lock(mutex_);
      if (ends_) return;
      ++under_way_;
    }
    Submission submission = test::make_submission(workload_, {.tens_of_ms = kServiceMs / 10});
    submission.ended = [this](const TaskEnd& end) {
      {
        const std::lock_guard lock(mutex_);
        --under_way_;
        if (end.how == CallEndKind::kDone) took_ms_.push_back(pirt::to_ms(end.total));
      }
      changed_.notify_all();
      submit();
    };
    static_cast<void>(link_.submit(std::move(submission)));
  }

  std::mutex mutex_;
  std::condition_variable changed_;
  std::vector<double> took_ms_;
  int under_way_ = 0;
  bool ends_ = false;
  RobotLink link_;  // Its threads use the rest.
  const Workload& workload_;
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
      resident_mb("self"), resident_mb(std::to_string(server.process())));
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

/// What bare JetStream takes: a task is stored, pulled, its reply stored, delivered, and both are
/// acknowledged; the worker is an echo.
class Bare {
 public:
  explicit Bare(const std::string& url)
      : robot_({.server = url}, {}), worker_({.server = url}, {}) {
    if (!robot_.wait_until_up(kLong) || !worker_.wait_until_up(kLong)) {
      throw std::runtime_error("no connection");
    }
    worker_.subscribe(worker_.inbox() + ".task", [this](const Incoming& message) {
      if (message.reply.empty()) return pull();
      task_ack_ = message.reply;
      worker_.publish(reply_subject("bare"), message.data, worker_.inbox() + ".stored");
    });
    worker_.subscribe(worker_.inbox() + ".stored", [this](const Incoming&) {
      worker_.publish(task_ack_, "+ACK");
      pull();
    });
    robot_.subscribe(robot_.inbox() + ".stored", [](const Incoming&) {});
    robot_.subscribe(deliver_subject("bare"), [this](const Incoming& message) {
      const std::lock_guard lock(mutex_);
      ack_ = message.reply;
      came_ = true;
      changed_.notify_all();
    });
    worker_.subscribe("bench.echo", [this](const Incoming& message) {
      worker_.publish(message.reply, message.data);
    });
    pull();
    // The server knows of all that, once it answers.
    static_cast<void>(worker_.request("$JS.API.INFO", "", kLong));
    static_cast<void>(robot_.request("$JS.API.INFO", "", kLong));
  }
  void call(const Bytes& data) {
    robot_.publish(task_subject("bare"), data, robot_.inbox() + ".stored");
    std::unique_lock lock(mutex_);
    if (!changed_.wait_for(lock, kLong, [this] { return came_; })) {
      throw std::runtime_error("no reply");
    }
    came_ = false;
    robot_.publish(ack_, "+ACK");
  }
  void request(const Bytes& data) {
    if (!robot_.request("bench.echo", data, kLong).came) throw std::runtime_error("no reply");
  }

 private:
  void pull() {
    worker_.publish(fmt::format("$JS.API.CONSUMER.MSG.NEXT.{}.{}", kTaskStream, kWorkers),
                    R"({"batch":1,"expires":30000000000})", worker_.inbox() + ".task");
  }

  std::mutex mutex_;
  std::condition_variable changed_;
  std::string task_ack_, ack_;
  bool came_ = false;
  Connection robot_, worker_;
};

template <typename Call>
double median_ms(int tasks, const Call& call) {
  std::vector<double> took;
  for (int i = -tasks / 10; i < tasks; ++i) {
    const auto begin = std::chrono::steady_clock::now();
    call(i);
    const std::chrono::duration<double, std::milli> ms = std::chrono::steady_clock::now() - begin;
    if (i >= 0) took.push_back(ms.count());
  }
  return quantile(took, 0.5);
}

double task_ms(const std::string& url, const std::filesystem::path& outbox, int tasks) {
  const Workload echo = test::adding("echo", 64 << 10);
  const std::vector<const Workload*> known = {&echo};
  const WorkerLink worker(worker_options(url, 0), known);
  RobotOptions options = robot_options(url, "robot");
  options.outbox = outbox;
  RobotLink robot(options);
  if (!robot.wait_until_up(kLong)) throw std::runtime_error(robot.why_down());
  const Submission task = test::make_submission(echo, {});
  std::mutex mutex;
  std::condition_variable changed;
  return median_ms(tasks, [&](int) {
    bool ended = false;
    Submission submission = task;
    submission.ended = [&](const TaskEnd& end) {
      if (end.how != CallEndKind::kDone) std::abort();
      const std::lock_guard lock(mutex);
      ended = true;
      changed.notify_all();
    };
    static_cast<void>(robot.submit(std::move(submission)));
    std::unique_lock lock(mutex);
    changed.wait(lock, [&] { return ended; });
  });
}

/// @return  Whether the goal is met.
bool overhead(int tasks) {
  test::NatsServer server;
  start(server, {.robots = {"robot", "bare"}});
  const Bytes data(64 << 10, std::byte{7});
  double request = 0, bare = 0, bare_with_outbox = 0;
  {
    Bare plain(server.url());
    request = median_ms(tasks, [&](int) { plain.request(data); });
    bare = median_ms(tasks, [&](int) { plain.call(data); });
    const auto outbox = open_outbox(server.folder() / "bare.db", "bare", std::uint64_t{64} << 20);
    bare_with_outbox = median_ms(tasks, [&](int i) {
      const TaskId task{1, static_cast<std::uint64_t>(i + tasks)};
      if (!outbox->put(task, "", 1, data)) throw std::runtime_error("the outbox is full");
      plain.call(data);
      outbox->erase(task);
    });
  }
  const double in_memory = task_ms(server.url(), {}, tasks);
  const double in_file = task_ms(server.url(), server.folder() / "outbox.db", tasks);
  fmt::print("one task of 64 KiB each way at a time, {} of each; medians, ms\n", tasks);
  const auto line = [](std::string_view what, double ms) {
    fmt::print("  {:<58} {:.3f}\n", what, ms);
  };
  line("request and reply, nothing stored", request);
  line("bare JetStream: task and reply stored, pulled, acknowledged", bare);
  line("the same with an outbox (SQLite, synchronous=FULL)", bare_with_outbox);
  line("pirt, outbox in memory", in_memory);
  line("pirt, outbox in a file (SQLite, synchronous=FULL)", in_file);
  fmt::print(
      "pirt with its outbox: {:.2f} of bare JetStream, {:.2f} of that with an outbox (goal {}), "
      "{:.1f} of request and reply; in memory {:.2f} of bare JetStream\n",
      in_file / bare, in_file / bare_with_outbox, kGoal, in_file / request, in_memory / bare);
  return in_file / bare_with_outbox <= kGoal;
}

}  // namespace

int main(int argc, char** argv) {
  const std::string_view what = argc > 1 ? argv[1] : "";
  try {
    if (what == "scale") {
      return scale(argc > 2 ? std::atof(argv[2]) : kRowS) ? 0 : 4;
    }
    if (what == "overhead") return overhead(argc > 2 ? std::atoi(argv[2]) : 500) ? 0 : 1;
  } catch (const std::exception& error) {
    fmt::print(stderr, "{}\n", error.what());
    return 4;
  }
  fmt::print(stderr, "usage: cloud scale [SECONDS] | cloud overhead [TASKS]\n");
  return 2;
}
