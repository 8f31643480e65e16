#include <map>

#include "workloads/backends/nats/robot/outbox.h"

namespace pirt::cloud {
namespace {

class MemoryOutbox final : public Outbox {
 public:
  explicit MemoryOutbox(std::uint64_t limit) : Outbox(limit) {}

  Bytes body(const TaskId& task) override { return holds(task) ? bytes_[task].body : Bytes{}; }
  Bytes reply(const TaskId& task) override { return holds(task) ? bytes_[task].reply : Bytes{}; }

 private:
  struct Held {
    Bytes body, reply;
  };

  void keep(const Kept& task, ByteView body) override {
    bytes_[task.task].body.assign(body.begin(), body.end());
  }
  void keep_counts(const Kept&) override {}
  void keep_reply(const TaskId& task, ByteView reply) override {
    bytes_[task].reply.assign(reply.begin(), reply.end());
  }
  void drop(const TaskId& task) override { bytes_.erase(task); }

  std::map<TaskId, Held> bytes_;
};

}  // namespace

std::unique_ptr<Outbox> make_memory_outbox(std::uint64_t limit_bytes) {
  return std::make_unique<MemoryOutbox>(limit_bytes);
}

}  // namespace pirt::cloud
