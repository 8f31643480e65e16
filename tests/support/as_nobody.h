// What a user without rights meets.
#pragma once

#include <gtest/gtest.h>
#include <unistd.h>

namespace pirt::test {

/// Runs @p action as a user whom permissions bind, also where the tests run as root.
template <typename Action>
inline void as_nobody(Action action) {
  constexpr uid_t kNobody = 65534;
  const bool root = ::geteuid() == 0;
  ASSERT_TRUE(!root || ::seteuid(kNobody) == 0);
  action();
  ASSERT_TRUE(!root || ::seteuid(0) == 0);
}

}  // namespace pirt::test
