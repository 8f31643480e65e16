#include "workloads/backends/nats/service/computer.h"

#include <fmt/core.h>
#include <malloc.h>
#include <poll.h>
#include <signal.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <list>
#include <optional>
#include <tuple>
#include <type_traits>
#include <utility>

#include "workloads/base/error.h"
#include "workloads/base/system/child.h"
#include "workloads/base/system/deadline.h"
#include "workloads/base/system/file_descriptor.h"
#include "workloads/dnn/dnn.h"
#include "workloads/model/own_operation.h"
#include "workloads/recognition/scene_workload.h"

namespace pirt::cloud {
namespace {

/// Nobody's camera has a larger picture.
constexpr std::int64_t kMostPixels = std::int64_t{1} << 26;
constexpr std::size_t kMostKernels = 64;  ///< Of a robot.

/// A workload of the kind in other sizes; it is small whatever they are.
/// @throws Error{kBadInput} if there is none.
Workload made_in(const Workload& kind, std::span<const std::int64_t> sizes) {
  const auto all_within = [&](std::int64_t least, std::int64_t most) {
    return std::ranges::all_of(sizes, [=](auto each) { return each >= least && each <= most; });
  };
  const bool is_layer = kind.has_tag("dnn");
  if (sizes.size() == 1) {
    if (!all_within(2, 256)) throw_bad_input("no number of images");
    if (!is_layer || !kind.variant.empty() || kind.batch > 1) {
      throw_bad_input("made in one size only");
    }
    Workload made = dnn::batched(kind, static_cast<int>(sizes[0]));
    made.variant = "batch" + std::to_string(sizes[0]);
    made.name = kind.name + "@" + made.variant;  // as the catalogue names it
    return made;
  }
  // How small they may be the makers of layers, and of a user's own, say themselves.
  const std::int64_t least = is_layer || own_operation(kind) != nullptr ? 1 : 64;
  if (sizes.size() != 2 || !all_within(least, 16384) || sizes[0] * sizes[1] > kMostPixels) {
    throw_bad_input("no sizes of a picture");
  }
  const int width = static_cast<int>(sizes[0]), height = static_cast<int>(sizes[1]);
  if (const auto* const scene =
          dynamic_cast<const recognition::DescribeByModels*>(kind.operation.get())) {
    return recognition::resized(*scene, width, height);
  }
  if (!kind.at_size) throw_bad_input("made in one size only");
  return kind.at_size(width, height);
}

std::uint64_t call_bytes(const Workload& workload) {
  return encoded_bytes(workload.inputs) + encoded_bytes(workload.outputs) +
         encoded_bytes(workload.parameters);
}

/// Whether so many bytes may be tensors of these: lists that are not full have fewer.
bool may_be(std::uint64_t bytes, std::span<const TensorSpec> specs) {
  const std::uint64_t full = encoded_bytes(specs);
  return bytes == full || (bytes < full && std::ranges::any_of(specs, &TensorSpec::varies));
}

/// Tensors of a call. @throws Error{kBadInput} that names it, and @p what of it is wrong.
std::vector<Tensor> tensors_of(const Call& call, const char* what, ByteView bytes,
                               std::span<const TensorSpec> specs) {
  try {
    return decode_tensors(bytes, specs, own_operation(*call.workload) != nullptr);
  } catch (const Error& error) {
    throw_bad_input(call.workload->name + ": " + what + error.what());
  }
}

/// Of this process's heap, without @p passing.
std::uint64_t held_bytes(std::uint64_t passing = 0) {
  const struct mallinfo2 info = ::mallinfo2();
  return info.uordblks + info.hblkhd - std::min(info.uordblks + info.hblkhd, passing);
}

class DeviceComputer : public Computer {
 public:
  DeviceComputer(const Backend& backend, const UnitRequest& request, std::uint64_t kept_bytes)
      : kept_bytes_(kept_bytes), device_(backend.open(request)), empty_bytes_(held_bytes()) {}

