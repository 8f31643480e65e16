#include "nats_simulation.h"

#include <algorithm>
#include <utility>

namespace pirt::cloud::test {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr Nanos kAckWait = seconds(30);
constexpr Nanos kWindow = seconds(120);  ///< In which the server knows message ids.
constexpr Nanos kUnsynced = milliseconds(500);
/// The last fault is long over then: silence has been doubled to its longest by nobody.
constexpr Nanos kQuiet = std::chrono::hours(2);

}  // namespace

Simulation::Simulation(const SimulationOptions& options)
    : options_(options), random_(options.seed) {
  for (int i = 0; i < options_.robots; ++i) {
    Robot& robot = robots_.emplace_back();
    robot.name = "r" + std::to_string(i);
    robot.outbox = make_memory_outbox(std::uint64_t{64} << 20);
  }
  workers_.resize(static_cast<std::size_t>(options_.workers));
}

void Simulation::at(Nanos time, std::function<void()> what) {
  events_.push({std::max(time, now_), sequence_++, std::move(what)});
}

Nanos Simulation::delay() {
  // One in a hundred is a spike.
  return milliseconds(1 + random_() % (chance(0.01) ? 8000 : 60));
}

bool Simulation::chance(double probability) {
  return std::uniform_real_distribution<double>(0, 1)(random_) < probability;
}

void Simulation::carry(Peer& peer, std::function<void()> what) {
  if (!connected(peer)) return;
  at(now_ + delay(), [this, &peer, epoch = peer.epoch, what = std::move(what)] {
    if (connected(peer) && peer.epoch == epoch) what();
  });
}

void Simulation::count(const Robot& robot) {
  if (robot.caller == nullptr) return;
  result_.sent_again += robot.caller->counts().sent_again;
  result_.late += robot.caller->counts().late;
}

void Simulation::count(const Worker& worker) {
  if (worker.attendant != nullptr) {
    result_.not_computed_again += worker.attendant->counts().same_again;
  }
}

void Simulation::begin_robot(Robot& robot) {
  count(robot);
  CallerActions out;
  robot.caller = std::make_unique<Caller>(*robot.outbox, CallerLimits{}, now_, out);
  ++robot.run;
  robot.number = 0;
  apply(robot, std::move(out));
}

void Simulation::begin_worker(Worker& worker) {
  count(worker);
  ++worker.life;
  worker.attendant = std::make_unique<Attendant>(AttendantLimits{.slots = options_.slots});
  worker.wakes_at = Nanos::max();
  deliver_tasks();
}

void Simulation::lose(Peer& peer) { ++peer.epoch; }

void Simulation::reconnect(Peer& peer, Nanos after, std::function<void()> then) {
  at(now_ + after, [this, &peer, then = std::move(then)] {
    if (!connected(peer)) return;
    then();
  });
}

void Simulation::apply(Robot& robot, CallerActions actions) {
  for (CallerAction& action : actions) {
    if (auto* const publishes = std::get_if<Publish>(&action)) publish(robot, *publishes);
    if (auto* const end = std::get_if<TellEnd>(&action)) ended(robot, *end);
    if (auto* const withdraws = std::get_if<Withdraw>(&action)) {
      carry(robot.peer, [this, what = *withdraws, name = robot.name] {
        const auto found = tasks_.find(what.sequence);
        if (found != tasks_.end() && found->second.robot == name) tasks_.erase(found);
      });
    }
  }
  const Nanos next = robot.caller->next_wake();
  if (next >= robot.wakes_at && robot.wakes_at > now_) return;
  robot.wakes_at = next;
  if (next == Nanos::max()) return;
  at(next, [this, &robot, next] {
    if (robot.wakes_at != next) return;
    robot.wakes_at = Nanos::max();
    CallerActions out;
    robot.caller->wake(now_, out);
    apply(robot, std::move(out));
  });
}

void Simulation::publish(Robot& robot, const Publish& what) {
  TaskMessage message{.task = what.task, .send = what.send, .time_left = what.time_left};
  message.body = robot.outbox->body(what.task);
  const std::string id = what.task.hex() + "." + std::to_string(what.send);
  const auto arrive = [this, &robot, message, id] {
    const auto known = ids_.find(id);
    std::uint64_t sequence = 0;
    if (known != ids_.end() && now_ - known->second.second < kWindow && !chance(0.05)) {
      sequence = known->second.first;
    } else {
      sequence = ++stream_sequence_;
      if (ids_.size() > 4096) {
        std::erase_if(ids_,
                      [this](const auto& each) { return now_ - each.second.second >= kWindow; });
      }
      ids_[id] = {sequence, now_};
      tasks_[sequence] = {robot.name, message, now_, Nanos{0}, 0};
    }
    deliver_tasks();
    carry(robot.peer, [this, &robot, message, sequence] {
      CallerActions out;
      robot.caller->confirmed(message.task, message.send, sequence, now_, out);
      apply(robot, std::move(out));
    });
  };
  carry(robot.peer, arrive);
  if (chance(0.02)) carry(robot.peer, arrive);
}

