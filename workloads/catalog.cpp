// The list of all workloads; a new family adds one line here.
#include "workloads/catalog.h"

#include <algorithm>
#include <array>
#include <iterator>

#include "workloads/base/error.h"
#include "workloads/base/text.h"
#include "workloads/dnn/dnn.h"
#include "workloads/vision/vision.h"

namespace pirt {
namespace {

std::vector<Workload> make_catalog() {
  std::vector<Workload> all = vision::table1();
  std::ranges::move(dnn::table1(), std::back_inserter(all));
  std::ranges::move(dnn::pools(), std::back_inserter(all));
  all.push_back(dnn::make_alexnet());
  return all;
}

/// Inputs and outputs stay where they are and change hands by mapping: for devices that share the
/// host's memory.
std::optional<Workload> mapped(const Workload& plain) {
  if (!plain.has_tag("table1")) return std::nullopt;
  return plain;
}

constexpr std::array kVariants = {
    Variant{.name = "map",
            .description = "upload and download by mapping memory that host and device share",
            .make = mapped},
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
  return nullptr;
}

const Workload& find_workload(std::string_view name) {
  if (const auto* found = try_find_workload(name)) return *found;
  throw_bad_input("there is no workload '" + std::string(name) + "'" +
                  suggestion(name, workload_names()) + "; `pirt list workloads` shows all");
}

}  // namespace pirt