  ReplyMessage compute(const Call& call) override {
    auto inputs = tensors_of(call, "", call.task.inputs.bytes, call.workload->inputs);
    const std::uint64_t before = held_bytes();
    if (!prepare(call)) return {.kind = ReplyKind::kMissing};
    Entry& entry = entries_.front();
    std::vector<Tensor> outputs = make_tensors(call.workload->outputs);
    ReplyMessage reply;
    try {
      const Nanos begin = clock_.now();
      entry.kernel->bind(inputs, outputs);
      entry.kernel->upload();
      static_cast<void>(entry.kernel->execute(1));
      entry.kernel->download();
      entry.kernel->unbind();
      reply.execute = clock_.now() - begin;
    } catch (const CallFailed& error) {  // What computes it goes on.
      entry.kernel->unbind();
      reply = failure(error);
    } catch (...) {
      entries_.pop_front();  // Nobody knows what it refers to.
      check_device();
      throw;
    }
    const std::uint64_t less = before + encoded_bytes(call.workload->outputs), now = held_bytes();
    if (now > less) entry.bytes = std::max(entry.bytes, now - less);
    if (const auto* const other = dynamic_cast<const OtherProcess*>(entry.kernel.get())) {
      const auto peak = static_cast<std::uint64_t>(other->peak_bytes().value_or(0));
      const std::uint64_t most = kept_bytes_ / 4 * 3;  // What is small has room beside it.
      entry.bytes = std::max(entry.bytes, std::min(most, call_bytes(*call.workload) + peak));
    }
    if (reply.kind == ReplyKind::kDone) reply.outputs.bytes = encode_tensors(outputs);
    inputs.clear();
    outputs.clear();
    keep_to_limits(call.parameters.size());
    return reply;
  }

 private:
  /// Workload, sizes, spec, and parameters' content: a user's workloads of one file differ in their
  /// names alone.
  using Key = std::tuple<std::string, std::vector<std::int64_t>, Digest, Digest>;
  struct Entry {
    Key key;
    std::string robot;
    std::uint64_t bytes = 0;
    std::shared_ptr<const Workload> workload;
    std::vector<Tensor> parameters;  ///< As long as the kernel, which may read them.
    std::unique_ptr<Kernel> kernel;
  };

  /// The call's entry is the first one then.
  /// @return  Whether it has its parameters.
  bool prepare(const Call& call) {
    const Key key{call.task.kind.name, call.task.kind.sizes, call.task.spec,
                  call.task.parameters.value_or(Blob()).digest};
    const auto known = std::ranges::find(entries_, key, &Entry::key);
    if (known != entries_.end()) {
      entries_.splice(entries_.begin(), entries_, known);
      return true;
    }
    Entry made{key, call.robot, call_bytes(*call.workload), call.workload, {}, nullptr};
    if (call.task.parameters) {
      if (call.parameters.empty()) return false;
      made.parameters =
          tensors_of(call, "parameters: ", call.parameters, call.workload->parameters);
    }
    made.kernel = build(*made.workload, made.parameters);
    entries_.push_front(std::move(made));
    return true;
  }

  void check_device() const {
    if (device_->is_lost()) throw ProcessGone("its device is lost");
  }

  /// Where others' kernels may have left it no room, without them: what they hold of a GPU's memory
  /// is in no heap.
  std::unique_ptr<Kernel> build(const Workload& workload, std::span<const Tensor> parameters) {
    while (true) {
      try {
        return device_->prepare(workload, parameters);
      } catch (const Error& error) {
        check_device();
        const bool has_room = error.code() != ErrorCode::kEnvironment || entries_.empty();
        if (has_room || !device_->supports(workload).ok) throw;
      }
      entries_.clear();
      ::malloc_trim(0);
    }
  }

