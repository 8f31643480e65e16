#include "workloads/backends/nats/robot/caller.h"

#include <fmt/core.h>

#include <algorithm>
#include <utility>

#include "workloads/backends/nats/wire/subjects.h"

namespace pirt::cloud {
namespace {

constexpr std::size_t kMostWorkers = 1024;
// Calls of a kind that its 95th of 100 follows from.
constexpr std::size_t kFewCalls = 20, kManyCalls = 100;
/// A message that no measurement of the bandwidth follows from.
constexpr std::size_t kSmall = 64 << 10;
/// Of what is measured, in what is known from before.
constexpr double kNew = 0.25;

/// As what @p known_by says, where the name alone does not.
bool knows(const HelloMessage& worker, const std::string& workload,
           const std::optional<Digest>& known_by) {
  return std::ranges::any_of(worker.workloads, [&](const HelloMessage::Known& known) {
    return known.workload == workload && (!known_by || known.spec == *known_by);
  });
}

}  // namespace

Caller::Caller(std::string robot, std::uint64_t run, const CallerLimits& limits, Say say, Tell tell)
    : robot_(std::move(robot)),
      run_(run),
      limits_(limits),
      say_(std::move(say)),
      tell_(std::move(tell)),
      random_(static_cast<std::uint32_t>(run)) {}

void Caller::submit(Submission submission, Nanos now) {
  ++counts_.submitted;
  const TaskId task = submission.task.task;
  std::optional<Nanos> deadline;
  if (const auto left = submission.task.time_left) deadline = later_by(now, *left);
  entries_[task] = {.submission = std::move(submission), .offered_at = now, .deadline = deadline};
  offer(now);
}

void Caller::cancel(const TaskId& task) {
  const auto at = entries_.find(task);
  if (at != entries_.end()) end(at, {.problem = "cancelled"});
}

void Caller::cancel_all() {
  while (!entries_.empty()) cancel(entries_.begin()->first);
}

void Caller::ready(const TaskId& task, Nanos now) {
  const auto at = entries_.find(task);
  if (at == entries_.end()) return;
  at->second.offered_at = now;
  offer(now);
}

void Caller::link_up(Nanos now) {
  if (std::exchange(linked_, true)) return;
  for (auto& [task, entry] : entries_) {
    // What was said meanwhile was said to nobody.
    for (Given& each : entry.given) {
      each.until = now + (each.confirmed ? limits_.silence : limits_.confirm);
    }
  }
  offer(now);
}

void Caller::link_down() {
  linked_ = false;
  for (auto& [instance, worker] : workers_) worker.is_here = false;
}

void Caller::claimed(std::uint64_t worker, Nanos now) {
  for (auto& [task, entry] : entries_) {
    if (!waits(entry, now) || !is_for(entry.submission, worker)) continue;
    const auto has = std::ranges::find(entry.given, worker, &Given::worker);
    if (has == entry.given.end()) return give(entry, worker, now);
  }
  say_(task_subject(robot_, worker), encode(OfferMessage{run_, 0}));
}

/// A task goes to a worker that knows its workload, if there is one.
bool Caller::is_for(const Submission& task, std::uint64_t worker) const {
  const auto its = [&](const auto& each) {
    return knows(each.second.said, task.task.workload, task.known_by);
  };
  const auto asks = workers_.find(worker);
  return (asks != workers_.end() && its(*asks)) || std::ranges::none_of(workers_, its);
}

void Caller::give(Entry& entry, std::uint64_t worker, Nanos now) {
  if (++entry.sends > 1) ++counts_.sent_again;
  if (!entry.given.empty()) ++counts_.hedged;
  entry.given.push_back({worker, entry.sends, false, now, now + limits_.confirm});
  entry.offered_at.reset();
  TaskMessage& task = entry.submission.task;
  const auto hedged = entry.sends == 1 ? hedged_after(task.spec) : std::nullopt;
  entry.hedge_at = hedged ? std::optional(now + *hedged) : std::nullopt;
  task.send = entry.sends;
  task.waiting = waiting(now);
  if (entry.deadline) task.time_left = std::max(*entry.deadline - now, Nanos::zero());
  Bytes message = encode(task);
  entry.given_at = now;
  entry.given_bytes = message.size();
  say_(task_subject(robot_, worker), std::move(message));
}

void Caller::replied(ReplyMessage reply, Nanos now) {
  const auto at = entries_.find(reply.task);
  if (at == entries_.end()) {
    if (reply.kind != ReplyKind::kRunning) ++counts_.late;
    return;
  }
  Entry& entry = at->second;
  if (!std::exchange(entry.taken, true)) {
    if (entry.given_bytes > 0) measure(now - entry.given_at, entry.given_bytes);
    tell(entry.submission.taken);
  }
  const auto given = std::ranges::find(entry.given, reply.send, &Given::send);
  if (reply.kind == ReplyKind::kDone) {  // Of whatever send: it is what was asked for.
    if (given != entry.given.end()) {    // Since the first one that has it was asked.
      auto& took = took_[entry.submission.task.spec];
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
  entry.given.erase(given);
  const std::string problem = fmt::format("worker {}: {}", reply.worker, reply.problem);
  switch (reply.kind) {
    case ReplyKind::kRefused:
      if (!entry.given.empty()) return;  // Another one computes it.
      return end(at,
                 {.problem = fmt::format("worker {} refused it: {}", reply.worker, reply.problem)});
    case ReplyKind::kExpired:
      return end(at, {.problem = "its time was over before a worker began"});
    case ReplyKind::kMissing:
      if (entry.sends >= limits_.most_sends) return failed(at, problem, now);
      entry.offered_at.reset();
      return tell(entry.submission.missing);
    case ReplyKind::kFailedTry:
      ++entry.tries;
      [[fallthrough]];
    default:
      return failed(at, problem, now);
  }
}

/// A worker has it no more. What counts as a try was counted.
void Caller::failed(Entries::iterator at, const std::string& problem, Nanos now) {
  Entry& entry = at->second;
  const bool tried = entry.tries >= limits_.most_tries;
  if (tried || entry.sends >= limits_.most_sends) {
    return end(
        at, {.problem = tried ? fmt::format("given up after {} tries; the last one failed on {}",
                                            entry.tries, problem)
                              : fmt::format("given up after it was sent {} times; the last time {}",
                                            entry.sends, problem)});
  }
  if (!entry.given.empty()) return;
  // Later each time, and not all robots at once.
  const double jitter = std::uniform_real_distribution<double>(1, 2)(random_);
  entry.offered_at = now + scaled(std::min<std::int64_t>(entry.sends, 10) * limits_.again, jitter);
  entry.hedge_at.reset();
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
    look(here, now);
  }
  if (offers) offer(now);
}

/// Whether who has it is still there.
void Caller::look(Entries::iterator at, Nanos now) {
  Entry& entry = at->second;
  const auto gone =
      std::ranges::find_if(entry.given, [&](const Given& each) { return each.until <= now; });
  if (gone == entry.given.end()) return;
  const Given given = *gone;
  entry.given.erase(gone);
  if (!given.confirmed) return failed(at, "the worker did not get it", now);
  const auto heard = workers_.find(given.worker);
  if (heard != workers_.end() && heard->second.lives(now, limits_.silence / 2)) {
    return failed(at, "its reply was lost", now);
  }
  ++entry.tries;
  failed(at, "a worker that was not heard of again: it died, or its link did", now);
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
  how.task = at->first;
  const bool others = std::ranges::any_of(
      at->second.given, [&](const Given& each) { return !done || each.send != how.send; });
  const auto ended = std::move(at->second.submission.ended);
  entries_.erase(at);
  // Whoever has it may let go of it.
  if (others && linked_) say_(subject("cancel", robot_), encode(CancelMessage{how.task}));
  if (ended) tell_([ended, how = std::move(how)]() mutable { ended(std::move(how)); });
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

LinkEstimate Caller::estimate() const {
  LinkEstimate estimate = estimate_;
  estimate.late_replies = counts_.late;
  return estimate;
}

bool Caller::is_up(Nanos now) const {
  return linked_ && std::ranges::any_of(workers_, [&](const auto& each) {
           return each.second.lives(now, limits_.worker);
         });
}

std::string Caller::why_not(const Kind& kind) const {
  std::string why;
  for (const auto& [instance, worker] : workers_) {
    const std::string who =
        fmt::format("worker {} (pirt {})", worker.said.worker, worker.said.version);
    if (knows(worker.said, kind.name, kind.known_by)) return "";
    why = knows(worker.said, kind.name, {})
              ? fmt::format("{} has another {}: {}", who, kind.name, kind.differs)
              : fmt::format("{} does not know {}{}", who, kind.name,
                            kind.missing.empty()
                                ? ", or has no room for it (pirt cloud-worker --cache-mb)"
                                : kind.missing);
  }
  return why;
}

}  // namespace pirt::cloud
