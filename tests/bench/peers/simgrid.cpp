#include "tests/bench/peers/simgrid.h"

#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <functional>
#include <map>
#include <simgrid/s4u.hpp>
#include <string>
#include <utility>

#include "workloads/base/error.h"

namespace pirt::bench {
namespace {

namespace s4u = simgrid::s4u;

/// Work is counted in seconds of a core: a core does one a second, scaled up because SimGrid
/// treats less than about 1e-5 of work as none.
constexpr double kSpeed = 1e9;

/// An engine as exact as it can be: its default rounds dates to 10 microseconds.
class World {
 public:
  World() : engine_(&argc_, argv_.data()), zone_(s4u::create_full_zone("robot")) {
    s4u::Engine::set_config("surf/precision:1e-9");
    s4u::Engine::set_config("maxmin/precision:1e-9");
  }
  s4u::Host* add_host(const std::string& name, int cores) {
    return zone_->create_host(name, kSpeed)->set_core_count(cores)->seal();
  }
  void run() {
    zone_->seal();
    engine_.run();
  }

 private:
  std::string name_ = "bench", quiet_ = "--log=root.threshold:error";
  int argc_ = 2;
  std::vector<char*> argv_ = {name_.data(), quiet_.data(), nullptr};
  s4u::Engine engine_;
  s4u::NetZone* zone_;
};

std::vector<double> in_child(const std::function<std::vector<double>()>& body) {
  int ends[2];
  if (::pipe(ends) != 0) throw Error(ErrorCode::kEnvironment, "no pipe to a child process");
  std::fflush(nullptr);  // Or the child prints it again.
  const pid_t child = ::fork();
  if (child < 0) throw Error(ErrorCode::kEnvironment, "no child process");
  if (child == 0) {
    const auto values = body();
    const auto* bytes = reinterpret_cast<const char*>(values.data());
    std::size_t left = values.size() * sizeof(double);
    while (left > 0) {
      const ssize_t written = ::write(ends[1], bytes, left);
      if (written <= 0) ::_exit(1);
      bytes += written;
      left -= static_cast<std::size_t>(written);
    }
    ::_exit(0);
  }
  ::close(ends[1]);
  std::string all;
  char buffer[1 << 16];
  for (ssize_t got = 0; (got = ::read(ends[0], buffer, sizeof buffer)) > 0;) {
    all.append(buffer, static_cast<std::size_t>(got));
  }
  ::close(ends[0]);
  int status = 0;
  ::waitpid(child, &status, 0);
  if (!WIFEXITED(status) || WEXITSTATUS(status) != 0)
    throw Error(ErrorCode::kEnvironment, "SimGrid failed");
  std::vector<double> values(all.size() / sizeof(double));
  std::copy_n(all.data(), values.size() * sizeof(double), reinterpret_cast<char*>(values.data()));
  return values;
}

/// Starts tasks as told, and notes when they complete.
class Replayed {
 public:
  Replayed(const std::vector<PeerUnit>& units, const std::vector<PeerTask>& tasks,
           const std::vector<PeerStart>& starts)
      : units_(units), tasks_(tasks), completed_(units.size()) {
    for (const auto& unit : units) {
      hosts_.push_back(world_.add_host("unit" + std::to_string(hosts_.size()), unit.cores));
      turns_.push_back(s4u::Mutex::create());
    }
    for (const auto& start : starts) {
      auto& list = start.unit ? after_[{*start.unit, start.completions}] : first_;
      list.insert(list.end(), start.tasks.begin(), start.tasks.end());
    }
  }

  std::vector<std::vector<double>> run() {
    for (const std::size_t task : first_) start(task);
    world_.run();
    return std::move(completed_);
  }

 private:
  void start(std::size_t task) {
    s4u::Actor::create("task", hosts_[tasks_[task].unit], [this, task] { serve(tasks_[task]); });
  }