void Simulation::ended(Robot& robot, const TellEnd& end) {
  Expected& expected = expected_[{robot.name, end.task}];
  ++expected.ends;
  expected.end = end.how;
  live_.erase({robot.name, end.task});
}

void Simulation::apply(Worker& worker, AttendantActions actions) {
  for (AttendantAction& action : actions) {
    if (auto* const runs = std::get_if<Compute>(&action)) run(worker, runs->task);
    if (auto* const reply = std::get_if<PublishReply>(&action)) store_reply(worker, *reply);
    if (auto* const done = std::get_if<Acknowledge>(&action)) {
      carry(worker.peer, [this, delivery = done->delivery] {
        const auto found = deliveries_.find(delivery);
        if (found == deliveries_.end()) return;
        tasks_.erase(found->second);
        deliveries_.erase(found);
        deliver_tasks();
      });
    }
    const auto* const later = std::get_if<LeaveForLater>(&action);
    const auto* const progress = std::get_if<SayProgress>(&action);
    if (later != nullptr || progress != nullptr) {
      const Delivery delivery = later ? later->delivery : progress->delivery;
      carry(worker.peer, [this, delivery, hidden = later ? Nanos(seconds(1)) : kAckWait] {
        const auto found = deliveries_.find(delivery);
        if (found == deliveries_.end()) return;
        const auto task = tasks_.find(found->second);
        if (task == tasks_.end() || task->second.delivery != delivery) return;
        task->second.hidden_until = now_ + hidden;
        at(now_ + hidden, [this] { deliver_tasks(); });
      });
    }
    if (auto* const running = std::get_if<SayRunning>(&action)) {
      for (Robot& robot : robots_) {
        if (robot.name != running->task.robot) continue;
        carry(worker.peer, [this, &robot, what = *running] {
          carry(robot.peer, [this, &robot, what] {
            CallerActions out;
            robot.caller->replied(
                {.task = what.task.task, .send = what.send, .kind = ReplyKind::kRunning}, now_,
                out);
            apply(robot, std::move(out));
          });
        });
      }
    }
  }
  const Nanos next = worker.attendant->next_wake();
  if (next >= worker.wakes_at && worker.wakes_at > now_) return;
  worker.wakes_at = next;
  if (next == Nanos::max()) return;
  at(next, [this, &worker, next, life = worker.life] {
    if (worker.life != life || worker.wakes_at != next) return;
    worker.wakes_at = Nanos::max();
    AttendantActions out;
    if (!worker.peer.runs) return;
    worker.attendant->wake(now_, out);
    apply(worker, std::move(out));
  });
}

