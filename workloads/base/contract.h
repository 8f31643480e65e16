// What one part of the tree may expect of another, in every build.
#pragma once

#include <stdexcept>

namespace pirt {

/// @throws std::logic_error saying @p what if it does not hold.
inline void expect(bool holds, const char* what) {
  if (!holds) throw std::logic_error(what);
}

}  // namespace pirt
