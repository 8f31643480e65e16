// Debian's nats-server on a free loopback port with a store folder of its own, a wire between it
// and a client that can be cut and held up, and workloads that say how they are to be computed.
#pragma once

#include <sys/types.h>

#include <atomic>
#include <chrono>
#include <filesystem>
#include <functional>
#include <list>
#include <memory>
#include <mutex>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "workloads/backends/nats/link/stream.h"
#include "workloads/backends/nats/robot/robot_link.h"
#include "workloads/backends/nats/service/worker_link.h"
#include "workloads/base/error.h"
#include "workloads/model/backend.h"

namespace pirt::cloud::test {

/// Where it is; empty = nowhere.
[[nodiscard]] std::string nats_server_program();

/// Until it holds, for half a minute at most. @return  Whether it does.
template <typename Condition>
[[nodiscard]] bool eventually(const Condition& holds) {
  constexpr auto kLook = std::chrono::milliseconds(20);
  for (auto left = std::chrono::milliseconds(30'000); left.count() > 0; left -= kLook) {
    if (holds()) return true;
    std::this_thread::sleep_for(kLook);
  }
  return holds();
}

/// Kills it, and waits until it is gone.
void end_process(pid_t& process);

/// Of the Error that @p call throws; empty = it throws none.
template <typename Call>
[[nodiscard]] std::string error_of(const Call& call) {
  try {
    call();
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

class NatsServer {
 public:
  /// @param config  More of its configuration.
  /// @param store   More of that of its JetStream.
  explicit NatsServer(const std::string& config = "", bool jetstream = true,
                      const std::string& store = "");
  ~NatsServer();
  NatsServer(const NatsServer&) = delete;
  NatsServer& operator=(const NatsServer&) = delete;

  /// Until it answers. @return  Whether it does.
  /// @param environment  "NAME=value".
  bool start(const std::vector<std::string>& environment = {});
  /// As power loss does it, but for what the system has to write.
  void kill();
  [[nodiscard]] int port() const { return port_; }
  [[nodiscard]] std::string url() const { return "nats://127.0.0.1:" + std::to_string(port_); }
  [[nodiscard]] const std::filesystem::path& folder() const { return folder_; }
  /// Its id while it runs.
  [[nodiscard]] pid_t process() const { return process_; }
  /// What it said.
  [[nodiscard]] std::string log() const;

 private:
  std::filesystem::path folder_;
  int port_ = 0;
  pid_t process_ = -1;
};

/// A client that says what it likes: NATS's own protocol, byte by byte.
class RawClient {
 public:
  explicit RawClient(int port, const std::string& user = "", const std::string& password = "");
  ~RawClient();
  RawClient(const RawClient&) = delete;
  RawClient& operator=(const RawClient&) = delete;

  /// @return  Whether it went out.
  bool send(std::string_view text) const;
  bool publish(const std::string& subject, ByteView data, const std::string& reply = "") const;
  /// Until the server has seen all of it, or has hung up.
  void flush() const;

 private:
  int socket_ = -1;
};

/// Says that it is a server to one that comes, and falls silent.
class MuteServer {
 public:
  MuteServer();
  ~MuteServer();
  MuteServer(const MuteServer&) = delete;
  MuteServer& operator=(const MuteServer&) = delete;

  [[nodiscard]] std::string url() const { return "nats://127.0.0.1:" + std::to_string(port_); }
  void greet();

 private:
  int port_ = 0, listener_ = -1, client_ = -1;
};

/// Forwards a port of its own to the server's.
class Wire {
 public:
  explicit Wire(int to_port);
  ~Wire();
  Wire(const Wire&) = delete;
  Wire& operator=(const Wire&) = delete;

  [[nodiscard]] std::string url() const { return "nats://127.0.0.1:" + std::to_string(port_); }
  /// Ends what is connected; what comes next is, too, as long as it is cut.
  void cut(bool is_cut);
  /// Nothing gets through meanwhile, and nothing is lost.
  void hold(bool held) { held_ = held; }

 private:
  void accept_all();
  void forward(int client);

  int port_ = 0, to_port_ = 0, listener_ = -1;
  std::atomic<bool> cut_ = false, held_ = false, stopping_ = false;
  std::mutex mutex_;
  std::list<std::jthread> forwarders_;
  std::jthread acceptor_;
};

/// What the first byte of an input asks for; the second one is a time in units of 10 ms.
enum class Ask : std::uint8_t {
  kPlain = 0,
  kThrow = 1,
  kDie = 2,         ///< The process that computes it.
  kLoseDevice = 3,  ///< For good.
  kFail = 4,        ///< As a user's own function says that a call failed.
};

/// u8[size] -> u8[size]: each byte and 1, and the first byte of its parameters, if it has any.
[[nodiscard]] Workload adding(const std::string& name, std::int64_t size,
                              std::int64_t parameters = 0);
[[nodiscard]] std::unique_ptr<Computer> make_adding_computer();

/// A task of one of them, whose inputs fit into a message.
struct AddingTask {
  Ask ask = Ask::kPlain;
  std::uint8_t tens_of_ms = 0;
  std::uint8_t value = 1;
};
[[nodiscard]] TaskMessage make_message(const Workload& workload, const AddingTask& task);

/// A task of a robot's, once it was submitted.
class Submitted {
 public:
  Submitted(RobotLink& robot, TaskMessage task);

  [[nodiscard]] bool is_taken(Nanos most) const {
    return robot_->wait(most, [this] { return progress_->taken; });
  }
  /// With the problem "no end" where there is none in time.
  [[nodiscard]] ReplyMessage end(Nanos most) const;
  void cancel() const {
    robot_->step([this](Caller& caller, Nanos) { caller.cancel(id_); });
  }

 private:
  RobotLink* robot_;
  TaskId id_;
  std::shared_ptr<Progress> progress_;
};

[[nodiscard]] std::vector<Tensor> adding_inputs(const Workload& workload, const AddingTask& task);
/// What is wrong with its outputs; empty = nothing.
[[nodiscard]] std::string check_outputs(const Workload& workload, const AddingTask& task,
                                        const ReplyMessage& reply);
[[nodiscard]] std::string check_outputs(const Workload& workload, const AddingTask& task,
                                        const Tensor& output, std::uint8_t parameter = 0);
/// Of a robot's whole call, as a device's user makes it: upload, execute, download.
[[nodiscard]] std::string call_and_check(Kernel& kernel, const Workload& workload,
                                         const AddingTask& task, std::uint8_t parameter = 0);
/// In MB. @param process  Its id, or "self".
[[nodiscard]] double resident_mb(const std::string& process);
/// Parameters of a workload, each byte @p value.
[[nodiscard]] std::vector<Tensor> parameters_of(const Workload& workload, std::uint8_t value);
/// A unit of role cloud. @param settings  More of its YAML.
[[nodiscard]] std::unique_ptr<Device> open_unit(const std::string& url,
                                                const std::string& settings = "",
                                                double patience_s = 30);

/// A worker that computes them, and is soon heard of.
[[nodiscard]] WorkerOptions worker_options(const std::string& url);
/// A robot that waits for no server or worker for long.
[[nodiscard]] RobotOptions robot_options(const std::string& url);

/// Runs until the environment's parent kills it: what the test program is started for again.
void run_worker_process();
/// @return  Its process, which ends with this one.
[[nodiscard]] pid_t start_worker_process(const std::string& url, int slots);

/// A robot that has calls of each size under way for ever; likewise.
void run_robot_process();
[[nodiscard]] pid_t start_robot_process(const std::string& url);

}  // namespace pirt::cloud::test
