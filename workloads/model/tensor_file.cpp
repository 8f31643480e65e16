#include "workloads/model/tensor_file.h"

#include <algorithm>
#include <cstring>
#include <iterator>
#include <string>
#include <string_view>

#include "workloads/base/error.h"
#include "workloads/base/hash.h"
#include "workloads/base/text/text.h"

namespace pirt {
namespace {

constexpr std::string_view kMagic = "pirtTNS2";

std::uint64_t content_hash(std::string_view payload) {
  return Hash64().add(std::as_bytes(std::span(payload))).value();
}

[[noreturn]] void throw_other_specs(const std::filesystem::path& path) {
  throw_bad_input("tensor file '" + path.string() +
                  "' has other tensors than expected; start again");
}

/// The next tensor of the payload.
void take(std::string_view& payload, Tensor& tensor, const std::filesystem::path& path) {
  std::int64_t rows = 0;
  if (payload.size() < sizeof rows) throw_other_specs(path);
  std::memcpy(&rows, payload.data(), sizeof rows);
  payload.remove_prefix(sizeof rows);
  if (rows != tensor.rows()) {
    if (!tensor.spec().varies || rows < 0 || rows > tensor.rows()) throw_other_specs(path);
    tensor.set_rows(rows);
  }
  const std::size_t size = tensor.used_bytes().size();
  if (payload.size() < size) throw_other_specs(path);
  if (size != 0) std::memcpy(tensor.data(), payload.data(), size);
  payload.remove_prefix(size);
}

}  // namespace

void write_tensors(const std::filesystem::path& path, std::span<const Tensor> tensors) {
  std::vector<const Tensor*> all;
  for (const Tensor& tensor : tensors) all.push_back(&tensor);
  write_tensors(path, all);
}

void write_tensors(const std::filesystem::path& path, std::span<const Tensor* const> tensors) {
  std::string payload;
  for (const Tensor* tensor : tensors) {
    const auto bytes = tensor->used_bytes();
    const std::int64_t rows = tensor->rows();
    payload.append(reinterpret_cast<const char*>(&rows), sizeof rows);
    payload.append(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  }
  const std::uint64_t hash = content_hash(payload);
  std::string text(kMagic);
  text.append(reinterpret_cast<const char*>(&hash), sizeof hash);
  text += payload;
  write_file(path, text);
}

std::vector<Tensor> read_tensors(const std::filesystem::path& path,
                                 std::span<const TensorSpec> specs) {
  const std::string text = read_file(path, kAnySize);
  std::vector<Tensor> tensors = make_tensors(specs);
  std::uint64_t hash = 0;
  if (text.size() < kMagic.size() + sizeof hash || !text.starts_with(kMagic)) {
    throw_bad_input("'" + path.string() + "' is no tensor file of this version; start again");
  }
  std::memcpy(&hash, text.data() + kMagic.size(), sizeof hash);
  std::string_view payload(text);
  payload.remove_prefix(kMagic.size() + sizeof hash);
  if (content_hash(payload) != hash) {
    throw_bad_input("tensor file '" + path.string() + "' is damaged; start again");
  }
  for (Tensor& tensor : tensors) take(payload, tensor, path);
  if (!payload.empty()) throw_other_specs(path);
  return tensors;
}

std::vector<TensorSpec> reference_specs(const Workload& workload) {
  std::vector<TensorSpec> specs = workload.outputs;
  for (TensorSpec& spec : specs) {
    if (spec.element == Element::kF32) spec.element = Element::kF64;
  }
  return specs;
}

namespace {

std::filesystem::path notes_of(std::filesystem::path path) { return path += ".notes"; }
std::filesystem::path state_of(std::filesystem::path path) { return path += ".state"; }

}  // namespace

void write_data(const std::filesystem::path& path, std::span<const Data> frames,
                std::span<const Tensor> state) {
  std::string notes;
  std::vector<const Tensor*> all;
  for (const Data& data : frames) {
    notes += join(data.notes, ";") + "\n";
    for (const auto* part : {&data.inputs, &data.parameters}) {
      for (const Tensor& tensor : *part) all.push_back(&tensor);
    }
  }
  // First: they are looked for by the other's name.
  write_file(notes_of(path), notes);
  if (!state.empty()) write_tensors(state_of(path), state);
  write_tensors(path, all);
}

std::vector<Data> read_data(const std::filesystem::path& path, const Workload& workload) {
  std::vector<TensorSpec> one = workload.inputs;
  one.insert(one.end(), workload.parameters.begin(), workload.parameters.end());
  std::vector<TensorSpec> specs;
  for (int frame = 0; frame < workload.frames; ++frame) {
    specs.insert(specs.end(), one.begin(), one.end());
  }
  auto tensors = read_tensors(path, specs);
  const auto notes = split(read_file(notes_of(path)), '\n');
  std::vector<Data> frames(static_cast<std::size_t>(workload.frames));
  auto next = std::make_move_iterator(tensors.begin());
  for (std::size_t frame = 0; frame < frames.size(); ++frame) {
    const auto inputs = next + std::ssize(workload.inputs);
    const auto end = inputs + std::ssize(workload.parameters);
    frames[frame].inputs.assign(next, inputs);
    frames[frame].parameters.assign(inputs, end);
    if (!notes.at(frame).empty()) frames[frame].notes = split(notes[frame], ';');
    next = end;
  }
  return frames;
}

std::vector<Tensor> read_state(const std::filesystem::path& path, const Workload& workload) {
  return workload.state ? read_tensors(state_of(path), workload.state->tensors)
                        : std::vector<Tensor>();
}

void write_reference(const std::filesystem::path& path, std::vector<std::vector<Tensor>> sequence) {
  std::vector<Tensor> all;
  for (auto& frame : sequence) std::ranges::move(frame, std::back_inserter(all));
  write_tensors(path, all);
}

std::vector<std::vector<Tensor>> read_reference(const std::filesystem::path& path,
                                                const Workload& workload) {
  const auto one = reference_specs(workload);
  std::vector<TensorSpec> specs;
  for (int frame = 0; frame < workload.frames; ++frame) {
    specs.insert(specs.end(), one.begin(), one.end());
  }
  auto all = read_tensors(path, specs);
  std::vector<std::vector<Tensor>> sequence(static_cast<std::size_t>(workload.frames));
  for (std::size_t i = 0; i < all.size(); ++i) {
    sequence[i / one.size()].push_back(std::move(all[i]));
  }
  return sequence;
}

}  // namespace pirt
