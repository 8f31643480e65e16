// What tests of refusals share.
#pragma once

#include <gtest/gtest.h>

#include <string>

#include "workloads/base/error.h"

namespace pirt::test {

/// The message of the bad-input error that @p call throws; fails the test if it throws none.
template <typename Call>
std::string bad_input(const Call& call) {
  try {
    call();
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kBadInput);
    return error.what();
  }
  ADD_FAILURE() << "no error";
  return "";
}

}  // namespace pirt::test
