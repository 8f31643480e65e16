// Who computes a worker's calls, one after the other; each slot has its own.
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "workloads/backends/nats/wire/kind.h"

namespace pirt::cloud {

/// One call, whose sizes were judged (Admission).
struct Call {
  const std::string& robot;
  const TaskMessage& task;  ///< Its inputs are in it.
  std::shared_ptr<const Workload> workload;
  /// The parameters' bytes; absent with @p why as the reply has it where they are not to be had.
  std::function<std::optional<Bytes>(ReplyMessage& why)> parameters;
  std::function<bool()> stop = [] { return false; };  ///< The worker ends.

  [[nodiscard]] ByteView inputs() const { return std::get<Bytes>(task.inputs); }
};

class Computer {
 public:
  virtual ~Computer() = default;
  /// @param reply  Gets its kind, problem, outputs and time.
  /// @throws std::exception if it did not work: a try that failed.
  virtual void compute(const Call& call, ReplyMessage& reply) = 0;
  /// Whether the last call ended the process that computed it.
  [[nodiscard]] virtual bool is_gone() const { return false; }
};

/// What a worker computes: workloads that it knows, with the sizes that it knows, or those that its
/// own makers make, and nothing else. Judged from the head of a task, before anything is read or
/// allocated for it.
class Admission {
 public:
  /// @param workloads   Are there as long as this is. Those with a state are left out.
  /// @param call_bytes  Of a call's tensors.
  Admission(std::span<const Workload* const> workloads, std::uint64_t call_bytes);

  [[nodiscard]] Decoded<std::shared_ptr<const Workload>> admit(const TaskMessage& task) const;
  /// What the worker announces.
  [[nodiscard]] std::vector<HelloMessage::Known> known() const;

 private:
  std::map<std::string, const Workload*, std::less<>> known_;
  std::uint64_t call_bytes_;
};

/// In one line, of printable characters.
[[nodiscard]] std::string one_line(std::string text);

}  // namespace pirt::cloud
