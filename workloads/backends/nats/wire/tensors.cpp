#include "workloads/backends/nats/wire/tensors.h"

#include <fmt/core.h>

#include <bit>
#include <cstring>

#include "workloads/backends/nats/wire/bytes.h"
#include "workloads/model/own_operation.h"
#include "workloads/own/definition.h"
#include "workloads/recognition/scene_workload.h"
#include "workloads/recognition/specs.h"
#include "workloads/vision/vision.h"

namespace pirt::cloud {

static_assert(std::endian::native == std::endian::little, "tensors travel as they lie in memory");

Bytes encode_tensors(std::span<const Tensor> tensors) {
  Writer out;
  std::size_t size = 4;
  for (const Tensor& tensor : tensors) size += 8 + tensor.used_bytes().size();
  out.reserve(size);
  out(static_cast<std::uint32_t>(tensors.size()));
  for (const Tensor& tensor : tensors) out(tensor.rows()).raw(tensor.used_bytes());
  return out.take();
}

std::uint64_t encoded_bytes(std::span<const TensorSpec> specs) {
  std::uint64_t size = 4;
  for (const TensorSpec& spec : specs) size += 8 + static_cast<std::uint64_t>(spec.size_bytes());
  return size;
}

Decoded<std::vector<Tensor>> decode_tensors(ByteView bytes, std::span<const TensorSpec> specs) {
  auto tensors = make_tensors(specs);
  std::string problem = decode_tensors_into(bytes, tensors);
  for (const Tensor& each : tensors) {
    if (problem.empty()) problem = out_of_range(each);
  }
  if (!problem.empty()) return {std::nullopt, std::move(problem)};
  return {std::move(tensors), ""};
}

std::string decode_tensors_into(ByteView bytes, std::span<Tensor> tensors) {
  for (const bool copies : {false, true}) {  // Once all of it fits.
    Reader in(bytes);
    const auto count = in.number<std::uint32_t>();
    if (count != tensors.size()) {
      in.fail(fmt::format("{} tensors, and {} are expected", count, tensors.size()));
    }
    for (Tensor& tensor : tensors) {
      const TensorSpec& spec = tensor.spec();
      const std::int64_t capacity = spec.shape.empty() ? 1 : spec.shape[0];
      const auto rows = in.number<std::int64_t>();
      const bool fits = rows == capacity || (spec.varies && rows >= 0 && rows < capacity);
      if (!fits) in.fail(fmt::format("{} rows for {}", rows, spec.describe()));
      if (!in.ok()) break;
      const std::int64_t size = rows * (spec.size_bytes() / capacity);
      const ByteView data = in.raw(static_cast<std::uint64_t>(size), spec.name);
      if (!copies) continue;
      if (spec.varies) tensor.set_rows(rows);
      if (!data.empty()) std::memcpy(tensor.data(), data.data(), data.size());
    }
    if (std::string problem = in.finish(); !problem.empty()) return problem;
  }
  return "";
}

Digest spec_digest(const Workload& workload) {
  Writer out;
  out(workload.kernel, workload.variant, workload.precision, workload.batch);
  for (const auto* const specs : {&workload.inputs, &workload.parameters, &workload.outputs}) {
    out(static_cast<std::uint32_t>(specs->size()));
    for (const TensorSpec& spec : *specs) out(spec.element, spec.varies, spec.shape);
  }
  if (const auto* const scene =
          dynamic_cast<const recognition::DescribeByModels*>(workload.operation.get())) {
    out(scene->fingerprint);
  }
  if (const OwnOperation* const own = own_operation(workload)) out(own->digest);
  return digest_of(out.take());
}

Kind kind_of(const Workload& workload) {
  const std::string suffix = "@" + workload.variant;
  if (workload.batch > 1 && workload.name.ends_with(suffix)) {  // fc6@batch8
    return {workload.name.substr(0, workload.name.size() - suffix.size()), {workload.batch}};
  }
  if (const auto size = own::size_in(workload.name)) {
    return {own::plain_name(workload.name), {size->width, size->height}};
  }
  const Operation* const operation = workload.operation.get();
  if (const auto* const scene = dynamic_cast<const recognition::DescribeByModels*>(operation)) {
    const Workload known =
        recognition::resized(*scene, recognition::kPictureWidth, recognition::kPictureHeight);
    return {.name = workload.name,
            .sizes = {scene->width, scene->height},
            .known_by = spec_digest(known),
            .differs = "other models, or another version of pirt",
            .missing = ": it was given no models (pirt cloud-worker --model)"};
  }
  const auto* const image = dynamic_cast<const vision::ImageOperation*>(operation);
  if (image == nullptr || !workload.variant.empty() || workload.batch > 1) {
    return {.name = workload.name, .known_by = spec_digest(workload)};
  }
  return {workload.name, {image->width, image->height}};
}

}  // namespace pirt::cloud
