// How often a test repeats: a seeded subset by default, all of it in tests/run.sh --long (ctest -C
// long -L long).
#pragma once

#include <cstdlib>

namespace pirt::test {

[[nodiscard]] inline bool long_tests() { return std::getenv("PIRT_LONG_TESTS") != nullptr; }

[[nodiscard]] inline int repeats(int usual, int in_long_tests) {
  return long_tests() ? in_long_tests : usual;
}

}  // namespace pirt::test