  /// A kernel may hold what its tensors do not show, and memory that is none of this heap's: the
  /// larger of both counts.
  /// @param passing  Bytes of the call's parameters, which go with it.
  void keep_to_limits(std::uint64_t passing) {
    bool any = false;
    while (!entries_.empty()) {
      std::uint64_t counted = 0;
      std::map<std::string, std::pair<std::uint64_t, std::size_t>> robots;
      for (const Entry& each : entries_) {
        counted += each.bytes;
        robots[each.robot].first += each.bytes;
        ++robots[each.robot].second;
      }
      const std::uint64_t now = held_bytes(passing);
      const bool full = std::max(counted, now - std::min(now, empty_bytes_)) > kept_bytes_;
      const auto most = std::ranges::max_element(robots, {}, [](const auto& each) {
        return std::pair(each.second.second > kMostKernels, each.second.first);
      });
      if (!full && most->second.second <= kMostKernels) break;
      const auto oldest =
          std::ranges::find(entries_.rbegin(), entries_.rend(), most->first, &Entry::robot);
      entries_.erase(std::next(oldest).base());
      any = true;
    }
    if (any) ::malloc_trim(0);
    // What libraries keep for themselves is none of an entry's.
    if (entries_.empty()) empty_bytes_ = held_bytes(passing);
  }

  std::uint64_t kept_bytes_;
  MachineClock clock_;
  std::unique_ptr<Device> device_;
  std::uint64_t empty_bytes_;
  /// The one that was used last is the first. Kernels go before their device.
  std::list<Entry> entries_;
};

// First nothing, with its length: it is ready.
// A call: the robot's name, a frame with the task, and its parameters, or nothing; then a frame
// with the reply. Each with its length before it.
constexpr int kSlotDescriptor = 3;  ///< Where a slot's process finds its end of the line.
constexpr std::uint64_t kMostFrame = kMostBlobBytes + (1 << 20);
constexpr Nanos kLook = std::chrono::milliseconds(100);  ///< While the other end says nothing.

class Line {
 public:
  /// @param wait  How long to wait now, as Deadline says it; empty = as long as there is a line.
  explicit Line(int descriptor, std::function<Nanos()> wait = {})
      : descriptor_(descriptor), wait_(std::move(wait)) {}

  [[nodiscard]] bool put(ByteView bytes) const {
    const std::uint64_t size = bytes.size();
    return transfer(std::as_bytes(std::span(&size, 1))) && transfer(bytes);
  }
  /// @param most  Of bytes: more is no message of the other end's.
  [[nodiscard]] bool get(Bytes& bytes, std::uint64_t most) const {
    std::uint64_t size = 0;
    if (!transfer(std::as_writable_bytes(std::span(&size, 1))) || size > most) return false;
    bytes.resize(static_cast<std::size_t>(size));
    return transfer(std::span(bytes));
  }

 private:
  /// Sends what is const, and reads all else. What can be moved is, however late it is.
  template <typename Byte>
  [[nodiscard]] bool transfer(std::span<Byte> bytes) const {
    constexpr bool sends = std::is_const_v<Byte>;
    while (!bytes.empty()) {
      pollfd ready{descriptor_, sends ? POLLOUT : POLLIN, 0};
      const int wait_ms = wait_ ? poll_ms(wait_()) : -1;
      if (::poll(&ready, 1, wait_ms) == 0) {
        if (wait_ms == 0) return false;
        continue;
      }
      ssize_t moved = 0;
      if constexpr (sends) {
        moved = ::send(descriptor_, bytes.data(), bytes.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
      } else {
        moved = ::recv(descriptor_, bytes.data(), bytes.size(), MSG_DONTWAIT);
      }
      if (moved < 0 && (errno == EINTR || errno == EAGAIN)) continue;
      if (moved <= 0) return false;
      bytes = bytes.subspan(static_cast<std::size_t>(moved));
    }
    return true;
  }

  int descriptor_;
  std::function<Nanos()> wait_;
};

class ProcessComputer : public Computer {
 public:
  explicit ProcessComputer(SlotProgram program) : program_(std::move(program)) {}
  ~ProcessComputer() override { static_cast<void>(end()); }

