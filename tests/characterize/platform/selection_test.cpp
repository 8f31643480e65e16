// Which workloads a filter, variants and a batch choose.
#include "characterize/platform/selection.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "workloads/base/error.h"
#include "workloads/catalog/catalog.h"

namespace pirt {
namespace {

using testing::ElementsAre;
using testing::UnorderedElementsAre;

std::vector<std::string> chosen(const std::string& filter,
                                const std::vector<std::string>& in_variants = {},
                                std::optional<int> batch = std::nullopt) {
  std::vector<std::string> names;
  for (const Workload* workload : choose_workloads(filter, in_variants, batch)) {
    names.push_back(workload->name);
  }
  return names;
}

TEST(ChooseWorkloads, PlainOnesUnlessMoreIsAskedFor) {
  EXPECT_EQ(chosen(""), workload_names());
  EXPECT_THAT(chosen("^fc[78]$"), ElementsAre("fc7", "fc8"));
}

TEST(ChooseWorkloads, VariantsAndBatchesOfThoseThatTheFilterPicks) {
  EXPECT_THAT(chosen("^fc[78]$", {"int8"}), ElementsAre("fc7", "fc8", "fc7@int8", "fc8@int8"));
  EXPECT_THAT(chosen("^fc8$", {}, 4), ElementsAre("fc8", "fc8@batch4"));
  EXPECT_THAT(chosen("^(fc8|sobel)$", {"map"}, 4),
              ElementsAre("sobel", "fc8", "sobel@map", "fc8@map", "fc8@batch4"));
  EXPECT_THAT(chosen("fc8@map|^fc7$", {"map"}), ElementsAre("fc7", "fc7@map", "fc8@map"));
}

TEST(ChooseWorkloads, TheFilterMayNameThemItself) {
  EXPECT_THAT(chosen("^sobel@map$"), ElementsAre("sobel@map"));
  EXPECT_THAT(chosen("fc8@(int8|batch2|batch16)$"),
              ElementsAre("fc8@int8", "fc8@batch2", "fc8@batch16"));
  EXPECT_THAT(chosen("^sobel@(1280x720|640x480|map)$"),
              UnorderedElementsAre("sobel@1280x720", "sobel@640x480", "sobel@map"));
  EXPECT_THAT(chosen("^sobel@(map|1280x720)$"),
              UnorderedElementsAre("sobel@map", "sobel@1280x720"));
  EXPECT_THAT(chosen("^sobel@1280x720@map$"), ElementsAre("sobel@1280x720@map"));
  EXPECT_THAT(chosen("^conv3@26x20@(batch4|int8)$"),
              UnorderedElementsAre("conv3@26x20@batch4", "conv3@26x20@int8"));
}

// Others have no such size.
TEST(ChooseWorkloads, ASizeIsMadeOfThoseThatAreWanted) {
  EXPECT_THAT(chosen("^sobel@8x8$"), ElementsAre("sobel@8x8"));
  EXPECT_THAT(chosen("^sobel@8x8"), ElementsAre("sobel@8x8")) << "nobody asks for variants of it";
  EXPECT_EQ(choose_workloads("^sobel$", {}, std::nullopt, {"8x8"}).size(), 2U);
  EXPECT_THROW(static_cast<void>(choose_workloads("^conv1@8x8$")), Error);
}

TEST(ChooseWorkloads, RefusesWhatThereIsNot) {
  EXPECT_THROW(static_cast<void>(choose_workloads("(")), Error);
  EXPECT_THROW(static_cast<void>(choose_workloads("nothing")), Error);
  EXPECT_THROW(static_cast<void>(choose_workloads("", {"fp4"})), Error);
  EXPECT_THROW(static_cast<void>(choose_workloads("", {}, 1)), Error);
  EXPECT_THROW(static_cast<void>(choose_workloads("fc8@batch999")), Error);
}

}  // namespace
}  // namespace pirt
