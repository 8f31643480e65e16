// Cache sizes as /sys lists them.
#include "workloads/base/caches.h"

#include <gtest/gtest.h>
#include <stdlib.h>

#include <fstream>

namespace pirt {
namespace {

class Caches : public testing::Test {
 protected:
  Caches() : root_((std::filesystem::temp_directory_path() / "pirt-test-XXXXXX").string()) {
    if (::mkdtemp(root_.data()) == nullptr) throw std::runtime_error("cannot make " + root_);
  }
  ~Caches() override { std::filesystem::remove_all(root_); }

  void put(int index, const std::string& level, const std::string& type, const std::string& size) {
    const auto folder = std::filesystem::path(root_) / "sys/devices/system/cpu/cpu3/cache" /
                        ("index" + std::to_string(index));
    std::filesystem::create_directories(folder);
    std::ofstream(folder / "level") << level << "\n";
    std::ofstream(folder / "type") << type << "\n";
    std::ofstream(folder / "size") << size << "\n";
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

TEST_F(Caches, AreAbsentWhereTheMachineDoesNotSay) {
  put(0, "2", "Unified", "unknown");
  put(1, "3", "Instruction", "1M");
  EXPECT_EQ(read_cache_sizes(3, root_).l2_bytes, std::nullopt);
  EXPECT_EQ(read_cache_sizes(3, root_).last_bytes, std::nullopt);
  EXPECT_EQ(read_cache_sizes(0, root_).l2_bytes, std::nullopt);
}

}  // namespace
}  // namespace pirt
