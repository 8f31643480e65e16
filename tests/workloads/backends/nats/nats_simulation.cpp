#include "nats_simulation.h"

#include <algorithm>
#include <utility>

#include "workloads/backends/nats/wire/wire.h"

namespace pirt::cloud::test {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr Nanos kProgress = seconds(2);
/// The last fault is long over then.
constexpr Nanos kQuiet = std::chrono::hours(2);

}  // namespace

Simulation::Simulation(const SimulationOptions& options)
    : options_(options), random_(options.seed) {
  for (int i = 0; i < options_.robots; ++i) {
    robots_.emplace_back().name = "r" + std::to_string(i);
  }
  workers_.resize(static_cast<std::size_t>(options_.workers));
}

void Simulation::at(Nanos time, std::function<void()> what) {
  events_.push({std::max(time, now_), sequence_++, std::move(what)});
}

Nanos Simulation::delay() {
  // One in a hundred is a spike.
  return milliseconds(1 + random_() % (chance(0.01) ? 5000 : 60));
}

bool Simulation::chance(double probability) {
  return std::uniform_real_distribution<double>(0, 1)(random_) < probability;
}

void Simulation::carry(Peer& from, Peer& to, std::function<void()> what) {
  if (!connected(from)) return;
  at(now_ + delay(),
     [this, &from, &to, sent = from.epoch, heard = to.epoch, what = std::move(what)] {
       if (!connected(from) || !connected(to) || from.epoch != sent || to.epoch != heard) return;
       what();
       if (chance(0.01)) what();  // Some are doubled.
     });
}

void Simulation::say(Robot& robot, const std::string& to, const Bytes& message) {
  const bool is_for_one = to.starts_with("pirt.task.");
  for (Worker& worker : workers_) {
    if (is_for_one && to != task_subject(robot.name, worker.instance)) continue;
    carry(robot.peer, worker.peer,
          [this, &robot, &worker, message] { hear(worker, robot, message); });
  }
}

void Simulation::hear(Worker& worker, Robot& robot, const Bytes& message) {
  if (is_frame_of<TaskMessage>(message)) {
    take(worker, robot, decode_as<TaskMessage>(message));
  } else if (is_frame_of<OfferMessage>(message)) {
    const auto offer = decode_as<OfferMessage>(message);
    worker.desk->offered(robot.name, offer.run, offer.waiting, now_);
    claim(worker);
  } else {
    const auto cancel = decode_as<CancelMessage>(message);
    for (auto& [number, job] : worker.jobs) job.unwanted |= job.task == cancel.task;
  }
}

void Simulation::count(const Robot& robot) {
  if (robot.caller == nullptr) return;
  result_.sent_again += robot.caller->counts().sent_again;
  result_.hedged += robot.caller->counts().hedged;
  result_.late += robot.caller->estimate().late_replies;
}

void Simulation::begin_robot(Robot& robot) {
  count(robot);
  CallerLimits limits;
  if (options_.hedges) limits.hedge_after = seconds(3);
  robot.run = random_();
  robot.caller = std::make_unique<Caller>(
      robot.name, robot.run, limits,
      [this, &robot](const std::string& to, const Bytes& message) { say(robot, to, message); });
  robot.number = 0;
  robot.live.clear();
  robot.wakes_at = Nanos::max();
}

void Simulation::begin_worker(Worker& worker) {
  worker.instance = ++instances_;
  worker.desk = std::make_unique<Desk>(DeskLimits{.slots = options_.slots, .most_failures = 1000});
  worker.jobs.clear();
}

/// For all whose tasks it had, or has just answered.
void Simulation::count_death(const Worker& worker) {
  for (auto& [key, expected] : expected_) {
    if (expected.ends == 0) expected.deaths += static_cast<int>(expected.at.erase(worker.instance));
  }
}

/// As who submitted them.
void Simulation::look(Robot& robot) {
  std::erase_if(robot.live, [&](const TaskId& task) {
    Expected& expected = expected_[{robot.name, task}];
    if (std::exchange(expected.progress->missing, false)) {
      at(now_ + delay(), [this, &robot, task] {
        if (robot.run == task.run) robot.caller->ready(task, now_);
      });
    }
    if (!expected.progress->end) return false;
    ++expected.ends;
    expected.end = expected.progress->end->problem;
    expected.progress->end.reset();
    return true;
  });
}