  ReplyMessage compute(const Call& call) override {
    // One that died after the call before is no end of this one.
    if (process_ > 0 && ::waitpid(process_, nullptr, WNOHANG) != 0) process_ = -1;
    if (process_ <= 0) start(call);
    const Nanos limit = program_.call_limit(*call.workload);
    Deadline deadline(clock_.now(), limit);
    std::optional<Deadline> ending;  // As the worker ends.
    bool over = false;
    const Line line(line_.get(), [&] {
      if (!ending && call.stop()) ending.emplace(clock_.now(), program_.end_limit);
      const Nanos now = clock_.now();
      Nanos wait = deadline.next_wait(now, kLook);
      if (ending) wait = std::min(wait, ending->next_wait(now, kLook));
      over = wait == Nanos::zero();
      return wait;
    });
    try {
      Bytes bytes;
      if (line.put(std::as_bytes(std::span(call.robot))) && line.put(encode(call.task)) &&
          line.put(call.parameters) &&
          line.get(bytes, encoded_bytes(call.workload->outputs) + (64 << 10))) {
        ReplyMessage reply = decode_as<ReplyMessage>(bytes);
        if (!reply.outputs.blob) return reply;
      }
    } catch (const Error&) {  // What it said is no reply.
    } catch (...) {           // What it was in the middle of would be taken for the next call's.
      static_cast<void>(end(true));
      throw;
    }
    const std::string how = end(over);
    if (over && ending) return {.kind = ReplyKind::kLater, .problem = "the worker ends"};
    throw ProcessGone(over ? fmt::format("it was over its limit of {:.3g} s (pirt cloud-worker "
                                         "--call-limit, --profile): its process was killed",
                                         to_s(limit))
                           : "its process " + how);
  }

 private:
  /// Until the process says that it computes.
  /// @throws NotDone if it does not: that is no fault of the call's.
  void start(const Call& call) {
    constexpr Nanos kStart = std::chrono::seconds(60), kAgain = std::chrono::seconds(1);
    int ends[2] = {-1, -1};
    const bool has_line = ::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends) == 0;
    line_ = FileDescriptor(ends[0]);
    FileDescriptor theirs(ends[1]);
    if (has_line) process_ = start_child(program_.command, {-1, -1, -1, theirs.get()});
    std::string how = std::string("no process could be started: ") + std::strerror(errno);
    theirs.close();
    if (process_ > 0) {
      Deadline deadline(clock_.now(), kStart);
      Bytes none;
      const Line line(line_.get(), [&] {
        return call.stop() ? Nanos::zero() : deadline.next_wait(clock_.now(), kLook);
      });
      if (line.get(none, 0)) return;
      how = "its process " + end(true);
    }
    // It would be claimed again at once.
    for (const Nanos next = clock_.now() + kAgain; !call.stop() && clock_.now() < next;) {
      ::usleep(10'000);
    }
    throw NotDone(ReplyKind::kLater,
                  "a slot of the worker could not start (its output says why): " + how);
  }

  /// Kills it, if it does not end with its line, or at once. @return  How it ended.
  std::string end(bool at_once = false) {
    if (at_once && process_ > 0) ::kill(process_, SIGKILL);
    line_.close();
    if (process_ <= 0) return "is not there";
    int status = 0;
    pid_t got = 0;
    const Nanos until = clock_.now() + program_.end_limit;
    while ((got = ::waitpid(process_, &status, WNOHANG)) == 0) {
      if (clock_.now() >= until) ::kill(process_, SIGKILL);
      ::usleep(1000);
    }
    process_ = -1;
    return how_ended(got < 0 ? std::nullopt : std::optional(status));
  }

