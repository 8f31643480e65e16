// What a stretch of work takes of memory.
#include "characterize/worker/resident_memory.h"

#include <gtest/gtest.h>

#include <vector>

namespace pirt {
namespace {

TEST(ResidentMemory, IsTheMostThatThereWasAndNotWhatWasThereBefore) {
  constexpr std::int64_t kMega = std::int64_t{1} << 20;
  const std::vector<char> before(static_cast<std::size_t>(64 * kMega), 1);
  const ResidentMemory resident;
  if (!resident.added_bytes()) GTEST_SKIP() << "skipped: the kernel does not tell";
  EXPECT_LT(*resident.added_bytes(), 16 * kMega) << before.size();
  { const std::vector<char> during(static_cast<std::size_t>(64 * kMega), before.back()); }
  EXPECT_GE(*resident.added_bytes(), 60 * kMega) << "though it has gone again";
  EXPECT_LT(*resident.added_bytes(), 128 * kMega);
}

}  // namespace
}  // namespace pirt