/// As whoever drives it: as soon as something is due.
void Simulation::wake(Robot& robot) {
  look(robot);
  const Nanos next = robot.caller->next_wake();
  if (next == Nanos::max() || (next >= robot.wakes_at && robot.wakes_at > now_)) return;
  robot.wakes_at = next;
  at(next, [this, &robot, next, run = robot.run] {
    if (robot.wakes_at != next || robot.run != run) return;
    robot.wakes_at = Nanos::max();
    if (robot.caller->next_wake() <= now_) robot.caller->wake(now_);
    wake(robot);
  });
}

void Simulation::robot_up(Robot& robot) {
  if (connected(robot.peer)) robot.caller->link_up(now_);
  wake(robot);
}

void Simulation::claim(Worker& worker) {
  while (const auto next = worker.desk->claim(now_)) {
    for (Robot& robot : robots_) {
      if (robot.name != next->robot) continue;
      carry(worker.peer, robot.peer, [this, &robot, run = next->run, from = worker.instance] {
        if (robot.run != run) return;
        robot.caller->claimed({run, from}, now_);
        wake(robot);
      });
    }
  }
  const Nanos next = worker.desk->next_wake();
  if (next == Nanos::max()) return;
  at(next, [this, &worker, instance = worker.instance] {
    if (worker.instance == instance && worker.peer.runs) claim(worker);
  });
}

