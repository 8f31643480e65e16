#include "workloads/backends/nats/wire/tensors.h"

#include <fmt/core.h>

#include <bit>
#include <cstring>

#include "workloads/backends/nats/wire/bytes.h"
#include "workloads/model/own_operation.h"
#include "workloads/recognition/scene_workload.h"

namespace pirt::cloud {
namespace {

static_assert(std::endian::native == std::endian::little, "tensors travel as they lie in memory");

/// What a tensor's entry says, with its bytes.
struct Entry {
  std::int64_t rows = 0;
  ByteView bytes;
};

Entry read_entry(Reader& in, const TensorSpec& spec) {
  Entry entry{.rows = in.number<std::int64_t>(), .bytes = {}};
  const std::int64_t capacity = spec.shape.empty() ? 1 : spec.shape[0];
  const bool fits =
      entry.rows == capacity || (spec.varies && entry.rows >= 0 && entry.rows < capacity);
  if (in.ok() && !fits) in.fail(fmt::format("{} rows for {}", entry.rows, spec.describe()));
  if (!in.ok()) return entry;
  const std::int64_t row_bytes = spec.size_bytes() / capacity;
  entry.bytes = in.raw(static_cast<std::uint64_t>(entry.rows * row_bytes), spec.name);
  return entry;
}

void fill(Tensor& tensor, const Entry& entry) {
  if (tensor.spec().varies) tensor.set_rows(entry.rows);
  if (!entry.bytes.empty()) std::memcpy(tensor.data(), entry.bytes.data(), entry.bytes.size());
}

/// All of them, or none and the problem.
std::string read_entries(ByteView bytes, std::span<const TensorSpec> specs,
                         std::vector<Entry>& entries) {
  Reader in(bytes);
  const auto count = in.number<std::uint32_t>();
  if (in.ok() && count != specs.size()) {
    in.fail(fmt::format("{} tensors, and {} are expected", count, specs.size()));
  }
  for (std::size_t i = 0; i < specs.size() && in.ok(); ++i) {
    entries.push_back(read_entry(in, specs[i]));
  }
  return in.finish();
}

void add_specs(Writer& out, std::span<const TensorSpec> specs) {
  out(static_cast<std::uint32_t>(specs.size()));
  for (const TensorSpec& spec : specs) out(spec.element, spec.varies, spec.shape);
}

}  // namespace

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
  std::vector<Entry> entries;
  std::string problem = read_entries(bytes, specs, entries);
  if (!problem.empty()) return {std::nullopt, std::move(problem)};
  auto tensors = make_tensors(specs);
  for (std::size_t i = 0; i < tensors.size() && problem.empty(); ++i) {
    fill(tensors[i], entries[i]);
    problem = out_of_range(tensors[i]);
  }
  if (!problem.empty()) return {std::nullopt, std::move(problem)};
  return {std::move(tensors), ""};
}

std::string decode_tensors_into(ByteView bytes, std::span<Tensor> tensors) {
  std::vector<TensorSpec> specs;
  for (const Tensor& tensor : tensors) specs.push_back(tensor.spec());
  std::vector<Entry> entries;
  std::string problem = read_entries(bytes, specs, entries);
  for (std::size_t i = 0; problem.empty() && i < tensors.size(); ++i) fill(tensors[i], entries[i]);
  return problem;
}

Digest spec_digest(const Workload& workload) {
  Writer out;
  out(workload.kernel, workload.variant, workload.precision, workload.batch);
  add_specs(out, workload.inputs);
  add_specs(out, workload.parameters);
  add_specs(out, workload.outputs);
  if (const auto* const scene =
          dynamic_cast<const recognition::DescribeByModels*>(workload.operation.get())) {
    out(scene->fingerprint);
  }
  if (const OwnOperation* const own = own_operation(workload)) out(own->digest);
  return digest_of(out.take());
}

}  // namespace pirt::cloud
