// How this binary was built; the values are generated at build time (build_info.cmake).
#pragma once

#include <string_view>

namespace pirt {

struct BuildInfo {
  std::string_view version;
  std::string_view compiler_flags;
  std::string_view build_type;
  std::string_view sanitizers;  ///< "address,undefined"; empty = none.
  std::string_view git_commit;  ///< Empty if not built from a git checkout.
  bool git_dirty = false;       ///< The checkout had changes that were not committed.
};

[[nodiscard]] BuildInfo build_info();

}  // namespace pirt