  SlotProgram program_;
  MachineClock clock_;
  pid_t process_ = -1;
  FileDescriptor line_;
};

}  // namespace

ReplyMessage failure(const std::exception& error) {
  ReplyMessage reply{.kind = ReplyKind::kFailedTry, .problem = error.what()};
  const auto* const known = dynamic_cast<const Error*>(&error);
  if (known != nullptr && known->code() == ErrorCode::kBadInput) reply.kind = ReplyKind::kRefused;
  if (const auto* const done = dynamic_cast<const NotDone*>(&error)) reply.kind = done->kind;
  if (dynamic_cast<const CallFailed*>(&error) != nullptr) reply.kind = ReplyKind::kCallFailed;
  if (reply.problem.empty()) reply.problem = "an error without words";
  return reply;
}

Admission::Admission(std::span<const Workload* const> workloads, std::uint64_t call_bytes)
    : call_bytes_(call_bytes) {
  for (const Workload* each : workloads) {
    if (!each->state) known_[each->name] = each;
  }
}

std::shared_ptr<const Workload> Admission::admit(const TaskMessage& task) const {
  const std::vector<std::int64_t>& sizes = task.kind.sizes;
  const auto at = known_.find(task.kind.name);
  if (at == known_.end()) throw_bad_input("unknown workload '" + task.kind.name + "'");
  // Of what this has, as long as it is there.
  std::shared_ptr<const Workload> made(std::shared_ptr<void>(), at->second);
  const auto refuse = [&](const std::string& why) { throw_bad_input(made->name + ": " + why); };
  // Of a user's own, one spec may be of several sizes.
  const bool as_it_is = own_operation(*made) == nullptr && task.spec == spec_digest(*made);
  if (!as_it_is && !sizes.empty() && sizes != kind_of(*made).sizes) {
    try {
      made = std::make_shared<const Workload>(made_in(*made, sizes));
    } catch (const Error& error) {
      refuse(error.what());
    }
  }
  if (task.spec != spec_digest(*made)) {
    throw_bad_input(fmt::format("{} is something else here: {}, or another version of pirt",
                                made->name, sizes.empty() ? "other sizes" : "other models"));
  }
  const Workload& workload = *made;
  if (const std::uint64_t needed = call_bytes(workload); needed > call_bytes_) {
    refuse(
        fmt::format("a call has {} MB of tensors, and may have {} here (pirt cloud-worker "
                    "--cache-mb)",
                    needed >> 20, call_bytes_ >> 20));
  }
  if (task.parameters.has_value() == workload.parameters.empty()) {
    refuse("parameters that it does not have, or none");
  }
  if (task.parameters && !may_be(task.parameters->size_bytes, workload.parameters)) {
    refuse(fmt::format("{} bytes of parameters", task.parameters->size_bytes));
  }
  if (const std::uint64_t bytes = task.inputs.size_bytes(); !may_be(bytes, workload.inputs)) {
    refuse(fmt::format("{} bytes of inputs", bytes));
  }
  return made;
}

std::vector<HelloMessage::Known> Admission::known() const {
  std::vector<HelloMessage::Known> all;
  for (const auto& [name, workload] : known_) {
    if (call_bytes(*workload) <= call_bytes_) all.push_back({name, spec_digest(*workload)});
  }
  return all;
}

std::unique_ptr<Computer> make_device_computer(const Backend& backend, const UnitRequest& request,
                                               std::uint64_t kept_bytes) {
  return std::make_unique<DeviceComputer>(backend, request, kept_bytes);
}

std::unique_ptr<Computer> make_process_computer(SlotProgram program) {
  return std::make_unique<ProcessComputer>(std::move(program));
}

bool serve_computer(Computer& computer, const Admission& admission) {
  const Line line(kSlotDescriptor);
  if (!line.put({})) return true;
  Bytes name, frame;
  while (line.get(name, 64) && line.get(frame, kMostFrame)) {
    Call call{.robot = std::string(reinterpret_cast<const char*>(name.data()), name.size())};
    if (!line.get(call.parameters, kMostFrame)) break;
    ReplyMessage reply;
    try {
      call.task = decode_as<TaskMessage>(frame);
      call.workload = admission.admit(call.task);
      if (call.task.inputs.blob) throw_bad_input("its inputs are elsewhere");
      reply = computer.compute(call);
    } catch (const ProcessGone&) {
      return false;
    } catch (const std::exception& error) {
      reply = failure(error);
    }
    if (!line.put(encode(reply))) return false;
  }
  return true;
}

}  // namespace pirt::cloud
