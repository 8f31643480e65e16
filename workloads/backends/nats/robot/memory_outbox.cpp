#include <map>

#include "workloads/backends/nats/robot/outbox.h"

namespace pirt::cloud {
namespace {

class MemoryOutbox final : public Outbox {
 public:
  explicit MemoryOutbox(std::uint64_t limit) : limit_(limit) {}

  bool put(const TaskId& task, const std::string& key, std::uint32_t sends,
           ByteView body) override {
    if (size_ + body.size() > limit_ || entries_.contains(task)) return false;
    entries_[task] = {{.task = task, .key = key, .sends = sends}, {body.begin(), body.end()}, {}};
    size_ += body.size();
    return true;
  }
  void note(const TaskId& task, std::uint32_t sends, std::uint32_t tries) override {
    const auto entry = entries_.find(task);
    if (entry == entries_.end()) return;
    entry->second.kept.sends = sends;
    entry->second.kept.tries = tries;
  }
  void answer(const TaskId& task, ByteView reply) override {
    const auto found = entries_.find(task);
    if (found == entries_.end()) return;
    Entry& entry = found->second;
    size_ += reply.size();
    size_ -= entry.reply.size();
    entry.kept.answered = true;
    entry.reply.assign(reply.begin(), reply.end());
  }
  void erase(const TaskId& task) override {
    const auto entry = entries_.find(task);
    if (entry == entries_.end()) return;
    size_ -= entry->second.body.size() + entry->second.reply.size();
    entries_.erase(entry);
  }
  Bytes body(const TaskId& task) override {
    const auto entry = entries_.find(task);
    return entry == entries_.end() ? Bytes{} : entry->second.body;
  }
  Bytes reply(const TaskId& task) override {
    const auto entry = entries_.find(task);
    return entry == entries_.end() ? Bytes{} : entry->second.reply;
  }
  std::vector<Kept> all() override {
    std::vector<Kept> all;
    for (const auto& [task, entry] : entries_) all.push_back(entry.kept);
    return all;
  }
  [[nodiscard]] std::uint64_t size_bytes() const override { return size_; }
  [[nodiscard]] std::uint64_t limit_bytes() const override { return limit_; }

 private:
  struct Entry {
    Kept kept;
    Bytes body, reply;
  };
  std::uint64_t limit_, size_ = 0;
  std::map<TaskId, Entry> entries_;
};

}  // namespace

std::unique_ptr<Outbox> make_memory_outbox(std::uint64_t limit_bytes) {
  return std::make_unique<MemoryOutbox>(limit_bytes);
}

}  // namespace pirt::cloud
