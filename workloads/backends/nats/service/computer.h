// Who computes a worker's calls, one after the other; each slot has its own.
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

#include "workloads/backends/nats/wire/tensors.h"
#include "workloads/model/backend.h"

namespace pirt::cloud {

/// One call, whose sizes were judged (Admission).
struct Call {
  const std::string& robot;
  const TaskMessage& task;  ///< Its inputs are in it.
  std::shared_ptr<const Workload> workload;
  ByteView parameters = {};                           ///< Empty as long as they were not missed.
  std::function<bool()> stop = [] { return false; };  ///< The worker ends.
};

class Computer {
 public:
  virtual ~Computer() = default;
  /// @return  Its kind, problem, outputs and time; kMissing: it needs the parameters.
  /// @throws std::exception if it did not work: a try that failed.
  [[nodiscard]] virtual ReplyMessage compute(const Call& call) = 0;
};

/// The call ended the process that computed it.
struct ProcessGone : std::runtime_error {
  using std::runtime_error::runtime_error;
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
  /// What the worker announces: what it has room for.
  [[nodiscard]] std::vector<HelloMessage::Known> known() const;

 private:
  std::map<std::string, const Workload*, std::less<>> known_;
  std::uint64_t call_bytes_;
};

/// On a device of this machine, with the one cache of a worker: of parameters and kernels together.
/// Opens the device. Of the thread that made it.
/// @param backend     Outlives it.
/// @param kept_bytes  Of parameters and kernels, by what the process holds of memory for them. The
///                    robot that has the most loses what it used longest ago.
/// @throws As Backend::open.
[[nodiscard]] std::unique_ptr<Computer> make_device_computer(const Backend& backend,
                                                             const UnitRequest& request,
                                                             std::uint64_t kept_bytes);

/// In a process of its own: a kernel that crashes, or takes too long, takes a try, and not the
/// worker.
/// Where the process finds its end of the line.
inline constexpr int kSlotDescriptor = 3;

struct SlotProgram {
  std::string program;
  std::vector<std::string> arguments = {};
  Nanos call_limit = std::chrono::seconds(60);  ///< With preparing; then the process is killed.
  std::map<const Workload*, Nanos> call_limits = {};  ///< In its place, of those that are here.
  /// The same for a call that is computed as the worker ends.
  Nanos end_limit = std::chrono::seconds(5);
};

/// Starts the program when it is first needed, and again once it is gone, which is an error of that
/// call. Whatever it holds ends with it.
[[nodiscard]] std::unique_ptr<Computer> make_process_computer(SlotProgram program);

/// The body of that process: computes what comes until the line ends.
/// @param admission  Judges a call once more: the process trusts nobody either.
/// @return  Whether it ended where a call ends.
bool serve_computer(Computer& computer, const Admission& admission, int line = kSlotDescriptor);

}  // namespace pirt::cloud
