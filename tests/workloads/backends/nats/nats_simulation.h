// A server of streams, robots and workers in virtual time, with all that can fail between them. The
// robots' and workers' state machines are those of the program.
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

#include "workloads/backends/nats/robot/caller.h"
#include "workloads/backends/nats/worker/attendant.h"

namespace pirt::cloud::test {

/// What the simulated robots submit: the first byte of a body.
enum class Sort : std::uint8_t { kPlain, kPoisoned };

struct SimulationOptions {
  std::uint64_t seed = 1;
  std::int64_t faults = 1000;
  int robots = 2, workers = 3, slots = 2;
  Nanos between_faults = std::chrono::seconds(2);
  Nanos between_tasks = std::chrono::seconds(4);  ///< Of each robot.
};

struct SimulationResult {
  std::int64_t submitted = 0, done = 0, given_up = 0, returned = 0, withdrawn = 0;
  std::int64_t poisoned = 0;
  std::int64_t ended_twice = 0;  ///< Has to be 0, as what follows.
  std::int64_t never_ended = 0;
  std::int64_t ended_wrongly = 0;  ///< A sound task without a deadline not done, a poisoned one not
                                   ///< given up.
  std::size_t left_in_outboxes = 0, left_on_streams = 0;
  std::int64_t sent_again = 0, late = 0, not_computed_again = 0, lost_by_server = 0;
  std::map<std::string, std::int64_t> faults;
};

class Simulation {
 public:
  explicit Simulation(const SimulationOptions& options);
  SimulationResult run();

 private:
  struct StoredTask {
    std::string robot;
    TaskMessage message;
    Nanos stored_at{0}, hidden_until{0};
    Delivery delivery = 0;
  };
  struct StoredReply {
    ReplyMessage message;
    Nanos stored_at{0}, hidden_until{0};
  };
  struct Peer {  ///< A connection of a robot or a worker.
    bool cut = false, runs = true;
    int epoch = 0;
  };
  struct Robot {
    std::string name;
    Peer peer;
    std::unique_ptr<Outbox> outbox;
    std::unique_ptr<Caller> caller;
    std::uint64_t run = 1, number = 0;
    std::map<std::uint64_t, StoredReply> replies;  ///< On the server.
    Nanos wakes_at = Nanos::max();
  };
  struct Worker {
    Peer peer;
    int life = 0;
    std::unique_ptr<Attendant> attendant;
    std::map<TaskKey, Sort> sorts;
    Nanos wakes_at = Nanos::max();
  };
  struct Expected {
    Sort sort = Sort::kPlain;
    bool deadline = false, keyed = false;
    int ends = 0;
    bool withdrawn = false;
    std::optional<CallEndKind> end;
  };

  void at(Nanos time, std::function<void()> what);
  Nanos delay();
  bool chance(double probability);
  [[nodiscard]] bool connected(const Peer& peer) const {
    return server_up_ && !peer.cut && peer.runs;
  }
  /// Arrives unless the connection is lost meanwhile.
  void carry(Peer& peer, std::function<void()> what);

  void count(const Robot& robot);
  void count(const Worker& worker);
  void begin_robot(Robot& robot);
  void begin_worker(Worker& worker);
  void reconnect(Peer& peer, Nanos after, std::function<void()> then);
  void lose(Peer& peer);
  void apply(Robot& robot, CallerActions actions);
  void apply(Worker& worker, AttendantActions actions);
  void publish(Robot& robot, const Publish& what);
  void ended(Robot& robot, const TellEnd& end);
  void run(Worker& worker, const TaskKey& key);
  void store_reply(Worker& worker, const PublishReply& what);
  void deliver_tasks();
  void deliver_replies(Robot& robot);
  void announce();
  void submit(Robot& robot, bool keyed);
  void fault();
  void server_down(bool power_loss);
  void check(SimulationResult& result) const;

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
  std::uint64_t sequence_ = 0;

  bool server_up_ = true;
  std::map<std::uint64_t, StoredTask> tasks_;
  std::map<std::string, std::pair<std::uint64_t, Nanos>> ids_;  ///< By message id, for 2 minutes.
  std::map<Delivery, std::uint64_t> deliveries_;
  std::uint64_t stream_sequence_ = 0, delivery_ = 0;
  bool pumping_ = false;

  std::deque<Robot> robots_;
  std::deque<Worker> workers_;
  std::map<TaskKey, Expected> expected_;
  std::set<TaskKey> live_;  ///< Of expected_: neither ended nor withdrawn.
  bool over_ = false;
  SimulationResult result_;
};

}  // namespace pirt::cloud::test
