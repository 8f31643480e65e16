#include "workloads/backends/nats/worker/admission.h"

#include <fmt/core.h>

namespace pirt::cloud {
namespace {

std::uint64_t encoded_bytes(std::span<const TensorSpec> specs) {
  std::uint64_t size = 4;
  for (const TensorSpec& spec : specs) size += 8 + static_cast<std::uint64_t>(spec.size_bytes());
  return size;
}

}  // namespace

Admission::Admission(std::span<const Workload* const> workloads) {
  for (const Workload* each : workloads) {
    if (each->state) continue;
    known_[each->name] = {each, spec_digest(*each), encoded_bytes(each->parameters)};
  }
}

Decoded<Admitted> Admission::admit(ByteView bytes) const {
  const auto body = decode_body(bytes);
  if (!body.value) return {std::nullopt, body.problem};
  const TaskBody& task = *body.value;
  const auto at = known_.find(task.workload);
  if (at == known_.end()) return {std::nullopt, "unknown workload '" + task.workload + "'"};
  Known known = at->second;
  if (task.spec != known.spec && !task.sizes.empty()) {
    const auto own = own_sizes_.find(*known.workload, task.sizes, task.spec);
    if (own.workload == nullptr) return {std::nullopt, own.problem};
    known = {own.workload, task.spec, encoded_bytes(own.workload->parameters)};
  }
  if (task.spec != known.spec) {
    return {std::nullopt, task.workload +
                              " is something else here: other sizes, or another "
                              "version of pirt"};
  }
  if (task.parameters.has_value() == known.workload->parameters.empty()) {
    return {std::nullopt, task.workload + ": parameters that it does not have, or none"};
  }
  // Those of lists that are not full have fewer bytes.
  if (task.parameters && task.parameters->size_bytes > known.parameter_bytes) {
    return {std::nullopt,
            fmt::format("{}: {} bytes of parameters", task.workload, task.parameters->size_bytes)};
  }
  auto inputs = decode_tensors(task.tensors, known.workload->inputs);
  if (!inputs.value) return {std::nullopt, task.workload + ": " + inputs.problem};
  return {Admitted{known.workload, task.parameters, std::move(*inputs.value)}, ""};
}

std::vector<AnnouncementMessage::Known> Admission::known() const {
  std::vector<AnnouncementMessage::Known> all;
  for (const auto& [name, known] : known_) all.push_back({name, known.spec});
  return all;
}

}  // namespace pirt::cloud
