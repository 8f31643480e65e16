// Workloads of sizes of one's own: they travel as the name of their kind and the sizes that its
// maker takes, and whoever reads them makes the workload itself.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
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

/// What is asked for of a kind that is known here: pure, and small whatever is asked for.
/// @param known  Of the kind, in the size that is known here; outlives what is returned.
/// @param spec   What it has to be, as the other side knows it.
/// @return  Not null, or the problem in one line.
[[nodiscard]] Decoded<std::shared_ptr<const Workload>> of_kind(const Workload& known,
                                                               std::span<const std::int64_t> sizes,
                                                               const Digest& spec);

}  // namespace pirt::cloud
