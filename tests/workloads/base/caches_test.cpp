// Cache sizes as /sys lists them.
#include "workloads/base/system/caches.h"

#include <gtest/gtest.h>
#include <stdlib.h>

#include <fstream>
#include <vector>

namespace pirt {
namespace {

class Caches : public testing::Test {
 protected:
  Caches() : root_((std::filesystem::temp_directory_path() / "pirt-test-XXXXXX").string()) {
    if (::mkdtemp(root_.data()) == nullptr) throw std::runtime_error("cannot make " + root_);
  }
  ~Caches() override { std::filesystem::remove_all(root_); }

  void put(int index, const std::string& level, const std::string& type, const std::string& size,
           int core = 3, const std::string& shared = "") {
    const auto folder = std::filesystem::path(root_) / "sys/devices/system/cpu" /
                        ("cpu" + std::to_string(core)) / "cache" /
                        ("index" + std::to_string(index));
    std::filesystem::create_directories(folder);
    std::ofstream(folder / "level") << level << "\n";
    std::ofstream(folder / "type") << type << "\n";
    std::ofstream(folder / "size") << size << "\n";
    if (!shared.empty()) std::ofstream(folder / "shared_cpu_list") << shared << "\n";
  }

  std::string root_;
};

TEST_F(Caches, AreReadByLevel) {
  put(0, "1", "Data", "32K");
  put(1, "1", "Instruction", "64K");
  put(2, "2", "Unified", "512K");
  put(3, "3", "Unified", "32M");
  const CacheSizes sizes = read_cache_sizes(3, root_);
  EXPECT_EQ(sizes.l2_bytes, 512 << 10);
  EXPECT_EQ(sizes.last_bytes, 32 << 20);
}

TEST_F(Caches, WithoutAThirdLevelTheSecondIsTheLast) {
  put(0, "2", "Unified", "1048576");
  EXPECT_EQ(read_cache_sizes(3, root_).last_bytes, 1 << 20);
}

TEST_F(Caches, OfTheLastLevelAddUpOverDomainsAndSockets) {
  // Two domains of 32 MB with two cores each, and a socket whose core has 8 MB of its own.
  for (const int core : {0, 1, 2, 3, 4}) {
    const std::string own = std::to_string(core);
    const std::string domain = core < 2 ? "0-1" : core < 4 ? "2-3" : "4";
    put(0, "1", "Data", "32K", core, own);
    put(1, "2", "Unified", "1M", core, own);
    put(2, "3", "Unified", core < 4 ? "32M" : "8M", core, domain);
  }
  EXPECT_EQ(all_last_cache_bytes(root_), std::int64_t{72} << 20);
  EXPECT_EQ(read_cache_sizes(0, root_).last_bytes, 32 << 20) << "of one core";
}

TEST_F(Caches, OfTheLastLevelWithoutSharersAreCountedOncePerCore) {
  put(0, "2", "Unified", "1M", 0);
  put(0, "2", "Unified", "1M", 1);
  EXPECT_EQ(all_last_cache_bytes(root_), 2 << 20);
}

TEST_F(Caches, OwnAreTheLargestThatNoOtherCoreShares) {
  for (const int core : {0, 1, 2, 3}) {
    put(0, "1", "Data", "32K", core, std::to_string(core));
    put(1, "2", "Unified", "1M", core, core < 2 ? "0-1" : "2-3");
    put(2, "3", "Unified", "32M", core, "0-3");
  }
  const auto own = [this](std::vector<int> cores) { return own_cache_bytes(cores, root_); };
  EXPECT_EQ(own({0, 1}), 1 << 20);
  EXPECT_EQ(own({0, 1, 2, 3}), 32 << 20);
  EXPECT_EQ(own({0, 1, 2}), (1 << 20) + (1 << 19)) << "of what it shares with core 3 its part";
  EXPECT_EQ(own({3}), 1 << 19);
}

TEST_F(Caches, ReachedAreTheLargestWithWhatOthersShare) {
  for (const int core : {0, 1, 2, 3}) {
    put(0, "1", "Data", "32K", core, std::to_string(core));
    put(1, "2", "Unified", "1M", core, std::to_string(core));
    put(2, "3", "Unified", "32M", core, core < 2 ? "0-1" : "2-3");
  }
  EXPECT_EQ(reached_cache_bytes(std::vector{0}, root_), 32 << 20);
  EXPECT_EQ(reached_cache_bytes(std::vector{0, 1}, root_), 32 << 20);
  EXPECT_EQ(reached_cache_bytes(std::vector{1, 2}, root_), 64 << 20);
}

TEST_F(Caches, OwnAndReachedAreAbsentWhereTheMachineDoesNotSay) {
  EXPECT_EQ(reached_cache_bytes(std::vector{0}, root_), std::nullopt);
  EXPECT_EQ(own_cache_bytes(std::vector{0}, root_), std::nullopt);
}

TEST_F(Caches, OfTheLastLevelAreAbsentWhereTheMachineDoesNotSay) {
  EXPECT_EQ(all_last_cache_bytes(root_), std::nullopt);
}

TEST_F(Caches, AreAbsentWhereTheMachineDoesNotSay) {
  put(0, "2", "Unified", "unknown");
  put(1, "3", "Instruction", "1M");
  EXPECT_EQ(read_cache_sizes(3, root_).l2_bytes, std::nullopt);
  EXPECT_EQ(read_cache_sizes(3, root_).last_bytes, std::nullopt);
  EXPECT_EQ(read_cache_sizes(0, root_).l2_bytes, std::nullopt);
}

}  // namespace
}  // namespace pirt
