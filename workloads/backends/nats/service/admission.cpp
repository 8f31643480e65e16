#include <fmt/core.h>

#include <algorithm>

#include "workloads/backends/nats/service/computer.h"

namespace pirt::cloud {
namespace {

/// Whether so many bytes may be tensors of these: lists that are not full have fewer.
bool may_be(std::uint64_t bytes, std::span<const TensorSpec> specs) {
  const std::uint64_t full = encoded_bytes(specs);
  return bytes == full || (bytes < full && std::ranges::any_of(specs, &TensorSpec::varies));
}

}  // namespace

Admission::Admission(std::span<const Workload* const> workloads, std::uint64_t call_bytes)
    : call_bytes_(call_bytes) {
  for (const Workload* each : workloads) {
    if (!each->state) known_[each->name] = each;
  }
}

Decoded<std::shared_ptr<const Workload>> Admission::admit(const TaskMessage& task) const {
  const auto at = known_.find(task.workload);
  if (at == known_.end()) return {std::nullopt, "unknown workload '" + task.workload + "'"};
  auto made = of_kind(*at->second, task.sizes, task.spec);
  if (!made.value) return made;
  const Workload& workload = **made.value;
  const auto refuse = [&](const std::string& why) {
    return Decoded<std::shared_ptr<const Workload>>{std::nullopt, workload.name + ": " + why};
  };
  const std::uint64_t needed = encoded_bytes(workload.inputs) + encoded_bytes(workload.outputs) +
                               encoded_bytes(workload.parameters);
  if (needed > call_bytes_) {
    return refuse(
        fmt::format("a call has {} MB of tensors, and may have {} here (pirt cloud-worker "
                    "--cache-mb)",
                    needed >> 20, call_bytes_ >> 20));
  }
  if (task.parameters.has_value() == workload.parameters.empty()) {
    return refuse("parameters that it does not have, or none");
  }
  if (task.parameters && !may_be(task.parameters->size_bytes, workload.parameters)) {
    return refuse(fmt::format("{} bytes of parameters", task.parameters->size_bytes));
  }
  const auto* const blob = std::get_if<Blob>(&task.inputs);
  const std::uint64_t bytes =
      blob != nullptr ? blob->size_bytes : std::get<Bytes>(task.inputs).size();
  if (!may_be(bytes, workload.inputs)) return refuse(fmt::format("{} bytes of inputs", bytes));
  return made;
}

std::vector<HelloMessage::Known> Admission::known() const {
  std::vector<HelloMessage::Known> all;
  for (const auto& [name, workload] : known_) all.push_back({name, spec_digest(*workload)});
  return all;
}

std::string one_line(std::string text) {
  for (char& c : text) {
    if (c < ' ' || c > '~') c = ' ';
  }
  return text.substr(0, 500);
}

}  // namespace pirt::cloud
