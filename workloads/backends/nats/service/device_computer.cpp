#include <malloc.h>

#include <algorithm>
#include <list>
#include <map>
#include <optional>
#include <tuple>
#include <utility>

#include "workloads/backends/nats/service/computer.h"

namespace pirt::cloud {
namespace {

constexpr std::size_t kMostKernels = 64;  ///< Of a robot.

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
    auto inputs = decode_tensors(call.task.inputs.bytes, call.workload->inputs);
    if (!inputs.value) return refusal(call, inputs.problem);
    const std::uint64_t before = held_bytes();
    if (auto refused = prepare(call)) return *std::move(refused);
    Entry& entry = entries_.front();
    std::vector<Tensor> outputs = make_tensors(call.workload->outputs);
    ReplyMessage reply;
    try {
      const Nanos begin = clock_.now();
      entry.kernel->bind(*inputs.value, outputs);
      entry.kernel->upload();
      static_cast<void>(entry.kernel->execute(1));
      entry.kernel->download();
      entry.kernel->unbind();
      reply.execute = clock_.now() - begin;
    } catch (...) {
      entries_.pop_front();  // Nobody knows what it refers to.
      throw;
    }
    const std::uint64_t call_bytes = encoded_bytes(call.workload->outputs), now = held_bytes();
    if (now > before + call_bytes) {
      entry.bytes = std::max(entry.bytes, now - before - call_bytes);
    }
    reply.outputs.bytes = encode_tensors(outputs);
    inputs.value->clear();
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

  static ReplyMessage refusal(const Call& call, const std::string& why) {
    return {.kind = ReplyKind::kRefused, .problem = call.workload->name + ": " + why};
  }

  /// The call's entry is the first one then.
  /// @return  That there are no parameters, or wrong ones; none = it is.
  std::optional<ReplyMessage> prepare(const Call& call) {
    Key key{call.task.workload, call.task.sizes, call.task.spec, {}};
    if (call.task.parameters) std::get<3>(key) = call.task.parameters->digest;
    const auto known = std::ranges::find(entries_, key, &Entry::key);
    if (known != entries_.end()) {
      entries_.splice(entries_.begin(), entries_, known);
      return std::nullopt;
    }
    Entry made{key, call.robot, 0, call.workload, {}, nullptr};
    if (call.task.parameters) {
      if (call.parameters.empty()) return ReplyMessage{.kind = ReplyKind::kMissing};
      auto decoded = decode_tensors(call.parameters, call.workload->parameters);
      if (!decoded.value) return refusal(call, "parameters: " + decoded.problem);
      made.parameters = std::move(*decoded.value);
    }
    made.bytes = encoded_bytes(call.workload->inputs) + encoded_bytes(call.workload->parameters) +
                 encoded_bytes(call.workload->outputs);
    made.kernel = device_->prepare(*made.workload, made.parameters);
    entries_.push_front(std::move(made));
    return std::nullopt;
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
      const auto over = std::ranges::find_if(
          robots, [](const auto& each) { return each.second.second > kMostKernels; });
      const bool full = std::max(counted, now - std::min(now, empty_bytes_)) > kept_bytes_;
      if (!full && over == robots.end()) break;
      const auto most =
          std::ranges::max_element(robots, {}, [](const auto& each) { return each.second.first; });
      const std::string& whose = over != robots.end() ? over->first : most->first;
      const auto oldest = std::find_if(entries_.rbegin(), entries_.rend(),
                                       [&](const Entry& each) { return each.robot == whose; });
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

}  // namespace

std::unique_ptr<Computer> make_device_computer(const Backend& backend, const UnitRequest& request,
                                               std::uint64_t kept_bytes) {
  return std::make_unique<DeviceComputer>(backend, request, kept_bytes);
}

}  // namespace pirt::cloud