void Simulation::take(Worker& worker, Robot& robot, const TaskMessage& given) {
  if (!worker.desk->take(robot.name, given.task.run, given.waiting, now_)) return;
  const std::uint64_t number = ++job_;
  Job& job = worker.jobs[number];
  job = {&robot, given.task, given.send, now_};
  result_.over_slots += std::ssize(worker.jobs) > options_.slots;
  reply(worker, job, ReplyKind::kRunning);
  Expected& expected = expected_[{robot.name, given.task}];
  expected.at.insert(worker.instance);
  // Some take up to 90 s.
  const Nanos takes = milliseconds(10 + random_() % (chance(0.02) ? 90'000 : 2000));
  for (Nanos says = kProgress; says < takes; says += kProgress) {
    at(now_ + says, [this, &worker, number, instance = worker.instance] {
      const auto found = worker.jobs.find(number);
      if (worker.instance == instance && found != worker.jobs.end()) {
        reply(worker, found->second, ReplyKind::kRunning);
      }
    });
  }
  const bool over = given.time_left && *given.time_left < takes;
  const bool heavy = expected.sort == Sort::kHeavy && chance(0.5);
  at(now_ + takes,
     [this, &worker, number, heavy, over, sort = expected.sort, instance = worker.instance] {
       const auto found = worker.jobs.find(number);
       if (worker.instance != instance || found == worker.jobs.end()) return;
       const Job done = found->second;
       worker.jobs.erase(found);
       worker.desk->finished(done.robot->name, now_ - done.taken, false, now_);
       if (!done.unwanted) {
         reply(worker, done,
               over                      ? ReplyKind::kExpired
               : sort == Sort::kPoisoned ? ReplyKind::kFailedTry
               : heavy                   ? (chance(0.5) ? ReplyKind::kMissing : ReplyKind::kLater)
                                         : ReplyKind::kDone);
       }
       claim(worker);
     });
}

void Simulation::reply(Worker& worker, const Job& job, ReplyKind kind) {
  carry(worker.peer, job.robot->peer, [this, job, kind] {
    if (job.robot->run != job.task.run) return;
    job.robot->caller->replied(
        {.task = job.task, .send = job.send, .kind = kind, .worker = "w", .problem = "boom"}, now_);
    wake(*job.robot);
  });
}

void Simulation::announce() {
  for (Worker& worker : workers_) {
    for (Robot& robot : robots_) {
      carry(worker.peer, robot.peer, [this, &robot, instance = worker.instance] {
        robot.caller->heard({.instance = instance}, now_);
        wake(robot);
      });
    }
  }
  at(now_ + seconds(2), [this] { announce(); });
}

void Simulation::submit(Robot& robot) {
  const TaskId task{robot.run, ++robot.number};
  Expected& expected = expected_[{robot.name, task}];
  expected.sort = chance(0.02) ? Sort::kPoisoned : chance(0.1) ? Sort::kHeavy : Sort::kPlain;
  expected.deadline = chance(0.1);
  const Nanos lasts = milliseconds(500 + random_() % 20'000);
  TaskMessage message{.task = task};
  if (expected.deadline) message.time_left = lasts;
  robot.live.push_back(task);
  expected.progress = robot.caller->submit(std::move(message), now_);
  // Whoever submitted it takes it back then.
  if (expected.deadline) {
    at(now_ + lasts, [this, &robot, task] {
      if (robot.run != task.run) return;
      robot.caller->cancel(task);
      look(robot);
    });
  }
  wake(robot);
}

void Simulation::server_down() {
  server_up_ = false;
  for (Robot& robot : robots_) lose(robot.peer);
  for (Worker& worker : workers_) lose(worker.peer);
  for (Robot& robot : robots_) robot.caller->link_down();
  at(now_ + milliseconds(100 + random_() % 20'000), [this] {
    server_up_ = true;
    for (Robot& robot : robots_) at(now_ + delay(), [this, &robot] { robot_up(robot); });
  });
}

void Simulation::fault() {
  Robot& robot = robots_[random_() % robots_.size()];
  Worker& worker = workers_[random_() % workers_.size()];
  const Nanos lasts = milliseconds(50 + random_() % (chance(0.05) ? 120'000 : 5000));
  switch (random_() % 5) {
    case 0:
      if (server_up_) server_down();
      ++result_.faults["server killed"];
      break;
    case 1:
      ++result_.faults["worker killed"];
      if (!std::exchange(worker.peer.runs, false)) break;
      lose(worker.peer);
      count_death(worker);
      worker.jobs.clear();
      at(now_ + lasts, [this, &worker] {
        worker.peer.runs = true;
        begin_worker(worker);
      });
      break;
    case 2:
      ++result_.faults["worker's link cut"];
      if (std::exchange(worker.peer.cut, true)) break;
      lose(worker.peer);
      // For so long that it is taken for dead.
      if (lasts > seconds(4)) count_death(worker);
      at(now_ + lasts, [&worker] { worker.peer.cut = false; });
      break;
    case 3:
      ++result_.faults["robot's link cut"];
      if (std::exchange(robot.peer.cut, true)) break;
      lose(robot.peer);
      robot.caller->link_down();
      at(now_ + lasts, [this, &robot] {
        robot.peer.cut = false;
        robot_up(robot);
      });
      break;
    default:
      ++result_.faults["robot started again"];
      lose(robot.peer);
      for (auto& [key, expected] : expected_) {
        if (key.first == robot.name && expected.ends == 0) expected.withdrawn = true;
      }
      begin_robot(robot);
      robot_up(robot);
  }
}

SimulationResult Simulation::run() {
  for (Worker& worker : workers_) begin_worker(worker);
  for (Robot& robot : robots_) {
    begin_robot(robot);
    robot_up(robot);
  }
  announce();
  std::exponential_distribution<double> exponential(1);
  std::int64_t faults = 0;
  std::function<void()> next_fault = [&] {
    fault();
    over_ = ++faults == options_.faults;
    if (!over_) at(now_ + scaled(options_.between_faults, exponential(random_)), next_fault);
  };
  at(now_, next_fault);
  std::vector<std::function<void()>> arrivals(robots_.size());
  for (std::size_t i = 0; i < robots_.size(); ++i) {
    arrivals[i] = [&, i] {
      if (over_) return;
      submit(robots_[i]);
      at(now_ + scaled(options_.between_tasks, exponential(random_)), arrivals[i]);
    };
    at(now_, arrivals[i]);
  }
  std::optional<Nanos> end;
  while (!events_.empty()) {
    const Event event = events_.top();
    events_.pop();
    now_ = event.time;
    if (over_ && !end) end = now_ + kQuiet;
    if (end && now_ > *end) break;
    event.what();
  }
  for (const Robot& robot : robots_) count(robot);
  check();
  return result_;
}

void Simulation::check() {
  for (const auto& [key, expected] : expected_) {
    ++result_.submitted;
    result_.ended_twice += expected.progress->end.has_value();  // The first one was taken.
    if (expected.withdrawn) {
      ++result_.withdrawn;
      result_.ended_wrongly += expected.ends > 0;
      continue;
    }
    result_.never_ended += expected.ends == 0;
    if (!expected.end) continue;
    const std::string& end = *expected.end;
    const bool given_up = end.starts_with("given up");
    const bool returned = end == "cancelled" || end.starts_with("its time was over");
    result_.done += end.empty();
    result_.given_up += given_up;
    result_.returned += returned;
    const bool poisoned = expected.sort == Sort::kPoisoned;
    const bool right = end.empty() ? !poisoned
                       : given_up  ? poisoned || expected.deaths >= 3
                                   : returned && expected.deadline;
    result_.ended_wrongly += !right;
  }
  for (const Worker& worker : workers_) result_.left_at_workers += worker.jobs.size();
}

}  // namespace pirt::cloud::test
