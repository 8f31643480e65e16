#include "workloads/backends/nats/robot/robot_link.h"

#include <fmt/core.h>

#include <algorithm>
#include <type_traits>

#include "workloads/base/error.h"
#include "workloads/base/system/thread.h"

namespace pirt::cloud {
namespace {

constexpr std::size_t kMostWorkers = 1024;
// Calls of a kind that its 95th of 100 follows from.
constexpr std::size_t kFewCalls = 20, kManyCalls = 100;
constexpr std::size_t kSmall = 64 << 10;  ///< No bandwidth follows from a smaller message.
constexpr double kNew = 0.25;             ///< Of what is measured, in what is known from before.
/// Who is called so much later than was asked for was stopped meanwhile (Ctrl-Z, docker pause): it
/// is little, so that a pause is seen that began just before.
constexpr Nanos kAway = std::chrono::milliseconds(500);
constexpr Nanos kAskAgain = std::chrono::seconds(1);
constexpr Nanos kLongestWait = std::chrono::hours(1);
constexpr std::size_t kMostHello = 64 << 10;  ///< Of it 1024 are kept.

bool knows(const HelloMessage& worker, const Kind& kind) {
  return std::ranges::any_of(worker.workloads, [&](const HelloMessage::Known& known) {
    return known.workload == kind.name && (!kind.known_by || known.spec == *kind.known_by);
  });
}

}  // namespace

std::shared_ptr<Progress> Caller::submit(TaskMessage task, Nanos now) {
  Entry& entry = entries_[task.task];
  entry.task = std::move(task);
  entry.offered_at = now;
  if (const auto left = entry.task.time_left) entry.deadline = later_by(now, *left);
  offer(now);
  return entry.progress;
}

void Caller::cancel(const TaskId& task) {
  const auto at = entries_.find(task);
  if (at != entries_.end()) end(at, {.problem = "cancelled"});
}

void Caller::ready(const TaskId& task, Nanos now) {
  const auto at = entries_.find(task);
  if (at == entries_.end() || !at->second.given.empty()) return;
  at->second.offered_at = now;
  offer(now);
}

void Caller::link_up(Nanos now) {
  if (std::exchange(linked_, true)) return;
  restart_waits(now);
  offer(now);
}

/// What was said meanwhile was said to nobody, or is not yet read.
void Caller::restart_waits(Nanos now) {
  for (auto& [task, entry] : entries_) {
    for (Given& each : entry.given) {
      each.until = now + (each.confirmed ? limits_.silence : limits_.confirm);
    }
  }
}

void Caller::link_down() {
  linked_ = false;
  for (auto& [instance, worker] : workers_) worker.is_here = false;
}

/// It says that it computes this, and has not refused it.
bool Caller::suits(const Entry& entry, const Workers::value_type& worker) {
  return knows(worker.second.said, entry.task.kind) && !entry.refused.contains(worker.first);
}

/// A task goes to a worker that suits it, if there is one.
void Caller::claimed(ClaimMessage claim, Nanos now) {
  const auto [run, worker] = claim;
  if (run != run_) return;  // It is of another program of this robot's name.
  const auto asks = workers_.find(worker);
  for (auto& each : entries_) {
    Entry& entry = each.second;
    const auto its = [&](const auto& of) { return suits(entry, of); };
    const auto has = std::ranges::find(entry.given, worker, &Given::worker);
    if (!waits(entry, now) || has != entry.given.end()) continue;
    if ((asks != workers_.end() && its(*asks)) || std::ranges::none_of(workers_, its)) {
      return give(entry, worker, now);
    }
  }
  say_(task_subject(robot_, worker), encode(OfferMessage{run_, 0}));
}

void Caller::give(Entry& entry, std::uint64_t worker, Nanos now) {
  if (++entry.sends > 1) ++counts_.sent_again;
  if (!entry.given.empty()) ++counts_.hedged;
  entry.given.push_back({worker, entry.sends, false, now, now + limits_.confirm});
  entry.offered_at.reset();
  TaskMessage& task = entry.task;
  const auto hedged = entry.sends == 1 ? hedged_after(task.spec) : std::nullopt;
  entry.hedge_at = hedged ? std::optional(now + *hedged) : std::nullopt;
  task.send = entry.sends;
  task.waiting = waiting(now);
  if (entry.deadline) task.time_left = std::clamp(*entry.deadline - now, Nanos::zero(), kLongest);
  Bytes message = encode(task);
  entry.given_bytes = message.size();
  say_(task_subject(robot_, worker), std::move(message));
}

void Caller::replied(ReplyMessage reply, Nanos now) {
  const auto at = entries_.find(reply.task);
  if (at == entries_.end()) {
    if (reply.kind != ReplyKind::kRunning) ++estimate_.late_replies;
    return;
  }
  Entry& entry = at->second;
  const auto given = std::ranges::find(entry.given, reply.send, &Given::send);
  const bool first = !std::exchange(entry.progress->taken, true);
  if (first && given != entry.given.end()) measure(now - given->since, entry.given_bytes);
  if (reply.kind == ReplyKind::kDone) {  // Of whatever send: it is what was asked for.
    if (given != entry.given.end()) {    // Since the first one that has it was asked.
      auto& took = took_[entry.task.spec];
      took.push_back(now - std::ranges::min(entry.given, {}, &Given::since).since);
      if (took.size() > kManyCalls) took.pop_front();
    }
    reply.problem.clear();
    return end(at, std::move(reply));
  }
  if (given == entry.given.end()) return;  // It is with somebody else by now.
  if (reply.kind == ReplyKind::kRunning) {
    given->confirmed = true;
    given->until = now + limits_.silence;
    return;
  }
  if (reply.kind == ReplyKind::kRefused) entry.refused.insert(given->worker);
  entry.given.erase(given);
  const std::string problem = fmt::format("worker {}: {}", reply.worker, reply.problem);
  const auto may_take = [&](const auto& of) {
    return of.second.lives(now, limits_.worker) && suits(entry, of);
  };
  switch (reply.kind) {
    case ReplyKind::kRefused:
      if (!entry.given.empty()) return;  // Another one computes it.
      if (entry.sends >= limits_.most_sends || std::ranges::none_of(workers_, may_take)) {
        return end(at, {.problem = "refused by " + problem});
      }
      entry.offered_at = now;
      return offer(now);
    case ReplyKind::kCallFailed:
      return end(at, {.kind = reply.kind, .problem = problem});
    case ReplyKind::kExpired:
      return end(at, {.problem = "its time was over before a worker began"});
    case ReplyKind::kFailedTry:
      ++entry.tries;
      [[fallthrough]];
    default:
      return failed(at, problem, now, reply.kind == ReplyKind::kMissing);
  }
}

/// A worker has it no more, or misses something of it. What counts as a try was counted.
void Caller::failed(Entries::iterator at, const std::string& problem, Nanos now, bool missing) {
  Entry& entry = at->second;
  const bool tried = entry.tries >= limits_.most_tries;
  if (tried || entry.sends >= limits_.most_sends) {
    const std::string often =
        tried ? fmt::format("{} tries; the last one failed on ", entry.tries)
              : fmt::format("it was sent {} times; the last time ", entry.sends);
    return end(at, {.problem = "given up after " + often + problem});
  }
  if (!entry.given.empty()) return;
  entry.hedge_at.reset();
  entry.offered_at.reset();
  entry.progress->missing = missing;
  if (missing) return;
  // Later each time, and not all robots at once.
  const double jitter = std::uniform_real_distribution<double>(1, 2)(random_);
  entry.offered_at = now + scaled(std::min<std::int64_t>(entry.sends, 10) * limits_.again, jitter);
}

void Caller::heard(HelloMessage hello, Nanos now) {
  const std::uint64_t instance = hello.instance;
  if (workers_.size() >= kMostWorkers) workers_.clear();
  const auto silent = std::erase_if(workers_, [&](const auto& each) {
    return each.second.at + limits_.worker < now && each.first != instance;
  });
  const auto [at, is_new] = workers_.try_emplace(instance);
  if (is_new || silent > 0 || at->second.said.workloads != hello.workloads) ++counts_.others;
  const bool was_here = at->second.is_here;
  at->second = {std::move(hello), now, true};
  if (was_here) return;
  // It is back, and says soon what it has.
  for (auto& [task, entry] : entries_) {
    for (Given& each : entry.given) {
      if (each.worker == instance) each.until = std::min(each.until, now + limits_.confirm);
    }
  }
  offer(now);
}

void Caller::wake(Nanos now) {
  if (now - next_wake() > kAway) restart_waits(now);
  bool offers = false;
  for (auto at = entries_.begin(); at != entries_.end();) {
    const auto here = at++;
    Entry& entry = here->second;
    if (due(entry) > now) continue;
    if (entry.hedge_at && *entry.hedge_at <= now) {
      entry.hedge_at.reset();
      entry.offered_at = now;
    }
    offers = offers || waits(entry, now);
    const auto gone =
        std::ranges::find_if(entry.given, [&](const Given& each) { return each.until <= now; });
    if (gone == entry.given.end()) continue;
    const auto heard = workers_.find(gone->worker);
    const bool lives = heard != workers_.end() && heard->second.lives(now, limits_.silence / 2);
    const bool confirmed = gone->confirmed;
    entry.given.erase(gone);
    if (confirmed && !lives) ++entry.tries;
    failed(here,
           !confirmed ? "the worker did not get it"
           : lives    ? "its reply was lost"
                      : "a worker that was not heard of again: it died, or its link did",
           now);
  }
  if (offers) offer(now);
}

Nanos Caller::next_wake() const {
  Nanos next = Nanos::max();
  for (const auto& [task, entry] : entries_) next = std::min(next, due(entry));
  return next;
}

Nanos Caller::due(const Entry& entry) const {
  if (!linked_) return Nanos::max();
  Nanos next = entry.hedge_at.value_or(Nanos::max());
  for (const Given& each : entry.given) next = std::min(next, each.until);
  if (!entry.offered_at) return next;
  const bool again = *entry.offered_at <= offered_;
  return std::min(next, again ? offered_ + limits_.offer : *entry.offered_at);
}

std::uint32_t Caller::waiting(Nanos now) const {
  return static_cast<std::uint32_t>(
      std::ranges::count_if(entries_, [&](const auto& each) { return waits(each.second, now); }));
}

void Caller::offer(Nanos now) {
  offered_ = now;
  const std::uint32_t count = waiting(now);
  if (linked_ && count > 0) say_(subject("offer", robot_), encode(OfferMessage{run_, count}));
}

std::optional<Nanos> Caller::hedged_after(const Digest& spec) const {
  if (!limits_.hedge_p95) return limits_.hedge_after;
  const auto took = took_.find(spec);
  if (took == took_.end() || took->second.size() < kFewCalls) return std::nullopt;
  std::vector<Nanos> sorted(took->second.begin(), took->second.end());
  const auto p95 = sorted.begin() + std::ssize(sorted) * 95 / 100;
  std::ranges::nth_element(sorted, p95);
  return *p95;
}

/// @param how  A worker's reply to what is done; else the problem alone.
void Caller::end(Entries::iterator at, ReplyMessage how) {
  const bool done = how.problem.empty();
  counts_.done += done ? 1 : 0;
  const bool others = std::ranges::any_of(
      at->second.given, [&](const Given& each) { return !done || each.send != how.send; });
  // Whoever has it may let go of it.
  if (others && linked_) say_(subject("cancel", robot_), encode(CancelMessage{at->first}));
  at->second.progress->end = std::move(how);
  entries_.erase(at);
}

void Caller::measure(Nanos took, std::size_t bytes) {
  if (bytes < kSmall) {
    const Nanos known = estimate_.round_trip.value_or(took);
    estimate_.round_trip = known + scaled(took - known, kNew);
    return;
  }
  const Nanos moving = took - estimate_.round_trip.value_or(Nanos::zero());
  if (moving <= Nanos::zero()) return;
  const double rate = static_cast<double>(bytes) / to_s(moving);
  const double known = estimate_.bytes_per_s.value_or(rate);
  estimate_.bytes_per_s = known + kNew * (rate - known);
}

bool Caller::is_up(Nanos now) const {
  return linked_ && std::ranges::any_of(workers_, [&](const auto& each) {
           return each.second.lives(now, limits_.worker);
         });
}

std::string Caller::why_not(const Kind& kind) const {
  std::string why;
  for (const auto& [instance, worker] : workers_) {
    if (knows(worker.said, kind)) return "";
    const bool another = knows(worker.said, {.name = kind.name});
    why = fmt::format("worker {} (pirt {}) {} {}: {}", worker.said.worker, worker.said.version,
                      another ? "has another" : "does not know", kind.name,
                      another ? "other models or sizes, or another version of pirt"
                              : "it was given no models (pirt cloud-worker --model), has no room "
                                "for it (--cache-mb), or is another version of pirt");
  }
  return why;
}

RobotLink::RobotLink(const RobotOptions& options)
    : options_(options),
      caller_(options.robot, run_, options.limits, [this](std::string to, Bytes message) {
        said_.emplace_back(std::move(to), std::move(message));
      }) {
  check_robot_name(options_.robot);
  options_.connection.name = "pirt robot " + options_.robot;
  options_.connection.inbox = "_INBOX_" + options_.robot;
  connection_ = std::make_unique<Connection>(options_.connection, [this](bool is_up) {
    step([&](Caller& caller, Nanos now) {
      ask_at_ = is_up ? now : Nanos::max();
      if (!is_up) caller.link_down();
    });
  });
  const auto subscribe = [this]<typename Said>(const std::string& to,
                                               void (Caller::*hear)(Said, Nanos)) {
    connection_->subscribe(to, [=, this](const Incoming& message) {
      constexpr bool kReplies = std::is_same_v<Said, ReplyMessage>;  // They have outputs.
      if (!kReplies && message.data.size() > kMostHello) throw_bad_input("a worker says too much");
      Said said = decode_as<Said>(message.data);
      if constexpr (kReplies) {  // It may be the stream that a worker had trouble with.
        if (said.kind == ReplyKind::kLater || said.kind == ReplyKind::kMissing) look_for_stream();
      }
      step([&](Caller& caller, Nanos now) { (caller.*hear)(std::move(said), now); });
    });
  };
  subscribe(subject("claim", options_.robot), &Caller::claimed);
  subscribe(subject("answer", options_.robot), &Caller::replied);
  subscribe(kHelloSubject, &Caller::heard);
  server_ = start_thread([this](const std::stop_token& stop) { serve(stop); });
}

void RobotLink::serve(const std::stop_token& stop) {
  name_thread("pirt-robot");
  while (!stop.stop_requested()) {
    try {
      bool asks = false;
      step([&](Caller& caller, Nanos now) {
        asks = ask_at_ <= now;
        if (asks) ask_at_ = now + kAskAgain;
        if (caller.next_wake() <= now) caller.wake(now);
      });
      if (asks) ask_for_stream();
      std::unique_lock lock(mutex_);
      const Nanos until = std::min(caller_.next_wake(), ask_at_), now = clock_.now();
      const Nanos left = std::min(until - std::min(until, now), kLongestWait);
      changed_.wait_for(lock, stop, left,
                        [&] { return std::min(caller_.next_wake(), ask_at_) < until; });
    } catch (const std::exception& error) {  // Such as no memory: it goes on.
      connection_->note(error.what());
      std::this_thread::sleep_for(std::chrono::milliseconds(100));
    }
  }
}

/// Without a stream of its own nothing large would ever get to a worker.
void RobotLink::ask_for_stream() {
  const auto answer =
      connection_->request("$JS.API.STREAM.INFO." + blob_stream(options_.robot), {}, kAskAgain);
  if (!answer.came && !connection_->is_up()) return;
  StreamAnswer stream = read_answer(answer);
  if (connection_->chunk_bytes() == 0) {
    stream.why = connection_->why_no_chunks();
  } else if (stream.error == kNoStream) {
    stream.why = fmt::format("no stream for robot '{}'; run `pirt cloud-admin setup --robots {}`",
                             options_.robot, options_.robot);
  }
  step([&](Caller& caller, Nanos now) {
    no_stream_ = stream.why;
    if (!no_stream_.empty() && answer.came && caller.is_up(now)) caller.link_down();
    if (!no_stream_.empty() || !connection_->is_up()) return;  // It is asked again.
    stream_bytes_ = stream.json.at("config").value("max_bytes", std::int64_t{0});
    ask_at_ = Nanos::max();
    caller.link_up(now);
  });
}

std::string RobotLink::why_down() const {
  const std::string server = "server " + public_url(options_.connection.server);
  if (!connection_->is_up()) return "no connection to " + server + ": " + connection_->why_down();
  const std::string problem = connection_->problem();
  const std::lock_guard lock(mutex_);
  if (caller_.is_up(clock_.now())) return "";
  if (!no_stream_.empty()) return server + ": " + no_stream_;
  return fmt::format("no worker is at {}{}; start one (pirt cloud-worker --server {})", server,
                     problem.empty() ? "" : " (" + problem + ")",
                     public_url(options_.connection.server));
}

std::string RobotLink::why_too_large(const std::string& what, std::uint64_t bytes) const {
  const std::lock_guard lock(mutex_);
  if (fits(bytes)) return "";
  return fmt::format(
      "{} has {} MB to send, and robot {} may have {} MB on the server; give it more (pirt "
      "cloud-admin setup --robot-mb)",
      what, bytes >> 20, options_.robot, stream_bytes_ >> 20);
}

}  // namespace pirt::cloud
