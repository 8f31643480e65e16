// A server, robots and workers in virtual time, with all that can fail between them. The robots'
// and workers' state machines are those of the program.
#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <queue>
#include <random>
#include <set>
#include <string>
#include <tuple>
#include <vector>

#include "workloads/backends/nats/robot/robot_link.h"
#include "workloads/backends/nats/service/worker_link.h"

namespace pirt::cloud::test {

struct SimulationOptions {
  std::uint64_t seed = 1;
  std::int64_t faults = 1000;
  int robots = 2, workers = 3, slots = 2;
  Nanos between_faults = std::chrono::seconds(2);
  Nanos between_tasks = std::chrono::seconds(4);  ///< Of each robot.
  bool hedges = false;
};

struct SimulationResult {
  std::int64_t submitted = 0, done = 0, given_up = 0, returned = 0, withdrawn = 0;
  std::int64_t ended_twice = 0;  ///< Has to be 0, as what follows.
  std::int64_t never_ended = 0;
  /// A sound task without a deadline that was not done, though fewer than three workers died with
  /// it; a poisoned one that was.
  std::int64_t ended_wrongly = 0;
  std::int64_t over_slots = 0;  ///< A worker had more than its slots.
  std::size_t left_at_workers = 0;
  std::int64_t sent_again = 0, hedged = 0, late = 0;
  std::map<std::string, std::int64_t> faults;
};

class Simulation {
 public:
  explicit Simulation(const SimulationOptions& options);
  SimulationResult run();

 private:
  enum class Sort : std::uint8_t { kPlain, kPoisoned, kHeavy };
  struct Peer {  ///< A connection of a robot or a worker.
    bool cut = false, runs = true;
    int epoch = 0;
  };
  struct Robot {
    std::string name;
    Peer peer;
    std::unique_ptr<Caller> caller;
    std::uint64_t run = 0, number = 0;
    std::vector<TaskId> live;  ///< Tasks that have not ended.
    Nanos wakes_at = Nanos::max();
  };
  struct Job {
    Robot* robot = nullptr;
    TaskId task;
    std::uint32_t send = 0;
    Nanos taken{0};
    bool unwanted = false;
  };
  struct Worker {
    Peer peer;
    std::uint64_t instance = 0;
    std::unique_ptr<Desk> desk;
    std::map<std::uint64_t, Job> jobs;
  };
  struct Expected {
    Sort sort = Sort::kPlain;
    bool deadline = false, withdrawn = false;
    int ends = 0, deaths = 0;
    std::set<std::uint64_t> at;      ///< Workers that have had it, by instance.
    std::optional<std::string> end;  ///< Its problem.
    std::shared_ptr<Progress> progress;
  };

  void at(Nanos time, std::function<void()> what);
  Nanos delay();
  bool chance(double probability);
  [[nodiscard]] bool connected(const Peer& peer) const {
    return server_up_ && !peer.cut && peer.runs;
  }
  /// From one to another, unless one of their connections is lost meanwhile.
  void carry(Peer& from, Peer& to, std::function<void()> what);
  void lose(Peer& peer) { ++peer.epoch; }
  /// A robot's message, to whom it is for.
  void say(Robot& robot, const std::string& to, const Bytes& message);
  void hear(Worker& worker, Robot& robot, const Bytes& message);

  void begin_robot(Robot& robot);
  void begin_worker(Worker& worker);
  void count_death(const Worker& worker);
  void robot_up(Robot& robot);
  void look(Robot& robot);
  void wake(Robot& robot);
  void claim(Worker& worker);
  void take(Worker& worker, Robot& robot, const TaskMessage& given);
  void reply(Worker& worker, const Job& job, ReplyKind kind);
  void announce();
  void submit(Robot& robot);
  void fault();
  void server_down();
  void count(const Robot& robot);
  void check();

  SimulationOptions options_;
  std::mt19937_64 random_;
  Nanos now_{0};
  struct Event {
    Nanos time{0};
    std::uint64_t sequence = 0;
    std::function<void()> what;
    bool operator<(const Event& other) const {
      return std::tie(other.time, other.sequence) < std::tie(time, sequence);
    }
  };
  std::priority_queue<Event> events_;
  std::uint64_t sequence_ = 0, instances_ = 0, job_ = 0;
  bool server_up_ = true, over_ = false;
  std::deque<Robot> robots_;
  std::deque<Worker> workers_;
  std::map<std::pair<std::string, TaskId>, Expected> expected_;
  SimulationResult result_;
};

}  // namespace pirt::cloud::test
