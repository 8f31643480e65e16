#include "workloads/base/system/affinity.h"

#include <gtest/gtest.h>

#include <cerrno>

#include "workloads/base/error.h"

namespace pirt {
namespace {

TEST(Affinity, IsReadOnMachinesWithMoreCoresThanTheUsualMaskHas) {
  const auto of_2048_cores = [](pid_t, std::size_t size_bytes, cpu_set_t* mask) {
    if (size_bytes < 2048 / 8) {
      errno = EINVAL;
      return -1;
    }
    for (const std::size_t core : {3U, 1500U}) CPU_SET_S(core, size_bytes, mask);
    return 0;
  };
  EXPECT_EQ(cores_of_thread(0, of_2048_cores), (std::vector{3, 1500}));
  EXPECT_EQ(cores_of_thread(0, [](pid_t, std::size_t, cpu_set_t*) { return -1; }),
            std::vector<int>());
}

TEST(Affinity, IsThatOfTheCoresAskedForOrAsBefore) {
  const CoresRestored restored;
  const auto cores = current_cores();
  EXPECT_EQ(bind_to_cores(std::vector{cores.back(), cores.back()}, "u"), 1);
  EXPECT_EQ(current_cores(), std::vector{cores.back()});
  for (const int core : {-1, 60'000, 65'536}) {
    EXPECT_THROW(bind_to_cores(std::vector{cores.front(), core}, "u"), Error) << core;
    EXPECT_EQ(current_cores(), std::vector{cores.back()});
  }
}

}  // namespace
}  // namespace pirt
