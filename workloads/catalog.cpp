// The list of all workloads; a new family adds one line here.
#include "workloads/catalog.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <iterator>
#include <mutex>

#include "workloads/base/error.h"
#include "workloads/base/text.h"
#include "workloads/dnn/dnn.h"
#include "workloads/mapping/workloads.h"
#include "workloads/planning/workloads.h"
#include "workloads/recognition/workloads.h"
#include "workloads/slam/workloads.h"
#include "workloads/vision/vision.h"

namespace pirt {
namespace {

std::vector<Workload> make_catalog() {
  std::vector<Workload> all = vision::all();
  std::ranges::move(dnn::table1(), std::back_inserter(all));
  std::ranges::move(dnn::pools(), std::back_inserter(all));
  all.push_back(dnn::make_alexnet());
  std::ranges::move(slam::all(), std::back_inserter(all));
  std::ranges::move(planning::all(), std::back_inserter(all));
  std::ranges::move(mapping::all(), std::back_inserter(all));
  std::ranges::move(recognition::all(), std::back_inserter(all));
  return all;
}

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

std::vector<Workload> make_variant(const Variant& variant) {
  std::vector<Workload> all;
  for (const Workload& plain : catalog()) {
    auto made = variant.make(plain);
    if (!made) continue;
    made->name = plain.name + "@" + std::string(variant.name);
    made->variant = variant.name;
    all.push_back(std::move(*made));
  }
  return all;
}

constexpr std::string_view kBatch = "batch";

std::vector<Workload> make_batch(int batch) {
  std::vector<Workload> all;
  for (const Workload& plain : catalog()) {
    if (!plain.has_tag("dnn")) continue;
    Workload& made = all.emplace_back(dnn::batched(plain, batch));
    made.variant = std::string(kBatch) + std::to_string(batch);
    made.name = plain.name + "@" + made.variant;
  }
  return all;
}

/// 8 of "fc6@batch8"; nothing where the name is not of that form or the batch is out of range.
std::optional<int> batch_of(std::string_view name) {
  const auto at = name.find('@');
  if (at == std::string_view::npos || !name.substr(at + 1).starts_with(kBatch)) return std::nullopt;
  const std::string_view digits = name.substr(at + 1 + kBatch.size());
  int batch = 0;
  const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), batch);
  const bool whole = error == std::errc() && end == digits.data() + digits.size();
  if (!whole || batch < kSmallestBatch || batch > kLargestBatch) return std::nullopt;
  return batch;
}

/// In the order of variants().
const std::vector<std::vector<Workload>>& variant_catalogs() {
  static const auto all = [] {
    std::vector<std::vector<Workload>> made;
    for (const Variant& variant : kVariants) made.push_back(make_variant(variant));
    return made;
  }();
  return all;
}

}  // namespace

std::span<const Variant> variants() { return kVariants; }

std::vector<const Workload*> workloads_in_variant(std::string_view name) {
  const auto* found = std::ranges::find(kVariants, name, &Variant::name);
  if (found == kVariants.end()) {
    std::vector<std::string> known;
    for (const Variant& variant : kVariants) known.emplace_back(variant.name);
    throw_bad_input("there is no variant '" + std::string(name) + "'" + suggestion(name, known));
  }
  std::vector<const Workload*> all;
  for (const Workload& each :
       variant_catalogs()[static_cast<std::size_t>(found - kVariants.begin())]) {
    all.push_back(&each);
  }
  return all;
}

std::span<const Workload> workloads_in_batch(int batch) {
  if (batch < kSmallestBatch || batch > kLargestBatch) {
    throw_bad_input("a batch of " + std::to_string(batch) + " images is not between " +
                    std::to_string(kSmallestBatch) + " and " + std::to_string(kLargestBatch) +
                    "; the plain workloads have one");
  }
  // Made when first asked for and never changed: whoever asks may keep pointers to them.
  struct Made {
    std::once_flag once;
    std::vector<Workload> workloads;
  };
  static std::array<Made, kLargestBatch + 1> all;
  Made& made = all[static_cast<std::size_t>(batch)];
  std::call_once(made.once, [&] { made.workloads = make_batch(batch); });
  return made.workloads;
}

std::span<const Workload> catalog() {
  static const std::vector<Workload> all = make_catalog();
  return all;
}

std::vector<std::string> workload_names() {
  std::vector<std::string> names;
  for (const auto& workload : catalog()) names.push_back(workload.name);
  return names;
}

const Workload* try_find_workload(std::string_view name) {
  const auto all = catalog();
  const auto it = std::ranges::find(all, name, &Workload::name);
  if (it != all.end()) return &*it;
  if (name.find('@') == std::string_view::npos) return nullptr;
  for (const auto& variant : variant_catalogs()) {
    const auto in = std::ranges::find(variant, name, &Workload::name);
    if (in != variant.end()) return &*in;
  }
  if (const auto batch = batch_of(name)) {
    const auto batched = workloads_in_batch(*batch);
    const auto in = std::ranges::find(batched, name, &Workload::name);
    if (in != batched.end()) return &*in;
  }
  return nullptr;
}

const Workload& find_workload(std::string_view name) {
  if (const auto* found = try_find_workload(name)) return *found;
  throw_bad_input("there is no workload '" + std::string(name) + "'" +
                  suggestion(name, workload_names()) + "; `pirt list workloads` shows all");
}

}  // namespace pirt
