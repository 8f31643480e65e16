// Tests of what a build may be without.
#pragma once

#include <built_backends.h>
#include <gtest/gtest.h>

#include <string>

namespace pirt::test {

inline bool is_built(const std::string& backend) {
  return kMissingBackends.find(" " + backend + " ") == std::string_view::npos;
}

}  // namespace pirt::test

/// Skips the test, by the backend's name, in a build without it.
#define PIRT_BACKEND_OR_SKIP(name)                                       \
  if (!::pirt::test::is_built(name)) {                                   \
    GTEST_SKIP() << "skipped: this build is without backend " << (name); \
  }