void Simulation::run(Worker& worker, const TaskKey& key) {
  const Sort sort = worker.sorts[key];
  // Up to 90 s: longer than the server waits for a sign of life.
  const Nanos takes = milliseconds(10 + random_() % (chance(0.02) ? 90'000 : 2000));
  at(now_ + takes, [this, &worker, key, sort, life = worker.life] {
    if (worker.life != life || !worker.peer.runs) return;
    ReplyMessage reply{.task = key.task};
    reply.kind = sort == Sort::kPoisoned ? ReplyKind::kFailedTry : ReplyKind::kDone;
    AttendantActions out;
    worker.attendant->finished(key, std::move(reply), now_, out);
    apply(worker, std::move(out));
  });
}

void Simulation::store_reply(Worker& worker, const PublishReply& what) {
  carry(worker.peer, [this, &worker, what, life = worker.life] {
    for (Robot& robot : robots_) {
      if (robot.name != what.task.robot) continue;
      ReplyMessage message = *what.reply;
      message.send = what.send;
      robot.replies[++stream_sequence_] = {message, now_, Nanos{0}};
      if (chance(0.02)) robot.replies[++stream_sequence_] = {message, now_, Nanos{0}};
      deliver_replies(robot);
    }
    carry(worker.peer, [this, &worker, what, life] {
      if (worker.life != life) return;
      AttendantActions out;
      worker.attendant->stored(what.task, what.send, now_, out);
      apply(worker, std::move(out));
      deliver_tasks();
    });
  });
}

void Simulation::deliver_tasks() {
  if (!server_up_) return;
  std::map<Worker*, int> free;
  for (Worker& worker : workers_) {
    if (connected(worker.peer) && worker.attendant != nullptr) {
      free[&worker] = worker.attendant->free_slots();
    }
  }
  for (auto& [sequence, task] : tasks_) {
    if (task.hidden_until > now_) continue;
    const auto taker =
        std::ranges::max_element(free, {}, [](const auto& each) { return each.second; });
    if (taker == free.end() || taker->second <= 0) return;
    --taker->second;
    Worker& worker = *taker->first;
    task.hidden_until = now_ + kAckWait;
    task.delivery = ++delivery_;
    deliveries_[task.delivery] = sequence;
    at(task.hidden_until, [this] { deliver_tasks(); });
    carry(worker.peer, [this, &worker, task, life = worker.life] {
      if (worker.life != life) return;
      const TaskKey key{task.robot, task.message.task};
      worker.sorts[key] = static_cast<Sort>(std::get<Bytes>(task.message.body).at(0));
      AttendantActions out;
      worker.attendant->delivered(key, task.message.send, task.delivery, now_, out);
      apply(worker, std::move(out));
    });
  }
}

void Simulation::deliver_replies(Robot& robot) {
  if (!connected(robot.peer)) return;
  for (auto& [sequence, reply] : robot.replies) {
    if (reply.hidden_until > now_) continue;
    reply.hidden_until = now_ + kAckWait;
    at(reply.hidden_until, [this, &robot] { deliver_replies(robot); });
    carry(robot.peer, [this, &robot, message = reply.message, number = sequence] {
      CallerActions out;
      robot.caller->replied(message, now_, out);
      apply(robot, std::move(out));
      carry(robot.peer, [&robot, number] { robot.replies.erase(number); });
    });
  }
}

void Simulation::announce() {
  if (over_ && events_.empty()) return;
  for (Worker& worker : workers_) {
    for (Robot& robot : robots_) {
      if (!connected(worker.peer) || !connected(robot.peer)) continue;
      CallerActions out;
      robot.caller->worker_heard(now_, out);
      apply(robot, std::move(out));
    }
  }
  at(now_ + seconds(3), [this] { announce(); });
}

void Simulation::submit(Robot& robot, bool keyed) {
  const Sort sort = chance(0.02) ? Sort::kPoisoned : Sort::kPlain;
  const TaskId task{robot.run, ++robot.number};
  const bool deadline = !keyed && chance(0.1);
  Expected& expected = expected_[{robot.name, task}];
  expected.sort = sort;
  expected.deadline = deadline;
  expected.keyed = keyed;
  live_.insert({robot.name, task});
  const Bytes body{static_cast<std::byte>(sort)};
  const std::optional<Nanos> give_back =
      deadline ? std::optional<Nanos>(now_ + milliseconds(500 + random_() % 20'000)) : std::nullopt;
  CallerActions out;
  const auto taken =
      robot.caller->submit(task, keyed ? task.hex() : "", body, give_back, give_back, now_, out);
  if (taken != Caller::Submission::kTaken) ++result_.ended_wrongly;
  apply(robot, std::move(out));
}

void Simulation::server_down(bool power_loss) {
  server_up_ = false;
  for (Robot& robot : robots_) lose(robot.peer);
  for (Worker& worker : workers_) lose(worker.peer);
  if (power_loss) {
    const auto unsynced = [this](const auto& each) {
      const bool lost = each.second.stored_at > now_ - kUnsynced;
      result_.lost_by_server += lost;
      return lost;
    };
    std::erase_if(tasks_, unsynced);
    for (Robot& robot : robots_) std::erase_if(robot.replies, unsynced);
    ids_.clear();
  }
  for (Robot& robot : robots_) {
    CallerActions out;
    robot.caller->link_down(now_, out);
    apply(robot, std::move(out));
  }
  at(now_ + milliseconds(100 + random_() % 20'000), [this] {
    server_up_ = true;
    deliver_tasks();
    for (Robot& robot : robots_) {
      reconnect(robot.peer, delay(), [this, &robot] {
        CallerActions out;
        robot.caller->link_up(now_, out);
        apply(robot, std::move(out));
        deliver_replies(robot);
      });
    }
  });
}

void Simulation::fault() {
  Robot& robot = robots_[random_() % robots_.size()];
  Worker& worker = workers_[random_() % workers_.size()];
  const auto up = [this, &robot] {
    if (!connected(robot.peer)) return;
    CallerActions out;
    robot.caller->link_up(now_, out);
    apply(robot, std::move(out));
    deliver_replies(robot);
  };
  const Nanos lasts = milliseconds(50 + random_() % (chance(0.05) ? 120'000 : 5000));
  switch (random_() % 6) {
    case 0:
      if (server_up_) server_down(false);
      ++result_.faults["server killed"];
      break;
    case 1:
      if (server_up_) server_down(true);
      ++result_.faults["server's power lost"];
      break;
    case 2:
      ++result_.faults["worker killed"];
      if (!std::exchange(worker.peer.runs, false)) break;
      lose(worker.peer);
      ++worker.life;
      at(now_ + lasts, [this, &worker] {
        worker.peer.runs = true;
        begin_worker(worker);
      });
      break;
    case 3:
      ++result_.faults["worker's link cut"];
      if (std::exchange(worker.peer.cut, true)) break;
      lose(worker.peer);
      at(now_ + lasts, [this, &worker] {
        worker.peer.cut = false;
        deliver_tasks();
      });
      break;
    case 4: {
      ++result_.faults["robot's link cut"];
      if (std::exchange(robot.peer.cut, true)) break;
      lose(robot.peer);
      CallerActions out;
      robot.caller->link_down(now_, out);
      apply(robot, std::move(out));
      at(now_ + lasts, [&robot, up] {
        robot.peer.cut = false;
        up();
      });
      break;
    }
    default:
      ++result_.faults["robot started again"];
      lose(robot.peer);
      // What it waited for without a key is withdrawn; it asks again for what has one.
      std::vector<TaskKey> keyed;
      for (const TaskKey& key : live_) {
        if (key.robot != robot.name) continue;
        if (expected_[key].keyed) {
          keyed.push_back(key);
        } else {
          expected_[key].withdrawn = true;
        }
      }
      std::erase_if(live_, [this](const TaskKey& key) { return expected_[key].withdrawn; });
      begin_robot(robot);
      up();
      at(now_ + milliseconds(random_() % 60'000), [this, &robot, keyed, run = robot.run] {
        if (robot.run != run) return;  // It fell again; it asks when it is up.
        for (const TaskKey& key : keyed) {
          const Bytes body{static_cast<std::byte>(expected_[key].sort)};
          CallerActions out;
          static_cast<void>(
              robot.caller->submit(key.task, key.task.hex(), body, {}, {}, now_, out));
          apply(robot, std::move(out));
        }
      });
  }
}

SimulationResult Simulation::run() {
  for (Robot& robot : robots_) begin_robot(robot);
  for (Worker& worker : workers_) begin_worker(worker);
  for (Robot& robot : robots_) {
    CallerActions out;
    robot.caller->link_up(now_, out);
    apply(robot, std::move(out));
  }
  announce();
  std::exponential_distribution<double> exponential(1);
  std::int64_t faults = 0;
  std::function<void()> next_fault = [&] {
    fault();
    if (++faults == options_.faults) {
      over_ = true;
      return;
    }
    at(now_ + scaled(options_.between_faults, exponential(random_)), next_fault);
  };
  at(now_, next_fault);
  std::vector<std::function<void()>> arrivals(robots_.size());
  for (std::size_t i = 0; i < robots_.size(); ++i) {
    arrivals[i] = [&, i] {
      if (over_) return;
      submit(robots_[i], chance(0.2));
      at(now_ + scaled(options_.between_tasks, exponential(random_)), arrivals[i]);
    };
    at(now_, arrivals[i]);
  }
  std::optional<Nanos> end;
  while (!events_.empty()) {
    Event event = events_.top();
    events_.pop();
    now_ = event.time;
    if (over_ && !end) end = now_ + kQuiet;
    if (end && now_ > *end) break;
    event.what();
  }
  for (const Robot& robot : robots_) count(robot);
  for (const Worker& worker : workers_) count(worker);
  check(result_);
  return result_;
}

void Simulation::check(SimulationResult& result) const {
  for (const auto& [key, expected] : expected_) {
    ++result.submitted;
    result.poisoned += expected.sort == Sort::kPoisoned;
    result.ended_twice += expected.ends > 1;
    if (expected.withdrawn) {
      ++result.withdrawn;
      result.ended_wrongly += expected.ends > 0;
      continue;
    }
    result.never_ended += expected.ends == 0;
    if (!expected.end) continue;
    result.done += expected.end == CallEndKind::kDone;
    result.given_up += expected.end == CallEndKind::kGivenUp;
    result.returned += expected.end == CallEndKind::kReturned;
    const bool sound = expected.sort == Sort::kPlain ? expected.end == CallEndKind::kDone
                                                     : expected.end == CallEndKind::kGivenUp;
    const bool returned = expected.deadline && expected.end == CallEndKind::kReturned;
    result.ended_wrongly += !sound && !returned;
  }
  for (const Robot& robot : robots_) {
    result.left_in_outboxes += robot.outbox->all().size();
    result.left_on_streams += robot.replies.size();
  }
  result.left_on_streams += tasks_.size();
}

}  // namespace pirt::cloud::test
