#include "workloads/backends/nats/robot/caller.h"

#include <fmt/core.h>

#include <algorithm>
#include <utility>

namespace pirt::cloud {
namespace {

constexpr std::size_t kMostWorkers = 1024;
// Calls of a kind that its 95th of 100 follows from.
constexpr std::size_t kFewCalls = 20, kManyCalls = 100;

}  // namespace

void Caller::submit(const TaskId& task, const std::string& kind, std::optional<Nanos> deadline,
                    Nanos now) {
  ++counts_.submitted;
  entries_[task] = {.kind = kind, .offered_at = now, .deadline = deadline};
  offer(now);
}

void Caller::cancel(const TaskId& task) {
  const auto at = entries_.find(task);
  if (at != entries_.end()) end(at, CallEndKind::kCancelled, "cancelled", nullptr);
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
  workers_.clear();
}

void Caller::claimed(std::uint64_t worker, const std::function<bool(const TaskId&)>& takes,
                     Nanos now) {
  for (auto& [task, entry] : entries_) {
    const auto is_there = [&](const Given& each) { return each.worker == worker; };
    if (!waits(entry, now) || std::ranges::any_of(entry.given, is_there) || !takes(task)) continue;
    return give(task, entry, worker, now);
  }
  events_.give_nothing(worker);
}

void Caller::give(const TaskId& task, Entry& entry, std::uint64_t worker, Nanos now) {
  if (++entry.sends > 1) ++counts_.sent_again;
  if (!entry.given.empty()) ++counts_.hedged;
  entry.given.push_back({worker, entry.sends, false, now, now + limits_.confirm});
  entry.offered_at.reset();
  const auto hedged = entry.sends == 1 ? hedged_after(entry.kind) : std::nullopt;
  entry.hedge_at = hedged ? std::optional(now + *hedged) : std::nullopt;
  GivenTask given{task, worker, entry.sends, waiting(now), {}};
  if (given.waiting == 0) offer_at_ = Nanos::max();
  if (entry.deadline) given.time_left = std::max(*entry.deadline - now, Nanos::zero());
  events_.give(given);
}

void Caller::replied(const ReplyMessage& reply, Nanos now) {
  const auto at = entries_.find(reply.task);
  if (at == entries_.end()) {
    if (reply.kind != ReplyKind::kRunning) ++counts_.late;
    return;
  }
  Entry& entry = at->second;
  const auto given = std::ranges::find(entry.given, reply.send, &Given::send);
  if (reply.kind == ReplyKind::kDone) {  // Of whatever send: it is what was asked for.
    if (given != entry.given.end()) {    // Since the first one that has it was asked.
      auto& took = took_[entry.kind];
      took.push_back(now - std::ranges::min(entry.given, {}, &Given::since).since);
      if (took.size() > kManyCalls) took.pop_front();
    }
    return end(at, CallEndKind::kDone, "", &reply);
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
      return end(at, CallEndKind::kRefused,
                 fmt::format("worker {} refused it: {}", reply.worker, reply.problem), nullptr);
    case ReplyKind::kExpired:
      return end(at, CallEndKind::kReturned, "its time was over before a worker began", nullptr);
    case ReplyKind::kMissing:
      if (entry.sends >= limits_.most_sends) return failed(at, problem, now);
      entry.offered_at.reset();
      return events_.missing(reply.task);
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
    return end(at, CallEndKind::kGivenUp,
               tried ? fmt::format("given up after {} tries; the last one failed on {}",
                                   entry.tries, problem)
                     : fmt::format("given up after it was sent {} times; the last time {}",
                                   entry.sends, problem),
               nullptr);
  }
  if (!entry.given.empty()) return;
  // Later each time, and not all robots at once.
  const double jitter = std::uniform_real_distribution<double>(1, 2)(random_);
  entry.offered_at = now + scaled(std::min<std::int64_t>(entry.sends, 10) * limits_.again, jitter);
  entry.hedge_at.reset();
}

void Caller::worker_heard(std::uint64_t worker, Nanos now) {
  if (workers_.size() >= kMostWorkers) workers_.clear();
  if (!workers_.insert_or_assign(worker, now).second) return;
  // It is back, and says soon what it has.
  for (auto& [task, entry] : entries_) {
    for (Given& each : entry.given) {
      if (each.worker == worker) each.until = std::min(each.until, now + limits_.confirm);
    }
  }
  offer(now);
}

void Caller::wake(Nanos now) {
  for (auto at = entries_.begin(); at != entries_.end();) {
    const auto here = at++;
    if (due(here->second) <= now) look(here, now);
  }
  if (offer_at_ <= now) offer(now);
}

void Caller::look(Entries::iterator at, Nanos now) {
  Entry& entry = at->second;
  if (entry.hedge_at && *entry.hedge_at <= now) {
    entry.hedge_at.reset();
    entry.offered_at = now;
  }
  if (waits(entry, now)) offer_at_ = now;
  const auto gone =
      std::ranges::find_if(entry.given, [&](const Given& each) { return each.until <= now; });
  if (gone == entry.given.end()) return;
  const Given given = *gone;
  entry.given.erase(gone);
  const auto heard = workers_.find(given.worker);
  const bool lives = heard != workers_.end() && now < heard->second + limits_.silence / 2;
  if (!given.confirmed) return failed(at, "the worker did not get it", now);
  if (lives) return failed(at, "its reply was lost", now);
  ++entry.tries;
  failed(at, "a worker that was not heard of again: it died, or its link did", now);
}

Nanos Caller::next_wake() const {
  Nanos next = linked_ ? offer_at_ : Nanos::max();
  for (const auto& [task, entry] : entries_) next = std::min(next, due(entry));
  return next;
}

Nanos Caller::due(const Entry& entry) const {
  if (!linked_) return Nanos::max();
  Nanos next = entry.hedge_at.value_or(Nanos::max());
  for (const Given& each : entry.given) next = std::min(next, each.until);
  // What was offered is offered again by offer_at_.
  const bool later = entry.offered_at && *entry.offered_at > offered_;
  return later ? std::min(next, *entry.offered_at) : next;
}

std::uint32_t Caller::waiting(Nanos now) const {
  return static_cast<std::uint32_t>(
      std::ranges::count_if(entries_, [&](const auto& each) { return waits(each.second, now); }));
}

void Caller::offer(Nanos now) {
  offered_ = now;
  const std::uint32_t count = waiting(now);
  offer_at_ = count > 0 ? now + limits_.offer : Nanos::max();
  if (linked_ && count > 0) events_.offer(count);
}

std::optional<Nanos> Caller::hedged_after(const std::string& kind) const {
  if (!limits_.hedge_p95) return limits_.hedge_after;
  const auto took = took_.find(kind);
  if (took == took_.end() || took->second.size() < kFewCalls) return std::nullopt;
  std::vector<Nanos> sorted(took->second.begin(), took->second.end());
  const auto p95 = sorted.begin() + std::ssize(sorted) * 95 / 100;
  std::ranges::nth_element(sorted, p95);
  return *p95;
}

void Caller::end(Entries::iterator at, CallEndKind how, const std::string& problem,
                 const ReplyMessage* reply) {
  ++counts_.ended_as[static_cast<std::size_t>(how)];
  const TaskId task = at->first;
  const bool others = std::ranges::any_of(at->second.given, [&](const Given& each) {
    return reply == nullptr || each.send != reply->send;
  });
  entries_.erase(at);
  if (others && linked_) events_.withdraw(task);
  events_.end(task, how, problem, reply);
}

bool Caller::is_up(Nanos now) const {
  return linked_ && std::ranges::any_of(workers_, [&](const auto& each) {
           return now < each.second + limits_.worker;
         });
}

}  // namespace pirt::cloud
