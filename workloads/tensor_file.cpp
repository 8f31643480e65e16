#include "workloads/tensor_file.h"

#include <cstring>
#include <string>
#include <string_view>

#include "workloads/base/error.h"
#include "workloads/base/hash.h"
#include "workloads/base/text.h"

namespace pirt {
namespace {

constexpr std::string_view kMagic = "pirtTNS1";

std::uint64_t content_hash(std::string_view payload) {
  return Hash64().add(std::as_bytes(std::span(payload))).value();
}

}  // namespace

void write_tensors(const std::filesystem::path& path, std::span<const Tensor> tensors) {
  std::string payload;
  for (const Tensor& tensor : tensors) {
    const auto bytes = tensor.bytes();
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
  std::size_t expected = kMagic.size() + sizeof(std::uint64_t);
  for (const Tensor& tensor : tensors) expected += tensor.bytes().size();
  if (text.size() != expected || !text.starts_with(kMagic)) {
    throw_bad_input("tensor file '" + path.string() + "' has " + std::to_string(text.size()) +
                    " bytes where " + std::to_string(expected) +
                    " were expected; it is not complete, start again");
  }
  std::uint64_t hash = 0;
  std::memcpy(&hash, text.data() + kMagic.size(), sizeof hash);
  std::string_view payload(text);
  payload.remove_prefix(kMagic.size() + sizeof hash);
  if (content_hash(payload) != hash) {
    throw_bad_input("tensor file '" + path.string() + "' is damaged; start again");
  }
  for (Tensor& tensor : tensors) {
    const std::size_t size = tensor.bytes().size();
    if (size != 0) std::memcpy(tensor.data(), payload.data(), size);
    payload.remove_prefix(size);
  }
  return tensors;
}

std::vector<TensorSpec> reference_specs(const Workload& workload) {
  std::vector<TensorSpec> specs = workload.outputs;
  for (TensorSpec& spec : specs) {
    if (spec.element == Element::kF32) spec.element = Element::kF64;
  }
  return specs;
}

}  // namespace pirt
