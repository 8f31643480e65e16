#include "workloads/backends/nats/robot/caller.h"

#include <fmt/core.h>

#include <algorithm>
#include <utility>

namespace pirt::cloud {

Caller::Caller(Outbox& outbox, const CallerLimits& limits, Nanos now, CallerActions& out)
    : outbox_(outbox), limits_(limits) {
  for (const Outbox::Kept& kept : outbox_.all()) {
    if (kept.key.empty()) {
      out.push_back(Withdraw{kept.task, 0});
      outbox_.erase(kept.task);
      continue;
    }
    Entry entry{.key = kept.key, .waited_for = false, .sends = kept.sends, .tries = kept.tries};
    if (kept.answered) {
      entry.stage = Stage::kAnswered;
    } else {  // Whether the server has what was sent before, nobody knows.
      outbox_.note(kept.task, ++entry.sends, entry.tries);
    }
    entry.silence = limits_.silence;
    entry.next = now;
    entries_.emplace(kept.task, std::move(entry));
    ++counts_.submitted;
  }
}

Caller::Submission Caller::submit(const TaskId& task, const std::string& key, ByteView body,
                                  std::optional<Nanos> deadline, std::optional<Nanos> give_back,
                                  Nanos now, CallerActions& out, std::uint32_t first_send) {
  if (const auto known = entries_.find(task); known != entries_.end()) {
    Entry& entry = known->second;
    if (entry.waited_for) return Submission::kTwice;
    entry.waited_for = true;
    entry.deadline = deadline;
    entry.give_back = give_back;
    if (entry.stage == Stage::kAnswered) {
      const Bytes frame = outbox_.reply(task);
      auto message = decode(frame);
      if (message.value && std::holds_alternative<ReplyMessage>(*message.value)) {
        replied(std::get<ReplyMessage>(*message.value), now, out);
      } else {  // Kept in vain.
        send_again(task, entry, now, out);
      }
    }
    return Submission::kTaken;
  }
  const auto has_key = [&](const auto& each) { return each.second.key == key; };
  if (!key.empty() && std::ranges::any_of(entries_, has_key)) return Submission::kOtherBody;
  if (!outbox_.put(task, key, first_send, body)) {
    ++counts_.outbox_full;
    outbox_was_full_ = outbox_.size_bytes() > 0;  // Else it is too large by itself.
    settle(now, out);
    return Submission::kOutboxFull;
  }
  ++counts_.submitted;
  Entry& entry = entries_[task];
  entry.key = key;
  entry.sends = first_send;
  entry.deadline = deadline;
  entry.give_back = give_back;
  entry.silence = limits_.silence;
  send(task, entry, now, out);
  return Submission::kTaken;
}

void Caller::cancel(const TaskId& task, Nanos now, CallerActions& out) {
  const auto at = entries_.find(task);
  if (at == entries_.end()) return;
  withdraw(task, at->second, out);
  end(at, CallEndKind::kCancelled, "cancelled", {}, out);
  settle(now, out);
}

void Caller::link_up(Nanos now, CallerActions& out) {
  if (std::exchange(linked_, true)) return;
  for (auto& [task, entry] : entries_) {
    if (entry.stage == Stage::kWaiting || entry.stage == Stage::kSending) {
      send(task, entry, now, out);
    } else if (entry.stage == Stage::kWithServer) {
      hear(entry, now);  // What was said meanwhile is on its way.
    }
  }
  settle(now, out);
}

void Caller::link_down(Nanos now, CallerActions& out) {
  if (!std::exchange(linked_, false)) return;
  for (auto& [task, entry] : entries_) {
    if (entry.stage == Stage::kSending || entry.stage == Stage::kHeld) {
      entry.stage = Stage::kWaiting;
    }
  }
  worker_heard_.reset();
  settle(now, out);
}

void Caller::confirmed(const TaskId& task, std::uint32_t send, std::uint64_t sequence, Nanos now,
                       CallerActions& out) {
  const auto at = entries_.find(task);
  if (at == entries_.end()) {
    // It ended before the server said where it lies; a reply may have been faster.
    out.push_back(Withdraw{task, sequence});
    return;
  }
  Entry& entry = at->second;
  if (send != entry.sends || (entry.stage != Stage::kSending && entry.stage != Stage::kWaiting)) {
    return;
  }
  entry.stage = Stage::kWithServer;
  entry.sequence = sequence;
  hear(entry, now);
  stream_full_until_.reset();
  settle(now, out);
}

void Caller::rejected(const TaskId& task, std::uint32_t send, Nanos now, CallerActions& out) {
  ++counts_.stream_full;
  stream_full_until_ = now + 2 * limits_.full;
  const auto at = entries_.find(task);
  if (at != entries_.end() && at->second.sends == send && at->second.stage == Stage::kSending) {
    at->second.stage = Stage::kHeld;
    at->second.next = now + limits_.full;
  }
  settle(now, out);
}

void Caller::replied(const ReplyMessage& reply, Nanos now, CallerActions& out) {
  worker_heard_ = now;
  take_reply(reply, now, out);
  settle(now, out);
}

void Caller::take_reply(const ReplyMessage& reply, Nanos now, CallerActions& out) {
  const auto at = entries_.find(reply.task);
  if (at == entries_.end()) {
    if (reply.kind != ReplyKind::kRunning) ++counts_.late;
    return;
  }
  Entry& entry = at->second;
  const bool ends = reply.kind == ReplyKind::kDone || reply.kind == ReplyKind::kRefused;
  if (ends && !entry.waited_for) {
    outbox_.answer(reply.task, encode(reply));
    entry.stage = Stage::kAnswered;
    return;
  }
  switch (reply.kind) {
    case ReplyKind::kDone:
      return end(at, CallEndKind::kDone, "", reply, out);
    case ReplyKind::kRefused:
      return end(at, CallEndKind::kRefused,
                 fmt::format("worker {} refused it: {}", reply.worker, reply.problem), {}, out);
    case ReplyKind::kFailedTry:
      return failed_try(at, reply, now, out);
    case ReplyKind::kExpired:
      if (reply.send == entry.sends && entry.give_back) {
        end(at, CallEndKind::kReturned, "its time was over before a worker began", {}, out);
      }
      return;
    case ReplyKind::kNeedsParameters:
      out.push_back(SendParameters{reply.task});
      [[fallthrough]];
    case ReplyKind::kRunning:
      if (entry.stage == Stage::kWithServer) hear(entry, now);
  }
}

void Caller::worker_heard(Nanos now, CallerActions& out) {
  worker_heard_ = now;
  settle(now, out);
}

void Caller::wake(Nanos now, CallerActions& out) {
  for (auto at = entries_.begin(); at != entries_.end();) {
    const auto here = at++;
    if (due(here->second) <= now) look(here, now, out);
  }
  settle(now, out);
}

Nanos Caller::next_wake() const {
  Nanos next = Nanos::max();
  for (const auto& [task, entry] : entries_) next = std::min(next, due(entry));
  if (worker_heard_ && availability_ != Availability::kDown) {
    next = std::min(next, *worker_heard_ + limits_.worker);
  }
  if (stream_full_until_) next = std::min(next, *stream_full_until_);
  return next;
}

Nanos Caller::due(const Entry& entry) const {
  const bool timed = linked_ && entry.stage != Stage::kAnswered && entry.stage != Stage::kWaiting;
  const Nanos stage = timed ? entry.next : Nanos::max();
  return std::min(stage, entry.waited_for ? entry.give_back.value_or(Nanos::max()) : Nanos::max());
}

void Caller::look(Entries::iterator at, Nanos now, CallerActions& out) {
  const TaskId task = at->first;
  Entry& entry = at->second;
  if (entry.waited_for && entry.give_back && *entry.give_back <= now) {
    withdraw(task, entry, out);
    return end(at, CallEndKind::kReturned,
               "no reply by the last moment at which it can be computed elsewhere", {}, out);
  }
  if (entry.stage != Stage::kWithServer) return send(task, entry, now, out);
  entry.silence = std::min(2 * entry.silence, limits_.longest_silence);
  send_again(task, entry, now, out);
}

void Caller::send(const TaskId& task, Entry& entry, Nanos now, CallerActions& out) {
  entry.stage = linked_ ? Stage::kSending : Stage::kWaiting;
  entry.next = now + limits_.confirm;
  if (!linked_) return;
  std::optional<Nanos> left;
  if (entry.deadline) left = std::max(*entry.deadline - now, Nanos::zero());
  out.push_back(Publish{task, entry.sends, left});
}

void Caller::send_again(const TaskId& task, Entry& entry, Nanos now, CallerActions& out) {
  ++counts_.sent_again;
  outbox_.note(task, ++entry.sends, entry.tries);
  send(task, entry, now, out);
}

/// A try is told once, by the number under which it was sent.
void Caller::failed_try(Entries::iterator at, const ReplyMessage& reply, Nanos now,
                        CallerActions& out) {
  Entry& entry = at->second;
  if (reply.send != entry.sends || entry.stage == Stage::kAnswered) return;
  if (++entry.tries < limits_.most_tries) return send_again(at->first, entry, now, out);
  if (!entry.waited_for) {  // Whoever submits the key again tries anew.
    outbox_.erase(at->first);
    ++counts_.given_up;
    entries_.erase(at);
    return;
  }
  end(at, CallEndKind::kGivenUp,
      fmt::format("given up after {} tries; the last one failed on worker {}: {}", entry.tries,
                  reply.worker, reply.problem),
      {}, out);
}

void Caller::end(Entries::iterator at, CallEndKind how, std::string problem,
                 std::optional<ReplyMessage> reply, CallerActions& out) {
  const TaskId task = at->first;
  switch (how) {
    case CallEndKind::kDone:
      ++counts_.done;
      break;
    case CallEndKind::kGivenUp:
      ++counts_.given_up;
      break;
    case CallEndKind::kRefused:
      ++counts_.refused;
      break;
    case CallEndKind::kReturned:
      ++counts_.returned;
      break;
    case CallEndKind::kCancelled:
      ++counts_.cancelled;
      break;
  }
  outbox_.erase(task);
  entries_.erase(at);
  if (outbox_.size_bytes() <= outbox_.limit_bytes() / 8 * 7) outbox_was_full_ = false;
  out.push_back(TellEnd{task, how, std::move(problem), std::move(reply)});
}

void Caller::withdraw(const TaskId& task, const Entry& entry, CallerActions& out) const {
  if (entry.stage != Stage::kWaiting || entry.sequence != 0) {
    out.push_back(Withdraw{task, entry.sequence});
  }
}

void Caller::hear(Entry& entry, Nanos now) const { entry.next = now + entry.silence; }

/// Says what the unit can take, if that has changed.
void Caller::settle(Nanos now, CallerActions& out) {
  if (stream_full_until_ && *stream_full_until_ <= now) stream_full_until_.reset();
  const bool worker = worker_heard_ && now < *worker_heard_ + limits_.worker;
  if (worker_heard_ && !worker) worker_heard_.reset();
  Availability is = Availability::kUp;
  if (outbox_was_full_ || stream_full_until_) is = Availability::kDraining;
  if (!linked_ || !worker) is = Availability::kDown;
  if (std::exchange(availability_, is) != is) out.push_back(TellAvailability{is});
}

}  // namespace pirt::cloud
