// What is said of the end of child processes.
#include "workloads/base/system/child.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace pirt {
namespace {

std::optional<int> status_of(const std::string& script) {
  const pid_t child = start_child({"/bin/sh", "-c", script}, {-1, -1, -1, -1});
  int status = 0;
  return ::waitpid(child, &status, 0) == child ? std::optional(status) : std::nullopt;
}

TEST(Child, SaysHowItEnded) {
  EXPECT_EQ(how_ended(status_of("exit 3")), "ended with code 3");
  EXPECT_EQ(how_ended(status_of("kill -TERM $$")), "crashed (SIGTERM)");
  EXPECT_THAT(how_ended(std::nullopt), testing::HasSubstr("how is not known"));
}

}  // namespace
}  // namespace pirt
