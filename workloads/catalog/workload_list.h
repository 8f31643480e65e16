// Workloads with their variants and batches, found by name.
#pragma once

#include <array>
#include <map>
#include <mutex>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "workloads/catalog/catalog.h"
#include "workloads/model/workload.h"

namespace pirt {

/// Variants and batches are made when they are first asked for, and never changed: whoever asks may
/// keep pointers to them. Any thread may ask.
class WorkloadList {
 public:
  /// vision/ and dnn/, which need no library to be described or computed; a new family of that kind
  /// adds its line in the .cpp.
  /// @param others  Of families that need one: with their functions in the catalog (catalog.cpp),
  /// without them in the specs (specs.cpp).
  explicit WorkloadList(std::vector<Workload> others);
  WorkloadList(const WorkloadList&) = delete;
  WorkloadList& operator=(const WorkloadList&) = delete;

  [[nodiscard]] std::span<const Workload> plain() const { return plain_; }
  /// In the order of variants().
  [[nodiscard]] const std::vector<std::vector<Workload>>& in_variants() const;
  /// @param batch  Within kSmallestBatch and kLargestBatch.
  [[nodiscard]] std::span<const Workload> in_batch(int batch) const;
  /// Null if there is none of that name.
  [[nodiscard]] const Workload* try_find(std::string_view name) const;
  /// @throws Error{kBadInput} with the nearest names.
  [[nodiscard]] const Workload& find(std::string_view name) const;
  [[nodiscard]] std::vector<std::string> names() const;

 private:
  std::vector<Workload> plain_;
  struct Made {
    std::once_flag once;
    std::vector<Workload> workloads;
  };
  mutable std::array<Made, kLargestBatch + 1> batches_;
  /// @param text  "1280x720", also with a variant or a batch: "1280x720@map"; of others' workloads
  /// a variant alone. Null where it is none, or @p plain has no other sizes.
  [[nodiscard]] const Workload* made_of(const Workload& plain, std::string_view text) const;

  mutable std::mutex made_mutex_;
  /// One or none, by what they were made of and their name; not moved once made.
  mutable std::map<std::pair<const Workload*, std::string>, std::vector<Workload>> made_;
  mutable std::once_flag variants_once_;
  mutable std::vector<std::vector<Workload>> variants_;
};

}  // namespace pirt
