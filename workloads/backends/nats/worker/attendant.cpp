#include "workloads/backends/nats/worker/attendant.h"

#include <algorithm>
#include <utility>

namespace pirt::cloud {
namespace {

std::uint64_t size_of(const ReplyMessage& reply) {
  const auto* const bytes = std::get_if<Bytes>(&reply.outputs);
  return sizeof reply + (bytes == nullptr ? 0 : bytes->size());
}

}  // namespace

void Attendant::delivered(const TaskKey& key, std::uint32_t send, Delivery delivery, Nanos now,
                          AttendantActions& out) {
  ++counts_.delivered;
  if (const auto at = tasks_.find(key); at != tasks_.end()) {
    ++counts_.same_again;
    Task& task = at->second;
    const bool failed = task.reply != nullptr && task.reply->kind == ReplyKind::kFailedTry;
    if (failed && send > task.send) {  // The robot knows already: that is the next try.
      out.push_back(LeaveForLater{delivery});
      return;
    }
    task.send = std::max(task.send, send);
    task.deliveries.push_back(delivery);
    return;
  }
  const auto known = remembered_.find(key);
  if (known != remembered_.end() && send <= known->second.send) {
    // Its reply is stored, and the acknowledgement was lost.
    ++counts_.same_again;
    out.push_back(Acknowledge{delivery});
    return;
  }
  Task& task = tasks_[key];
  task.send = send;
  task.deliveries = {delivery};
  task.progress = now + limits_.progress;
  if (known == remembered_.end() || known->second.reply->kind == ReplyKind::kFailedTry) {
    ++counts_.run;
    out.push_back(Compute{key});
    out.push_back(SayRunning{key, send});
    return;
  }
  ++counts_.same_again;
  task.reply = known->second.reply;
  publish(key, task, now, out);
}

void Attendant::finished(const TaskKey& key, ReplyMessage reply, Nanos now, AttendantActions& out) {
  const auto at = tasks_.find(key);
  if (at == tasks_.end() || at->second.reply != nullptr) return;
  at->second.reply = std::make_shared<const ReplyMessage>(std::move(reply));
  publish(key, at->second, now, out);
}

void Attendant::postponed(const TaskKey& key, AttendantActions& out) {
  const auto at = tasks_.find(key);
  if (at == tasks_.end()) return;
  for (const Delivery each : at->second.deliveries) out.push_back(LeaveForLater{each});
  tasks_.erase(at);
}

void Attendant::stored(const TaskKey& key, std::uint32_t send, Nanos now, AttendantActions& out) {
  const auto at = tasks_.find(key);
  if (at == tasks_.end() || at->second.reply == nullptr) return;
  Task& task = at->second;
  // It was sent again while its reply went out.
  if (send < task.send) return publish(key, task, now, out);
  ++counts_.replied;
  for (const Delivery each : task.deliveries) out.push_back(Acknowledge{each});
  remember(key, task);
  tasks_.erase(at);
}

void Attendant::wake(Nanos now, AttendantActions& out) {
  for (auto& [key, task] : tasks_) {
    if (task.progress <= now) {
      task.progress = now + limits_.progress;
      for (const Delivery each : task.deliveries) out.push_back(SayProgress{each});
      if (task.reply == nullptr) out.push_back(SayRunning{key, task.send});
    }
    if (task.reply != nullptr && task.next <= now) publish(key, task, now, out);
  }
}

Nanos Attendant::next_wake() const {
  Nanos next = Nanos::max();
  for (const auto& [key, task] : tasks_) {
    next = std::min(next, task.progress);
    if (task.reply != nullptr) next = std::min(next, task.next);
  }
  return next;
}

void Attendant::publish(const TaskKey& key, Task& task, Nanos now, AttendantActions& out) {
  task.next = now + limits_.confirm;
  out.push_back(PublishReply{key, task.send, task.reply});
}

void Attendant::remember(const TaskKey& key, const Task& task) {
  auto [at, is_new] = remembered_.try_emplace(key);
  if (is_new) {
    oldest_.push_back(key);
  } else {
    remembered_bytes_ -= size_of(*at->second.reply);
  }
  at->second = {task.send, task.reply};
  remembered_bytes_ += size_of(*task.reply);
  while (oldest_.size() > limits_.remembered || remembered_bytes_ > limits_.remembered_bytes) {
    const auto old = remembered_.find(oldest_.front());
    remembered_bytes_ -= size_of(*old->second.reply);
    remembered_.erase(old);
    oldest_.pop_front();
  }
}

}  // namespace pirt::cloud
