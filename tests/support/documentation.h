// Examples in the project's READMEs, which tests keep true.
#pragma once

#include <gtest/gtest.h>

#include <string>

#include "tests/support/paths.h"
#include "workloads/base/text/text.h"

namespace pirt::test {

/// The first ```yaml block of a file of the source tree.
inline std::string yaml_example(const std::string& file) {
  const std::string text = read_file(std::string(kSourceFolder) + "/" + file);
  const std::string mark = "```yaml\n";
  const auto begin = text.find(mark);
  const auto end = text.find("```", begin + mark.size());
  EXPECT_NE(end, std::string::npos) << file << " has no example";
  return end == std::string::npos ? ""
                                  : text.substr(begin + mark.size(), end - begin - mark.size());
}

}  // namespace pirt::test
