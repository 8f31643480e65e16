// Where tests find the real data: PIRT_DATA, or ../shared/data beside the repository; tests skip
// without it.
#pragma once

#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <optional>
#include <string>

#include "tests/support/paths.h"

namespace pirt::test {

/// The folder @p name of the data, if it is there.
inline std::optional<std::filesystem::path> data(const std::string& name) {
  const char* configured = std::getenv("PIRT_DATA");
  const auto root = configured != nullptr
                        ? std::filesystem::path(configured)
                        : std::filesystem::path(kSourceFolder) / ".." / "shared" / "data";
  const auto path = root / name;
  if (!std::filesystem::exists(path)) return std::nullopt;
  return std::filesystem::canonical(path);
}

}  // namespace pirt::test

/// Declares `variable` as the data folder, or skips the test.
#define PIRT_DATA_OR_SKIP(variable, name)                    \
  const auto variable##_found = ::pirt::test::data(name);    \
  if (!variable##_found) GTEST_SKIP() << "skipped: no data"; \
  const auto& variable = *variable##_found
