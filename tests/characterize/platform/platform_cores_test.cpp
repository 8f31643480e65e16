// Parts of machines whose physical cores have several threads, or are of several kinds.
#include "characterize/platform/platform_cores.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <numeric>

#include "characterize/platform/platform_file.h"
#include "tests/characterize/support.h"
#include "tests/support/recorded_machines.h"

namespace pirt {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

class Cores : public ::testing::Test {
 protected:
  /// Says of each core which ones are its siblings.
  void siblings(const std::vector<std::string>& lists) {
    for (std::size_t core = 0; core < lists.size(); ++core) {
      machine_.core(static_cast<int>(core), "topology/thread_siblings_list", lists[core] + "\n");
    }
  }
  void each(const std::string& file, const std::vector<int>& values) {
    for (std::size_t core = 0; core < values.size(); ++core) {
      machine_.core(static_cast<int>(core), file, std::to_string(values[core]) + "\n");
    }
  }
  [[nodiscard]] std::vector<PhysicalCore> physical(int count) const {
    std::vector<int> usable(static_cast<std::size_t>(count));
    std::iota(usable.begin(), usable.end(), 0);
    return physical_cores(usable, folder_.path());
  }
  [[nodiscard]] std::vector<int> part(const std::string& name, int count) const {
    return cores_of_part(name, physical(count));
  }
  [[nodiscard]] std::vector<std::string> remarks(int count) const {
    const auto document =
        parse_yaml("p.yaml",
                   "platform: halves\nunits:\n  cpu: {backend: cpu, cores: first_half}\n"
                   "  gpu: {backend: cpu, cores: second_half}\n",
                   "units", {});
    const auto machine = physical(count);
    return core_remarks(read_platform(document, machine), machine);
  }

