#include <fmt/core.h>

#include <algorithm>

#include "workloads/backends/nats/service/computer.h"
#include "workloads/dnn/dnn.h"
#include "workloads/model/own_operation.h"
#include "workloads/recognition/scene_workload.h"

namespace pirt::cloud {
namespace {

/// Nobody's camera has a larger picture.
constexpr std::int64_t kMostPixels = std::int64_t{1} << 26;

/// A workload of the kind in other sizes; it is small whatever they are.
Decoded<Workload> made_in(const Workload& kind, std::span<const std::int64_t> sizes) {
  const auto all_within = [&](std::int64_t least, std::int64_t most) {
    return std::ranges::all_of(sizes, [=](auto each) { return each >= least && each <= most; });
  };
  if (sizes.size() == 1) {
    if (!all_within(2, 256)) return {std::nullopt, "no number of images"};
    if (!kind.has_tag("dnn") || !kind.variant.empty() || kind.batch > 1) {
      return {std::nullopt, "made in one size only"};
    }
    Workload made = dnn::batched(kind, static_cast<int>(sizes[0]));
    made.variant = "batch" + std::to_string(sizes[0]);
    made.name = kind.name + "@" + made.variant;  // as the catalogue names it
    return {std::move(made), ""};
  }
  if (sizes.size() != 2 || !all_within(64, 16384) || sizes[0] * sizes[1] > kMostPixels) {
    return {std::nullopt, "no sizes of a picture"};
  }
  const int width = static_cast<int>(sizes[0]), height = static_cast<int>(sizes[1]);
  if (const auto* const scene =
          dynamic_cast<const recognition::DescribeByModels*>(kind.operation.get())) {
    return {recognition::resized(*scene, width, height), ""};
  }
  if (!kind.at_size) return {std::nullopt, "made in one size only"};
  return {kind.at_size(width, height), ""};
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
  // Of what this has, as long as it is there.
  std::shared_ptr<const Workload> made(std::shared_ptr<void>(), at->second);
  const auto refuse = [&](const std::string& why) {
    return Decoded<std::shared_ptr<const Workload>>{std::nullopt, made->name + ": " + why};
  };
  // Of a user's own, one spec may be of several sizes.
  const bool as_it_is = own_operation(*made) == nullptr && task.spec == spec_digest(*made);
  if (!as_it_is && !task.sizes.empty() && task.sizes != kind_of(*made).sizes) {
    auto sized = made_in(*made, task.sizes);
    if (!sized.value) return refuse(sized.problem);
    made = std::make_shared<const Workload>(*std::move(sized.value));
  }
  if (task.spec != spec_digest(*made)) {
    return {std::nullopt,
            fmt::format("{} is something else here: {}, or another version of pirt", made->name,
                        task.sizes.empty() ? "other sizes" : "other models")};
  }
  const Workload& workload = *made;
  if (const std::uint64_t needed = call_bytes(workload); needed > call_bytes_) {
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
  if (const std::uint64_t bytes = task.inputs.size_bytes(); !may_be(bytes, workload.inputs)) {
    return refuse(fmt::format("{} bytes of inputs", bytes));
  }
  return {std::move(made), ""};
}

std::vector<HelloMessage::Known> Admission::known() const {
  std::vector<HelloMessage::Known> all;
  for (const auto& [name, workload] : known_) {
    if (call_bytes(*workload) <= call_bytes_) all.push_back({name, spec_digest(*workload)});
  }
  return all;
}

}  // namespace pirt::cloud
