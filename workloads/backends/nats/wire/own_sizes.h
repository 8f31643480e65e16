// Workloads of sizes of one's own: they travel as the name of their kind and the sizes that its
// maker takes, and whoever reads them makes the workload itself.
#pragma once

#include <cstdint>
#include <map>
#include <mutex>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "workloads/backends/nats/wire/wire.h"

namespace pirt::cloud {

/// What its kind's maker takes; empty for a workload of a kind that is made in one size.
[[nodiscard]] std::vector<std::int64_t> sizes_of(const Workload& workload);

/// Those that were asked for. Any thread.
class OwnSizes {
 public:
  struct Found {
    const Workload* workload = nullptr;  ///< As long as this is there; null with a problem.
    std::string problem = {};            ///< One line.
  };
  /// @param spec  What it has to be, as the other side knows it.
  [[nodiscard]] Found find(const std::string& kind, std::span<const std::int64_t> sizes,
                           const Digest& spec) const;

 private:
  mutable std::mutex mutex_;
  mutable std::map<std::pair<std::string, std::vector<std::int64_t>>, Workload> made_;
};

}  // namespace pirt::cloud
