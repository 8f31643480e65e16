#include "workloads/backends/nats/service/worker_link.h"

#include <fmt/core.h>

#include <algorithm>
#include <string_view>
#include <tuple>
#include <utility>

#include "workloads/base/error.h"
#include "workloads/base/system/thread.h"

namespace pirt::cloud {
namespace {

constexpr Nanos kLook = std::chrono::milliseconds(100);
constexpr Nanos kSettling = std::chrono::seconds(1);  ///< Of a link that came or went.
constexpr Nanos kQuiet = std::chrono::seconds(5);     ///< Between what robots do wrong.

/// Of a robot, in a few bytes.
template <typename Said>
Said decode_small(const std::string& robot, ByteView frame) {
  constexpr std::size_t kMostSmall = 256;
  if (!is_robot_name(robot) || frame.size() > kMostSmall) {
    throw_bad_input("a message that is too long");
  }
  return decode_as<Said>(frame);
}

/// Whenever there is a link. Where an administrator makes the streams, a worker may not; and what
/// is there is the administrator's.
/// @param again  Nothing is thrown: the server may be another one tomorrow.
void look_at_server(Connection& connection, const std::function<void(const std::string&)>& say,
                    bool again) {
  bool ends = !again;
  try {
    if (connection.chunk_bytes() == 0) throw_environment(connection.why_no_chunks());
    const std::string first = "$JS.API.STREAM.INFO.PIRT_" + Setup{}.robots[0];
    const auto answer = connection.request(first, {}, std::chrono::seconds(1));
    if (!answer.came) return;
    const StreamAnswer stream = read_answer(answer);
    if (stream.error == 0) return;
    ends = ends && stream.error != kNoStream;  // Robots of other names may have theirs.
    for (const std::string& line : set_up(connection, {})) say(line);
  } catch (const Error& error) {
    if (ends) throw;  // Such as no JetStream at all.
    say(error.what());
  }
}

}  // namespace

/// One that was not there, or idle, has used as much as the least of the others: nobody saves up.
Desk::Robot& Desk::robot_of(const std::string& name, Nanos now) {
  if (!robots_.contains(name) && robots_.size() >= limits_.most_robots) {
    const auto idle = std::ranges::min_element(robots_, {}, [](const auto& each) {
      return std::tuple(each.second.slots, each.second.heard);
    });
    if (idle->second.slots == 0) robots_.erase(idle);
  }
  const auto [at, is_new] = robots_.try_emplace(name);
  Robot& robot = at->second;
  if (is_new || (robot.slots == 0 && robot.heard + limits_.active < now)) {
    Nanos least = Nanos::max();
    for (const auto& [other, each] : robots_) {
      if (other != name && each.heard + limits_.active >= now) least = std::min(least, each.used);
    }
    if (least != Nanos::max()) robot.used = std::max(robot.used, least);
  }
  robot.heard = now;
  return robot;
}

void Desk::hear(const std::string& name, std::uint64_t run, std::uint32_t waiting, Nanos now) {
  Robot& robot = robot_of(name, now);
  if (!robot.runs.contains(run) && robot.runs.size() >= limits_.most_runs) {
    robot.runs.erase(std::ranges::min_element(robot.runs, {},
                                              [](const auto& each) { return each.second.heard; }));
  }
  Run& state = robot.runs[run];
  state.waiting = waiting;
  state.heard = now;
}

/// Nothing waits: so a run answers a claim that it has no task for.
void Desk::offered(const std::string& name, std::uint64_t run, std::uint32_t waiting, Nanos now) {
  hear(name, run, waiting, now);
  if (waiting == 0) answered(name, run, now);
}

std::optional<Desk::Claim> Desk::claim(Nanos now) {
  while (next_wake() <= now) {
    const Claim late = asked_.front();
    auto& runs = robots_.at(late.robot).runs;
    if (const auto its = runs.find(late.run); its != runs.end()) {
      its->second.waiting = 0;
      its->second.late = true;
    }
    answered(late.robot, late.run, now);
  }
  if (!has_free_slot()) return std::nullopt;
  const auto active = std::max<std::ptrdiff_t>(
      1, std::ranges::count_if(
             robots_, [&](const auto& each) { return each.second.heard + limits_.active >= now; }));
  const auto share = (limits_.slots + active - 1) / active;
  std::pair<const std::string, Robot>* robot = nullptr;
  std::pair<const std::uint64_t, Run>* run = nullptr;
  // Of a robot's runs, the one that was asked longest ago.
  const auto order = [](const auto& of, const auto& its) {
    return std::tuple(of.second.slots, of.second.used, std::string_view(of.first),
                      its.second.asked);
  };
  for (auto& of : robots_) {
    if (of.second.slots >= share) continue;
    for (auto& its : of.second.runs) {
      if (its.second.waiting == 0 || its.second.heard + limits_.offer < now) continue;
      if (run == nullptr || order(of, its) < order(*robot, *run)) robot = &of, run = &its;
    }
  }
  if (run == nullptr) return std::nullopt;
  --run->second.waiting;
  run->second.asked = now;
  ++robot->second.slots;
  asked_.push_back({robot->first, run->first, now});
  return asked_.back();
}

/// The slot was its robot's since it was asked: who has many tasks that take no time has no more
/// of it than others.
bool Desk::answered(const std::string& name, std::uint64_t run, Nanos now) {
  const auto asked = std::ranges::find_if(
      asked_, [&](const Claim& each) { return each.robot == name && each.run == run; });
  if (asked == asked_.end()) return false;
  Robot& robot = robots_.at(name);
  --robot.slots;
  robot.used += now - asked->since;
  asked_.erase(asked);
  return true;
}

bool Desk::expects(const std::string& robot) const {
  if (std::ranges::find(asked_, robot, &Claim::robot) != asked_.end()) return true;
  const auto at = robots_.find(robot);
  return has_free_slot() && at != robots_.end() &&
         std::ranges::any_of(at->second.runs, [](const auto& each) { return each.second.late; });
}

bool Desk::take(const std::string& name, std::uint64_t run, std::uint32_t waiting, Nanos now) {
  if (!answered(name, run, now)) {
    Robot& robot = robot_of(name, now);
    const auto at = robot.runs.find(run);
    if (at == robot.runs.end() || !has_free_slot() || !std::exchange(at->second.late, false)) {
      return false;
    }
  }
  hear(name, run, waiting, now);
  ++robots_.at(name).slots;
  ++computing_;
  return true;
}

void Desk::finished(const std::string& name, Nanos used, bool failed, Nanos now) {
  --computing_;
  Robot& robot = robots_.at(name);
  --robot.slots;
  robot.used += failed ? limits_.failure_costs * used : used;
  if (failed) robot.failures.push_back(now);
}

std::string Desk::why_refused(const std::string& name, Nanos now) {
  auto& failures = robot_of(name, now).failures;
  while (!failures.empty() && failures.front() + limits_.failure_window <= now) {
    failures.pop_front();
  }
  if (failures.size() < limits_.most_failures) return "";
  return fmt::format(
      "robot {}: {} of its calls ended a process of this worker within {:.0f} s; it is refused "
      "until they are older",
      name, failures.size(), to_s(limits_.failure_window));
}

Nanos Desk::next_wake() const {
  return asked_.empty() ? Nanos::max() : asked_.front().since + limits_.claim;
}

WorkerLink::WorkerLink(const WorkerOptions& options, std::span<const Workload* const> workloads)
    : options_(options),
      admission_(workloads, options.call_bytes),
      hello_(encode(HelloMessage{.instance = instance_,
                                 .worker = options.name,
                                 .version = options.version,
                                 .workloads = admission_.known()})),
      desk_(options.limits) {
  options_.connection.name = "pirt worker " + options_.name;
  connection_ = std::make_unique<Connection>(options_.connection, [this](bool is_up) {
    if (is_up) change([this](Nanos now) { hello_at_ = now; });
  });
  constexpr std::int64_t kSmall = std::int64_t{8} << 20, kLarge = std::int64_t{64} << 20;
  const auto subscribe = [this](const std::string& to, std::int64_t most_bytes, auto handler) {
    connection_->subscribe(
        to,
        [this, handler](const Incoming& message) {
          const std::string robot = robot_of(message.subject);  // It may be anything.
          try {
            handler(robot, message.data);
          } catch (const Error& error) {
            const std::lock_guard lock(mutex_);
            ++counts_.malformed;
            connection_->note("robot " + robot + ": " + error.what());
          }
        },
        most_bytes);
  };
  const auto on_offer = [this](const std::string& robot, ByteView frame) {
    const auto offer = decode_small<OfferMessage>(robot, frame);
    change([&](Nanos now) { desk_.offered(robot, offer.run, offer.waiting, now); });
  };
  subscribe(subject("offer", "*"), kSmall, on_offer);
  subscribe(task_subject("*", instance_), kLarge,
            [this, on_offer](const std::string& robot, ByteView frame) {
              return is_frame_of<OfferMessage>(frame) ? on_offer(robot, frame)
                                                      : on_task(robot, frame);
            });
  subscribe(subject("cancel", "*"), kSmall, [this](const std::string& robot, ByteView frame) {
    const auto cancel = decode_small<CancelMessage>(robot, frame);
    const std::lock_guard lock(mutex_);
    for (const auto& job : jobs_) {
      if (job->robot == robot && job->task.task == cancel.task) job->unwanted = true;
    }
  });
  for (int slot = 0; slot < options_.limits.slots; ++slot) {
    slots_.push_back(
        start_thread([this, slot](const std::stop_token& stop) { compute(stop, slot); }));
  }
  server_ = start_thread([this](const std::stop_token& stop) { serve(stop); });
}

WorkerCounts WorkerLink::end() {
  stopping_ = true;
  server_ = {};  // Nothing is claimed any more.
  for (std::jthread& slot : slots_) slot.request_stop();
  slots_.clear();
  return counts();
}

void WorkerLink::serve(const std::stop_token& stop) {
  name_thread("pirt-worker");
  while (!stop.stop_requested()) {
    std::vector<Desk::Claim> claims;
    std::vector<std::shared_ptr<Job>> running;
    std::unique_lock lock(mutex_);
    const Nanos now = clock_.now();
    const bool greets = hello_at_ <= now;
    if (greets) hello_at_ = now + options_.hello, running = jobs_;
    changed_now_ = false;
    while (auto claim = desk_.claim(now)) claims.push_back(std::move(*claim));
    if (claims.empty() && !greets) {
      const Nanos wake = std::min(hello_at_, desk_.next_wake());
      changed_.wait_for(lock, stop, wake - now, [this] { return changed_now_; });
      continue;
    }
    lock.unlock();
    try {
      for (const Desk::Claim& claim : claims) {
        connection_->publish(subject("claim", claim.robot),
                             encode(ClaimMessage{claim.run, instance_}));
      }
      if (greets && connection_->is_up()) connection_->publish(kHelloSubject, hello_);
      for (const auto& job : running) say(*job, {.kind = ReplyKind::kRunning});
    } catch (const std::exception& error) {  // Such as no memory: it goes on.
      connection_->note(error.what());
    }
  }
}

/// The subject is the server's, which vouches for the robot. What nobody asked for is not even
/// read.
void WorkerLink::on_task(const std::string& robot, ByteView frame) {
  if (const std::lock_guard lock(mutex_); !is_robot_name(robot) || !desk_.expects(robot)) {
    ++counts_.malformed;
    return;
  }
  auto job = std::make_shared<Job>();
  job->robot = robot;
  job->task = decode_as<TaskMessage>(frame);
  job->stop = [this] { return stopping_.load(); };
  bool taken = false;
  change([&](Nanos now) {
    taken = !stopping_ && desk_.take(robot, job->task.task.run, job->task.waiting, now);
    // Else its robot gives it to somebody else, since nobody says that it has it.
    counts_.malformed += taken ? 0 : 1;
    if (!taken) return;
    job->taken = now;
    job->refused = desk_.why_refused(robot, now);
    ++counts_.taken;
    jobs_.push_back(job);
    waiting_.push_back(job);
  });
  if (taken) say(*job, {.kind = ReplyKind::kRunning});
}

void WorkerLink::compute(const std::stop_token& stop, int slot) {
  name_thread(fmt::format("pirt-slot-{}", slot));
  std::unique_ptr<Computer> computer;
  while (true) {
    std::unique_lock lock(mutex_);
    if (!changed_.wait(lock, stop, [this] { return !waiting_.empty(); })) return;
    const std::shared_ptr<Job> job = std::move(waiting_.front());
    waiting_.pop_front();
    lock.unlock();
    ReplyMessage reply;
    bool gone = false;
    try {
      if (computer == nullptr) computer = options_.make_computer();
      reply = run(*computer, *job);
    } catch (const std::exception& error) {
      reply = failure(error);
      gone = dynamic_cast<const ProcessGone*>(&error) != nullptr;
    }
    const bool unwanted = job->unwanted;
    // The slot is free for the next task before its robot hears of the end, and may submit one.
    change([&](Nanos now) {
      desk_.finished(job->robot, now - job->taken, gone, now);
      std::erase(jobs_, job);
      ++(unwanted ? counts_.cancelled : counts_.ended_as[static_cast<std::size_t>(reply.kind)]);
    });
    try {
      if (!unwanted) say(*job, std::move(reply));
    } catch (const std::exception& error) {
      connection_->note(error.what());
    }
  }
}

ReplyMessage WorkerLink::run(Computer& computer, Job& job) {
  TaskMessage& task = job.task;
  const auto is_over = [&] {
    return task.time_left && *task.time_left <= clock_.now() - job.taken;
  };
  if (stopping_) return {.kind = ReplyKind::kLater, .problem = "the worker ends"};
  if (!job.refused.empty()) throw_bad_input(job.refused);
  job.workload = admission_.admit(task);
  if (is_over() || job.unwanted) return {.kind = ReplyKind::kExpired};
  if (const auto blob = std::exchange(task.inputs.blob, {})) {
    task.inputs.bytes = fetch(job, "in", task.task.hex(), *blob);
    if (is_over()) return {.kind = ReplyKind::kExpired};  // Reading it took its time.
  }
  ReplyMessage reply = computer.compute(job);
  if (reply.kind == ReplyKind::kMissing && task.parameters) {  // It has not kept them.
    job.parameters = fetch(job, "par", task.parameters->digest.hex(), *task.parameters);
    reply = computer.compute(job);
  }
  const Bytes& bytes = reply.outputs.bytes;
  const bool fits = bytes.size() <= connection_->chunk_bytes();  // Within the reply.
  if (reply.kind != ReplyKind::kDone || job.unwanted || fits) return reply;
  const Blob blob{digest_of(bytes), bytes.size(), connection_->blob_chunk_bytes()};
  const std::string name = fmt::format("{}-{}", task.task.hex(), task.send);
  const std::string problem = put_blob(*connection_, blob_subject(job.robot, "out", name), blob,
                                       bytes, [&] { return stopping_ || job.unwanted; });
  if (!problem.empty()) {
    throw NotDone(ReplyKind::kLater, "its outputs could not be stored: " + problem);
  }
  reply.outputs = {{}, blob};
  return reply;
}

Bytes WorkerLink::fetch(const Job& job, std::string_view what, const std::string& name,
                        const Blob& blob) {
  // Over the slowest link that carries anything.
  constexpr std::uint64_t kLeastBytesPerS = 128 << 10;
  const auto moving = static_cast<std::int64_t>(blob.size_bytes / kLeastBytesPerS);
  const Nanos until = clock_.now() + options_.fetch + std::chrono::seconds(moving);
  auto answer = fetch_blob(*connection_, blob_subject(job.robot, what, name), blob,
                           [&] { return stopping_ || job.unwanted || clock_.now() >= until; });
  if (answer.came && answer.status == 0) return std::move(answer.data);
  throw NotDone(answer.came ? ReplyKind::kMissing : ReplyKind::kLater,
                fmt::format("{} {}", what == "par" ? "its parameters" : "its inputs",
                            answer.came ? "are not on the server" : "could not be read there"));
}

bool WorkerLink::say(const Job& job, ReplyMessage reply) {
  reply.task = job.task.task;
  reply.send = job.task.send;
  reply.worker = options_.name;
  return connection_->publish(subject("answer", job.robot), encode(reply));
}

void serve(const WorkerOptions& options, std::span<const Workload* const> workloads,
           const std::function<bool()>& stop, const std::function<void(const std::string&)>& say) {
  WorkerLink worker(options, workloads);
  Connection& connection = worker.connection();
  const std::string server = public_url(options.connection.server);
  const MachineClock clock;
  Nanos quiet_until = clock.now() + kSettling;
  bool was_up = false, was_ever_up = false;
  std::string said;
  while (!stop()) {
    const bool up = connection.is_up();
    if (up != was_up) {
      say((up ? "connected to " : "lost ") + server);
      was_up = up;
      quiet_until = clock.now() + kSettling;
      if (up) look_at_server(connection, say, was_ever_up);
      if (up && !std::exchange(was_ever_up, true)) {
        say(fmt::format("worker {} with {} slot{}", options.name, options.limits.slots,
                        options.limits.slots == 1 ? "" : "s"));
      }
    }
    std::string why = up ? connection.problem() : connection.why_down();
    if (why != said && clock.now() >= quiet_until) {
      if (!why.empty()) say(up ? why : server + ": " + why);
      quiet_until = clock.now() + kQuiet;
      said = std::move(why);
    }
    std::this_thread::sleep_for(kLook);
  }
  const WorkerCounts counts = worker.end();
  const auto& [done, tries, failed, refused, missed, returned, expired, running] = counts.ended_as;
  say(fmt::format(
      "{} taken, {} done, {} failed, {} refused, {} missed, {} returned, {} expired, {} cancelled, "
      "{} malformed",
      counts.taken, done, tries + failed, refused, missed, returned, expired, counts.cancelled,
      counts.malformed));
}

}  // namespace pirt::cloud
