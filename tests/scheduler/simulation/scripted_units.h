// What stands in for the registry and the catalog in a simulated run: the names of both are
// replaced where its sources are compiled (tests/CMakeLists.txt).
#pragma once

#include <string_view>

#include "workloads/model/backend.h"

namespace pirt {

/// Computes all that a script says; "fake" elsewhere, over a way that may be lost.
[[nodiscard]] const Backend& find_scripted_backend(std::string_view name);
/// As the catalog's, but of single numbers.
[[nodiscard]] const Workload& find_scripted_workload(std::string_view name);

namespace simulated {

/// A workload with so many inputs; with the name of a state, it counts its calls there.
[[nodiscard]] Workload make_scripted(const std::string& name, int inputs,
                                     const std::string& state = "");

}  // namespace simulated
}  // namespace pirt
