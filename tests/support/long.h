// How often a test repeats: a seeded subset by default, all of it in the long tests (ctest -C long
// -L long), where a test of many repetitions has an entry for each range of them.
#pragma once

#include <cstdio>
#include <cstdlib>
#include <stdexcept>
#include <string>

namespace pirt::test {

[[nodiscard]] inline bool long_tests() { return std::getenv("PIRT_LONG_TESTS") != nullptr; }

/// Numbers of repetitions; each makes its seed of the first one's.
struct Repetitions {
  int first = 0;
  int count = 0;
};

/// The first @p usual, or in long tests those of PIRT_REPETITIONS=FIRST-LAST, without which it is
/// all of @p in_long_tests.
[[nodiscard]] inline Repetitions repetitions(int usual, int in_long_tests) {
  if (!long_tests()) return {0, usual};
  const char* range = std::getenv("PIRT_REPETITIONS");
  if (range == nullptr) return {0, in_long_tests};
  int first = 0, last = 0;
  if (std::sscanf(range, "%d-%d", &first, &last) != 2 || first < 0 || last < first ||
      last >= in_long_tests) {
    throw std::runtime_error("PIRT_REPETITIONS: expected FIRST-LAST within 0-" +
                             std::to_string(in_long_tests - 1));
  }
  return {first, last - first + 1};
}

[[nodiscard]] inline int repeats(int usual, int in_long_tests) {
  return long_tests() ? in_long_tests : usual;
}

}  // namespace pirt::test
