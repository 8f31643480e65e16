// Workloads of sizes of one's own: they travel as the name of their kind and the sizes that its
// maker takes, and whoever reads them makes the workload itself.
#pragma once

#include <cstdint>
#include <map>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "workloads/backends/nats/wire/tensors.h"

namespace pirt::cloud {

/// As it travels.
struct Kind {
  std::string name;                      ///< Of the workload that whoever reads it knows.
  std::vector<std::int64_t> sizes = {};  ///< What its maker takes: a picture's width and height, or
                                         ///< images a call; empty = made in one size.
  /// What whoever knows it announces; absent = of sizes that do not tell.
  std::optional<Digest> known_by = {};
  std::string_view differs = "other sizes, or another version of pirt";  ///< Where that is another.
  std::string_view missing = {};  ///< What somebody lacks who does not know it; empty = unknown.
};
[[nodiscard]] Kind kind_of(const Workload& workload);

/// Those that were asked for. Any thread.
class OwnSizes {
 public:
  struct Found {
    const Workload* workload = nullptr;  ///< As long as this is there; null with a problem.
    std::string problem = {};            ///< One line.
  };
  /// @param kind  Of its kind, in the size that is known here.
  /// @param spec  What it has to be, as the other side knows it.
  [[nodiscard]] Found find(const Workload& kind, std::span<const std::int64_t> sizes,
                           const Digest& spec) const;

 private:
  [[nodiscard]] static std::optional<Workload> make(const Workload& kind,
                                                    std::span<const std::int64_t> sizes);

  mutable std::mutex mutex_;
  mutable std::map<std::pair<std::string, std::vector<std::int64_t>>, Workload> made_;
};

}  // namespace pirt::cloud