  void serve(const PeerTask& task) {
    for (const auto& stage : task.stages) {
      if (!stage.unit) {
        s4u::this_actor::sleep_for(stage.time_s);
      } else if (units_[*stage.unit].shared) {
        work(*stage.unit, stage.time_s);
      } else {
        turns_[*stage.unit]->lock();
        work(*stage.unit, stage.time_s);
        turns_[*stage.unit]->unlock();
      }
    }
    auto& list = completed_[task.unit];
    list.push_back(s4u::Engine::get_clock());
    const auto next = after_.find({task.unit, list.size()});
    if (next == after_.end()) return;
    for (const std::size_t each : next->second) start(each);
  }

  void work(std::size_t unit, double time_s) {
    s4u::this_actor::exec_init(time_s * kSpeed)->set_host(hosts_[unit])->wait();
  }

  World world_;
  const std::vector<PeerUnit>& units_;
  const std::vector<PeerTask>& tasks_;
  std::vector<s4u::Host*> hosts_;
  std::vector<s4u::MutexPtr> turns_;
  std::vector<std::size_t> first_;
  std::map<std::pair<std::size_t, std::size_t>, std::vector<std::size_t>> after_;
  std::vector<std::vector<double>> completed_;
};

/// Queues are counters: the tasks are equal.
class ClosedLoop {
 public:
  ClosedLoop(const std::vector<double>& time_s, const std::vector<int>& weights, std::int64_t tasks)
      : weights_(weights), left_(tasks), queued_(weights.size(), 0) {
    int in_flight = 0;
    for (const int weight : weights) in_flight += weight;
    for (int i = 0; i < in_flight && left_ > 0; ++i) dispatch();
    for (std::size_t unit = 0; unit < weights.size(); ++unit) {
      auto* host = world_.add_host("unit" + std::to_string(unit), 1);
      s4u::Actor::create("worker", host, [this, unit, work = time_s[unit] * kSpeed] {
        while (queued_[unit] > 0) {
          s4u::this_actor::execute(work);
          --queued_[unit];
          if (left_ > 0) dispatch();
        }
      });
    }
  }

  PeerRun run() {
    const auto begin = std::chrono::steady_clock::now();
    world_.run();
    const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - begin;
    return {s4u::Engine::get_clock(), elapsed.count()};
  }

 private:
  /// The only room is where a task has just completed, so that no worker waits for a task.
  void dispatch() {
    for (std::size_t unit = 0; unit < weights_.size(); ++unit) {
      if (queued_[unit] >= weights_[unit]) continue;
      ++queued_[unit];
      --left_;
      return;
    }
  }

  World world_;
  std::vector<int> weights_;
  std::int64_t left_;
  std::vector<int> queued_;
};

}  // namespace

std::vector<std::vector<double>> simgrid_completions(const std::vector<PeerUnit>& units,
                                                     const std::vector<PeerTask>& tasks,
                                                     const std::vector<PeerStart>& starts) {
  const auto flat = in_child([&] {
    std::vector<double> values;
    for (const auto& unit : Replayed(units, tasks, starts).run()) {
      values.push_back(static_cast<double>(unit.size()));
      values.insert(values.end(), unit.begin(), unit.end());
    }
    return values;
  });
  std::vector<std::vector<double>> completions;
  for (auto it = flat.begin(); it != flat.end();) {
    const auto end = it + 1 + static_cast<std::ptrdiff_t>(*it);
    completions.emplace_back(it + 1, end);
    it = end;
  }
  return completions;
}

PeerRun simgrid_closed_loop(const std::vector<double>& time_s, const std::vector<int>& weights,
                            std::int64_t tasks) {
  const auto values = in_child([&] {
    const PeerRun run = ClosedLoop(time_s, weights, tasks).run();
    return std::vector<double>{run.makespan_s, run.elapsed_s};
  });
  return {values.at(0), values.at(1)};
}

}  // namespace pirt::bench
