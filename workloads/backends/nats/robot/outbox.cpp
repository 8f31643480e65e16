#include "workloads/backends/nats/robot/outbox.h"

#include <utility>

namespace pirt::cloud {

bool Outbox::put(const TaskId& task, const std::string& key, std::uint32_t sends, ByteView body) {
  if (size_ + body.size() > limit_ || holds(task)) return false;
  Kept kept{.task = task, .key = key, .sends = sends};
  keep(kept, body);
  found(std::move(kept), body.size(), 0);
  return true;
}

void Outbox::note(const TaskId& task, std::uint32_t sends, std::uint32_t tries) {
  const auto entry = entries_.find(task);
  if (entry == entries_.end()) return;
  Kept kept = entry->second.kept;
  kept.sends = sends;
  kept.tries = tries;
  keep_counts(kept);
  entry->second.kept = std::move(kept);
}

void Outbox::answer(const TaskId& task, ByteView reply) {
  const auto found = entries_.find(task);
  if (found == entries_.end()) return;
  keep_reply(task, reply);
  Entry& entry = found->second;
  size_ += reply.size() - entry.reply_bytes;
  entry.reply_bytes = reply.size();
  entry.kept.answered = true;
}

void Outbox::erase(const TaskId& task) {
  const auto entry = entries_.find(task);
  if (entry == entries_.end()) return;
  size_ -= entry->second.body_bytes + entry->second.reply_bytes;
  entries_.erase(entry);
  drop(task);
}

std::vector<Outbox::Kept> Outbox::all() const {
  std::vector<Kept> all;
  for (const auto& [task, entry] : entries_) all.push_back(entry.kept);
  return all;
}

void Outbox::found(Kept kept, std::uint64_t body_bytes, std::uint64_t reply_bytes) {
  size_ += body_bytes + reply_bytes;
  const TaskId task = kept.task;
  entries_[task] = {std::move(kept), body_bytes, reply_bytes};
}

}  // namespace pirt::cloud
