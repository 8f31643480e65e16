// What a filter picks, and what is refused instead of hanging or crashing.
#include "workloads/base/text/name_filter.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/errors.h"

namespace pirt {
namespace {

using testing::HasSubstr;

std::string refused(const std::string& filter) {
  return test::bad_input([&] { static_cast<void>(NameFilter(filter)); });
}

std::string repeated(std::size_t times, const std::string& part) {
  std::string text;
  for (std::size_t i = 0; i < times; ++i) text += part;
  return text;
}

TEST(NameFilter, IsSearchedAnywhereInTheName) {
  EXPECT_TRUE(NameFilter("ob").picks("sobel"));
  EXPECT_TRUE(NameFilter("conv[12]|sobel").picks("conv2"));
  EXPECT_FALSE(NameFilter("^conv[12]$").picks("conv21"));
  EXPECT_TRUE(NameFilter(R"(fc\d@batch(8|16)$)").picks("fc6@batch16"));
  EXPECT_TRUE(NameFilter("").picks("anything"));
  EXPECT_TRUE(NameFilter("").picks(""));
}

TEST(NameFilter, SaysWhatIsNoExpression) {
  for (const auto* bad : {"(", "[", "*", "a{2,1}", "\\", "a{1001}", "\xff"}) {
    EXPECT_THAT(refused(bad), HasSubstr("not a regular expression")) << bad;
  }
}

TEST(NameFilter, SaysThatLookAroundAndBackReferencesAreNotSupported) {
  for (const auto* bad : {"(?=so)bel", "a(?!b)", "(?<=a)b", "(?<!a)b"}) {
    EXPECT_THAT(refused(bad), HasSubstr("look-ahead and look-behind")) << bad;
  }
  EXPECT_THAT(refused(R"((s)\1)"), HasSubstr(R"(back-references such as \1)"));
}

TEST(NameFilter, RefusesWhatIsTooLongWithoutRepeatingIt) {
  const auto message = refused(repeated(10'000, "(") + repeated(10'000, ")"));
  EXPECT_THAT(message, HasSubstr("20000 characters"));
  EXPECT_THAT(message, HasSubstr("1000"));
  EXPECT_LT(message.size(), 200U);
}

TEST(NameFilter, TakesTheDeepestNestingThatFits) {
  const auto half = kLongestFilter / 2;
  EXPECT_TRUE(NameFilter(repeated(half, "(") + repeated(half, ")")).picks("sobel"));
}

// Exponential in a matcher that goes back; here such a test ends.
TEST(NameFilter, AnswersForNestedRepetitions) {
  const std::string name(10'000, 'a');
  EXPECT_FALSE(NameFilter("(.*)*(.*)*(.*)*zz").picks(name));
  EXPECT_FALSE(NameFilter("(a+)+$b").picks(name));
  EXPECT_FALSE(NameFilter(repeated(100, "a?") + repeated(100, "a") + "b").picks(name));
  EXPECT_THAT(refused("((((a{100}){100}){100}){100})"), HasSubstr("not a regular expression"));
}

}  // namespace
}  // namespace pirt