  test::TemporaryFolder folder_;
  test::RecordedMachine machine_{folder_.path()};
};

// As Linux numbers most PCs: first one thread of each core, then the others.
TEST_F(Cores, HalvesOfFourWithTwoThreadsAreTwoWholeOnes) {
  siblings({"0,4", "1,5", "2,6", "3,7", "0,4", "1,5", "2,6", "3,7"});
  EXPECT_THAT(part("first_half", 8), ElementsAre(0, 1, 4, 5));
  EXPECT_THAT(part("second_half", 8), ElementsAre(2, 3, 6, 7));
  EXPECT_THAT(part("all_but_two", 8), ElementsAre(0, 1, 4, 5));
  EXPECT_THAT(part("last_two", 8), ElementsAre(2, 3, 6, 7));
  EXPECT_THAT(part("all", 8), ElementsAre(0, 1, 2, 3, 4, 5, 6, 7));
  EXPECT_THAT(remarks(8), IsEmpty());
}

TEST_F(Cores, ThreadsInARowAreKnownToo) {
  siblings({"0-1", "0-1", "2-3", "2-3", "4-5", "4-5"});
  EXPECT_THAT(part("first_half", 6), ElementsAre(0, 1, 2, 3)) << "the odd one is the first half's";
  EXPECT_THAT(part("second_half", 6), ElementsAre(4, 5));
  EXPECT_THAT(part("last_two", 6), ElementsAre(4, 5)) << "of fewer than four, the halves";
}

TEST_F(Cores, OnlyThoseThatMayBeUsedAreHalved) {
  siblings({"0,4", "1,5", "2,6", "3,7", "0,4", "1,5", "2,6", "3,7"});
  const std::vector<int> usable = {1, 2, 3, 5};
  const auto machine = physical_cores(usable, folder_.path());
  EXPECT_THAT(cores_of_part("first_half", machine), ElementsAre(1, 2, 5));
  EXPECT_THAT(cores_of_part("second_half", machine), ElementsAre(3));
}

TEST_F(Cores, ASinglePhysicalOneIsHalvedByThreadsAndThatIsSaid) {
  siblings({"0-1", "0-1"});
  EXPECT_THAT(part("first_half", 2), ElementsAre(0));
  EXPECT_THAT(part("second_half", 2), ElementsAre(1));
  EXPECT_THAT(remarks(2),
              ElementsAre(HasSubstr("units cpu and gpu are threads of one physical core (0,1)")));
}

TEST_F(Cores, OfAMachineThatSaysNothingAreCoresOfOneKind) {
  EXPECT_THAT(part("first_half", 4), ElementsAre(0, 1));
  EXPECT_THAT(part("second_half", 4), ElementsAre(2, 3));
  EXPECT_THAT(remarks(4), IsEmpty());
}

// Big cores behind the little ones, as many boards have them.
TEST_F(Cores, EachHalfIsOfOneKindTheFasterFirst) {
  each("cpu_capacity", {400, 400, 400, 400, 1024, 1024});
  EXPECT_THAT(part("first_half", 6), ElementsAre(4, 5));
  EXPECT_THAT(part("second_half", 6), ElementsAre(0, 1, 2, 3));
  EXPECT_THAT(remarks(6), ElementsAre(AllOf(HasSubstr("cpu fast ones (4,5)"),
                                            HasSubstr("gpu slow ones (0,1,2,3)"))));
}

TEST_F(Cores, ThePCsKernelNamesTheKinds) {
  siblings({"0-1", "0-1", "2-3", "2-3", "4", "5", "6", "7"});
  machine_.put("sys/devices/cpu_core/cpus", "0-3\n");
  machine_.put("sys/devices/cpu_atom/cpus", "4-7\n");
  each("cpufreq/cpuinfo_max_freq", {50, 50, 50, 50, 50, 50, 50, 50});
  EXPECT_THAT(part("first_half", 8), ElementsAre(0, 1, 2, 3));
  EXPECT_THAT(part("second_half", 8), ElementsAre(4, 5, 6, 7));
}

// Favoured cores of a PC clock a few percent higher, and are of the same kind.
TEST_F(Cores, AClockDecidesWhereItDiffersByMoreThanATenth) {
  each("cpufreq/cpuinfo_max_freq", {4'900'000, 5'100'000, 4'900'000, 4'900'000});
  EXPECT_THAT(part("first_half", 4), ElementsAre(0, 1));
  EXPECT_THAT(remarks(4), IsEmpty());
  each("cpufreq/cpuinfo_max_freq", {1'600'000, 2'150'000, 1'600'000, 2'150'000});
  EXPECT_THAT(part("first_half", 4), ElementsAre(1, 3));
  EXPECT_THAT(part("second_half", 4), ElementsAre(0, 2));
}

TEST_F(Cores, HalvesOfThreeKindsAreMixedAndThatIsSaid) {
  each("cpu_capacity", {300, 300, 300, 300, 800, 800, 800, 1024});
  EXPECT_THAT(part("first_half", 8), ElementsAre(4, 5, 6, 7)) << "the faster ones";
  EXPECT_THAT(part("second_half", 8), ElementsAre(0, 1, 2, 3));
  EXPECT_THAT(remarks(8), ElementsAre(AllOf(HasSubstr("unit cpu has cores of 2 kinds (4,5,6,7)"),
                                            HasSubstr("--set cpu.cores="))));
}

TEST_F(Cores, WhoMayUseOneKindOnlyHasOne) {
  each("cpu_capacity", {400, 400, 1024, 1024});
  EXPECT_THAT(part("first_half", 2), ElementsAre(0));
  EXPECT_THAT(remarks(2), IsEmpty());
}

TEST(CoreList, IsReadAsTheKernelWritesIt) {
  EXPECT_THAT(parse_core_list("0-2,8"), ElementsAre(0, 1, 2, 8));
  EXPECT_THAT(parse_core_list("5"), ElementsAre(5));
  EXPECT_THAT(parse_core_list(""), IsEmpty());
  EXPECT_THAT(parse_core_list("x,-3,4"), ElementsAre(4));
  EXPECT_LE(parse_core_list("0-999999999").size(), 65537U);
}

}  // namespace
}  // namespace pirt
