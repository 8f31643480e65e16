// Who computes a worker's calls, one after the other; each slot has its own.
#pragma once

#include <exception>
#include <functional>
#include <map>
#include <memory>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

#include "workloads/backends/nats/wire/wire.h"
#include "workloads/model/backend.h"

namespace pirt::cloud {

/// One call, whose sizes were judged (Admission).
struct Call {
  std::string robot = {};
  TaskMessage task = {};  ///< Its inputs are in it.
  std::shared_ptr<const Workload> workload = {};
  Bytes parameters = {};                              ///< Empty as long as they were not missed.
  std::function<bool()> stop = [] { return false; };  ///< The worker ends.
};

class Computer {
 public:
  virtual ~Computer() = default;
  /// @return  Its outputs and time; kMissing: it needs the parameters.
  /// @throws std::exception if it did not work: failure() says what that comes to.
  [[nodiscard]] virtual ReplyMessage compute(const Call& call) = 0;
};

/// What a call comes to that is none of its own fault, or not alone.
struct NotDone : std::runtime_error {
  NotDone(ReplyKind how, const std::string& why) : std::runtime_error(why), kind(how) {}
  ReplyKind kind;
};
/// The call ended the process that computed it, or what that computes with.
struct ProcessGone : NotDone {
  explicit ProcessGone(const std::string& why) : NotDone(ReplyKind::kFailedTry, why) {}
};

/// What a call comes to that threw: NotDone and CallFailed say it. Error{kBadInput} is refused; all
/// else is a try that failed.
[[nodiscard]] ReplyMessage failure(const std::exception& error);

/// What a worker computes, and nothing else: judged from the head of a task, before anything is
/// read or allocated for it.
class Admission {
 public:
  /// @param workloads   Are there as long as this is. Those with a state are left out.
  /// @param call_bytes  Of a call's tensors.
  Admission(std::span<const Workload* const> workloads, std::uint64_t call_bytes);

  /// @throws Error{kBadInput} for what it does not compute.
  [[nodiscard]] std::shared_ptr<const Workload> admit(const TaskMessage& task) const;
  /// What the worker announces: what it has room for.
  [[nodiscard]] std::vector<HelloMessage::Known> known() const;

 private:
  std::map<std::string, const Workload*, std::less<>> known_;
  std::uint64_t call_bytes_;
};

/// On a device of this machine, which it opens, with a worker's one cache. Of the thread that made
/// it.
/// @param backend     Outlives it.
/// @param kept_bytes  Of parameters and kernels, by what the process's heap holds for them.
/// @throws As Backend::open.
[[nodiscard]] std::unique_ptr<Computer> make_device_computer(const Backend& backend,
                                                             const UnitRequest& request,
                                                             std::uint64_t kept_bytes);

struct SlotProgram {
  std::vector<std::string> command;                  ///< Its file and arguments.
  std::function<Nanos(const Workload&)> call_limit;  ///< With preparing; then it is killed.
  Nanos end_limit = std::chrono::seconds(5);         ///< The same as the worker ends.
};

/// In a process of its own: a kernel that crashes, or takes too long, takes a try, and not the
/// worker. Starts the program when it is first needed, and again once it is gone, which is an error
/// of that call.
[[nodiscard]] std::unique_ptr<Computer> make_process_computer(SlotProgram program);

/// The body of that process: computes what comes until the line ends.
/// @param admission  Judges a call once more: the process trusts nobody either.
/// @return  Whether it ended where a call ends, and not within one, or for want of a device.
bool serve_computer(Computer& computer, const Admission& admission);

}  // namespace pirt::cloud
