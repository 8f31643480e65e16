#include "workloads/catalog/workload_list.h"

#include <algorithm>
#include <charconv>
#include <iterator>
#include <optional>
#include <utility>

#include "workloads/base/error.h"
#include "workloads/base/text/text.h"
#include "workloads/catalog/own_list.h"
#include "workloads/dnn/dnn.h"
#include "workloads/model/own_operation.h"
#include "workloads/own/definition.h"
#include "workloads/vision/vision.h"

namespace pirt {
namespace {

/// Inputs and outputs stay where they are and change hands by mapping: for devices that share the
/// host's memory. A state is the device's, and of a list only the rows that it has are moved: no
/// such variant.
std::optional<Workload> mapped(const Workload& plain) {
  const auto varies = [](const std::vector<TensorSpec>& specs) {
    return std::ranges::any_of(specs, &TensorSpec::varies);
  };
  if (plain.state || varies(plain.inputs) || varies(plain.outputs)) return std::nullopt;
  if (plain.kernel == "sequence") return std::nullopt;  // Its layers hand on what nobody maps.
  return plain;
}

std::optional<Workload> in_bf16(const Workload& plain) {
  return dnn::in_precision(plain, Precision::kBf16);
}

std::optional<Workload> in_int8(const Workload& plain) {
  return dnn::in_precision(plain, Precision::kInt8);
}

constexpr std::array kVariants = {
    Variant{.name = "map",
            .description = "upload and download by mapping memory that host and device share",
            .make = mapped},
    Variant{.name = "bf16",
            .description = "products in bfloat16, sums in f32; an error bound of its own",
            .make = in_bf16},
    Variant{.name = "int8",
            .description = "weights and inputs quantized to 8 bits by fixed scales, sums in 32-bit "
                           "integers; an error bound of its own",
            .make = in_int8},
};

std::vector<Workload> make_variant(const Variant& variant, std::span<const Workload> all_plain) {
  std::vector<Workload> all;
  for (const Workload& plain : all_plain) {
    auto made = variant.make(plain);
    if (!made) continue;
    made->at_size = {};  // Sizes come first in a name.
    made->name = plain.name + "@" + std::string(variant.name);
    made->variant = variant.name;
    all.push_back(std::move(*made));
  }
  return all;
}

constexpr std::string_view kBatch = "batch";

std::vector<Workload> make_batch(int batch, std::span<const Workload> all_plain) {
  std::vector<Workload> all;
  for (const Workload& plain : all_plain) {
    if (!plain.has_tag("dnn")) continue;
    Workload& made = all.emplace_back(dnn::batched(plain, batch));
    made.at_size = {};
    made.variant = std::string(kBatch) + std::to_string(batch);
    made.name = plain.name + "@" + made.variant;
  }
  return all;
}

/// 8 of "fc6@batch8"; nothing where the name is not of that form or the batch is out of range.
std::optional<int> batch_of(std::string_view name) {
  const auto at = name.rfind('@');
  if (at == std::string_view::npos || !name.substr(at + 1).starts_with(kBatch)) return std::nullopt;
  const std::string_view digits = name.substr(at + 1 + kBatch.size());
  int batch = 0;
  const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), batch);
  const bool whole = error == std::errc() && end == digits.data() + digits.size();
  if (!whole || batch < kSmallestBatch || batch > kLargestBatch) return std::nullopt;
  return batch;
}

const Workload* find_in(std::span<const Workload> all, std::string_view name) {
  const auto found = std::ranges::find(all, name, &Workload::name);
  return found == all.end() ? nullptr : &*found;
}

}  // namespace

std::span<const Variant> variants() { return kVariants; }

WorkloadList::WorkloadList(std::vector<Workload> others) : plain_(vision::all()) {
  std::ranges::move(dnn::table1(), std::back_inserter(plain_));
  std::ranges::move(dnn::pools(), std::back_inserter(plain_));
  plain_.push_back(dnn::make_alexnet());
  std::ranges::move(others, std::back_inserter(plain_));
}

const std::vector<std::vector<Workload>>& WorkloadList::in_variants() const {
  std::call_once(variants_once_, [this] {
    for (const Variant& variant : kVariants) variants_.push_back(make_variant(variant, plain_));
  });
  return variants_;
}

std::span<const Workload> WorkloadList::in_batch(int batch) const {
  Made& made = batches_[static_cast<std::size_t>(batch)];
  std::call_once(made.once, [&] { made.workloads = make_batch(batch, plain_); });
  return made.workloads;
}

const Workload* WorkloadList::made_of(const Workload& plain, std::string_view text) const {
  const auto end = std::min(text.find('@'), text.size());
  const auto size = own::size_from(text.substr(0, end));
  // Variants of pirt's own without a size are made all at once.
  if (size ? !plain.at_size : own_operation(plain) == nullptr) return nullptr;
  const std::string base = size ? plain.name + "@" + own::to_string(*size) : plain.name;
  const std::string name = base + (size ? std::string(text.substr(end)) : "@" + std::string(text));
  const std::lock_guard lock(made_mutex_);
  auto& made = made_[{&plain, name}];
  if (!made.empty()) return &made.back();
  Workload whole = size ? plain.at_size(size->width, size->height) : plain;
  whole.name = base;
  whole.tags = plain.tags;
  whole.at_size = {};
  if (name == base) return &made.emplace_back(std::move(whole));
  const std::span<const Workload> one(&whole, 1);
  std::vector<Workload> further;
  for (const Variant& variant : kVariants) {
    std::ranges::move(make_variant(variant, one), std::back_inserter(further));
  }
  if (const auto batch = batch_of(name)) further = make_batch(*batch, one);
  std::erase_if(further, [&name](const Workload& each) { return each.name != name; });
  made = std::move(further);
  return made.empty() ? nullptr : &made.back();
}

const Workload* WorkloadList::try_find(std::string_view name) const {
  if (const auto* plain = find_in(plain_, name)) return plain;
  if (const auto* own = try_find_own(name)) return own;
  const auto at = name.find('@');
  if (at == std::string_view::npos) return nullptr;
  const Workload* plain = find_in(plain_, name.substr(0, at));
  if (plain == nullptr) plain = try_find_own(name.substr(0, at));
  if (plain == nullptr) return nullptr;
  if (const Workload* const made = made_of(*plain, name.substr(at + 1))) return made;
  for (const auto& variant : in_variants()) {
    if (const auto* found = find_in(variant, name)) return found;
  }
  const auto batch = batch_of(name);
  return batch ? find_in(in_batch(*batch), name) : nullptr;
}

const Workload& WorkloadList::find(std::string_view name) const {
  if (const auto* found = try_find(name)) return *found;
  const Workload* const plain = try_find(own::plain_name(std::string(name)));
  if (plain != nullptr && own::size_in(std::string(name))) {
    throw_bad_input("workload '" + plain->name + "' has no other sizes: '" + std::string(name) +
                    "'; `pirt list workloads` shows those that have");
  }
  throw_bad_input("there is no workload '" + std::string(name) + "'" + suggestion(name, names()) +
                  "; `pirt list workloads` shows all");
}

std::vector<std::string> WorkloadList::names() const {
  std::vector<std::string> names;
  for (const Workload& workload : plain_) names.push_back(workload.name);
  for (const Workload* own : own_workloads()) names.push_back(own->name);
  return names;
}

}  // namespace pirt
