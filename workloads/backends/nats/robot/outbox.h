// Tasks that were taken and are not answered yet, so that a robot whose link, server or program
// fails loses none.
//
// Holds what was submitted, as it goes out, within a limit in bytes. Not parameters: they are there
// again after a restart. One caller at a time.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "workloads/backends/nats/wire/wire.h"

namespace pirt::cloud {

class Outbox {
 public:
  struct Kept {
    TaskId task = {};
    std::string key = {};  ///< By which it is asked for after a restart; empty = it never is.
    std::uint32_t sends = 1;
    std::uint32_t tries = 0;  ///< That failed.
    bool answered = false;    ///< Its reply is kept, too, since nobody waited for it.
  };

  virtual ~Outbox() = default;
  Outbox(const Outbox&) = delete;
  Outbox& operator=(const Outbox&) = delete;
  /// @return  False if it would hold more than it may, or has the task: nothing has changed.
  [[nodiscard]] bool put(const TaskId& task, const std::string& key, std::uint32_t sends,
                         ByteView body);
  void note(const TaskId& task, std::uint32_t sends, std::uint32_t tries);
  /// Keeps the reply (a frame) beside it, whatever the limit.
  void answer(const TaskId& task, ByteView reply);
  void erase(const TaskId& task);
  /// Empty if it is not there.
  [[nodiscard]] virtual Bytes body(const TaskId& task) = 0;
  [[nodiscard]] virtual Bytes reply(const TaskId& task) = 0;
  [[nodiscard]] std::vector<Kept> all() const;
  [[nodiscard]] std::uint64_t size_bytes() const { return size_; }
  [[nodiscard]] std::uint64_t limit_bytes() const { return limit_; }

 protected:
  explicit Outbox(std::uint64_t limit) : limit_(limit) {}
  /// It was there before.
  void found(Kept kept, std::uint64_t body_bytes, std::uint64_t reply_bytes);
  [[nodiscard]] bool holds(const TaskId& task) const { return entries_.contains(task); }

 private:
  // Where it lies. What throws has changed nothing.
  virtual void keep(const Kept& task, ByteView body) = 0;
  virtual void keep_counts(const Kept& task) = 0;
  virtual void keep_reply(const TaskId& task, ByteView reply) = 0;
  virtual void drop(const TaskId& task) = 0;

  struct Entry {
    Kept kept;
    std::uint64_t body_bytes = 0, reply_bytes = 0;
  };
  std::uint64_t limit_, size_ = 0;
  std::map<TaskId, Entry> entries_;
};

/// One that ends with the program.
[[nodiscard]] std::unique_ptr<Outbox> make_memory_outbox(std::uint64_t limit_bytes);

/// One in a file, which a put, a note and an answer have reached, all the way to the disk, when
/// they return (synchronous=FULL). An erasure gets there with whatever comes next, or at the end:
/// what it leaves behind after a crash is a task too many, never one too few.
/// @throws Error{kBadInput} if the file is no outbox, of another version, or another robot's;
/// Error{kEnvironment} if it cannot be written, or another program has it.
[[nodiscard]] std::unique_ptr<Outbox> open_outbox(const std::filesystem::path& file,
                                                  std::string_view robot,
                                                  std::uint64_t limit_bytes);

}  // namespace pirt::cloud
