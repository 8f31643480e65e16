// Numbers from text: what is a number, what is out of range, and that nothing is guessed.
#include "workloads/base/text/numbers.h"

#include <gmock/gmock.h>

#include <cstdint>
#include <limits>

#include "tests/support/errors.h"

namespace pirt::test {
namespace {

using testing::HasSubstr;

constexpr auto kLowest = std::numeric_limits<std::int64_t>::min();
constexpr auto kHighest = std::numeric_limits<std::int64_t>::max();
constexpr auto kAllBits = std::numeric_limits<std::uint64_t>::max();

std::optional<std::int64_t> whole(std::string_view text) {
  return whole_number(text, kLowest, kHighest).value;
}
std::optional<double> decimal(std::string_view text) {
  return decimal_number(text, -1e300, 1e300).value;
}

TEST(Numbers, ReadWholeNumbersUpToTheEndsOfTheirType) {
  EXPECT_EQ(whole("0"), 0);
  EXPECT_EQ(whole("-0"), 0);
  EXPECT_EQ(whole("10"), 10);
  EXPECT_EQ(whole("-7"), -7);
  EXPECT_EQ(whole("9223372036854775807"), kHighest);
  EXPECT_EQ(whole("-9223372036854775808"), kLowest);
  EXPECT_EQ(whole_number("18446744073709551615", std::uint64_t{0}, kAllBits).value, kAllBits);
  EXPECT_EQ(whole_number("2147483647", 0, std::numeric_limits<int>::max()).value, 2147483647);
}

TEST(Numbers, ReadDecimals) {
  EXPECT_EQ(decimal("0"), 0);
  EXPECT_EQ(decimal("-0.0"), 0);
  EXPECT_EQ(decimal("2.5"), 2.5);
  EXPECT_EQ(decimal("-2.5e3"), -2500);
  EXPECT_EQ(decimal(".5"), 0.5);
  EXPECT_EQ(decimal("5."), 5);
  EXPECT_EQ(decimal("1E+2"), 100);
  EXPECT_EQ(decimal("0e5"), 0);
}

TEST(Numbers, AreInPlainDecimalNotation) {
  for (const char* text :
       {"",     " ",   " 1",   "1 ",       "+1",   "--1",   "-",     "010",
        "-010", "00",  "0x10", "0o10",     "0b1",  "1_000", "1,000", "1'000",
        "nan",  "inf", "-inf", "Infinity", ".nan", "two",   "1\n",   "\xd9\xa1"}) {
    EXPECT_FALSE(whole(text)) << text;
    EXPECT_FALSE(decimal(text)) << text;
  }
  for (const char* text : {"1.0", "1e3", ".5"}) EXPECT_FALSE(whole(text)) << text;
  for (const char* text : {".", "-.", "e5", ".e5", "1e", "1e+", "1.5.2", "00.5", "0x1p3", "1e5.5"})
    EXPECT_FALSE(decimal(text)) << text;
  EXPECT_FALSE(whole(std::string_view("1\0", 2)));
}

TEST(Numbers, ThatTheTypeCannotHoldAreRefusedAndNeverTheNextBest) {
  EXPECT_FALSE(whole("9223372036854775808"));
  EXPECT_FALSE(whole("-9223372036854775809"));
  for (const char* text : {"18446744073709551616", "99999999999999999999", "-1", "-0"}) {
    EXPECT_FALSE(whole_number(text, std::uint64_t{0}, kAllBits).value) << text;
  }
  EXPECT_FALSE(whole_number("2147483648", 0, std::numeric_limits<int>::max()).value);
  EXPECT_FALSE(decimal("1e999"));
  EXPECT_FALSE(decimal("1e-999"));
}

TEST(Numbers, SayTheRangeAndWhatWasGot) {
  EXPECT_EQ(whole_number("5000", 1, 64).problem, "must be between 1 and 64, got 5000");
  EXPECT_EQ(whole_number("99999999999999999999", 1, 64).problem,
            "must be between 1 and 64, got 99999999999999999999");
  EXPECT_EQ(whole_number("-1", std::uint64_t{0}, kAllBits).problem,
            "must be between 0 and 18446744073709551615, got -1");
  EXPECT_EQ(whole_number("010", 1, 64).problem,
            "must be a whole number in plain digits, got '010'");
  EXPECT_EQ(decimal_number("-1", 0, 2.5).problem, "must be between 0 and 2.5, got -1");
  EXPECT_THAT(decimal_number("nan", 0, 2.5).problem, HasSubstr("must be a finite number"));
  EXPECT_EQ(bad_input([] { static_cast<void>(whole_number("", 1, 9).or_refuse("--count")); }),
            "--count must be a whole number in plain digits, got ''");
  EXPECT_EQ(whole_number("3", 1, 9).or_refuse("--count"), 3);
}

TEST(Numbers, TakeTheEndsOfTheRange) {
  EXPECT_EQ(whole_number("1", 1, 64).value, 1);
  EXPECT_EQ(whole_number("64", 1, 64).value, 64);
  EXPECT_FALSE(whole_number("0", 1, 64).value);
  EXPECT_FALSE(whole_number("65", 1, 64).value);
  EXPECT_EQ(decimal_number("2.5", -1, 2.5).value, 2.5);
  EXPECT_FALSE(decimal_number("2.5000001", -1, 2.5).value);
}

TEST(Numbers, TimesBelowANanosecondAreRefusedAndNotRoundedToZero) {
  EXPECT_EQ(milliseconds("0", 0, 1e9).value, Nanos(0));
  EXPECT_EQ(milliseconds("1e-6", 0, 1e9).value, Nanos(1));
  EXPECT_EQ(milliseconds("0.0000015", kNanosecondMs, 1e9).value, Nanos(2));
  EXPECT_EQ(milliseconds("1e9", 0, 1e9).value, Nanos(1'000'000'000'000'000));
  for (const char* text : {"1e-7", "9.99e-7", "1e-300", "1e-999", "-1e-7", "-1", "1.1e9"}) {
    EXPECT_FALSE(milliseconds(text, 0, 1e9).value) << text;
    EXPECT_FALSE(milliseconds(text, kNanosecondMs, 1e9).value) << text;
  }
  EXPECT_FALSE(milliseconds("0", kNanosecondMs, 1e9).value);
  EXPECT_EQ(milliseconds("1e-7", 0, 1e9).problem,
            "must be 0 or at least 1e-06 (a nanosecond), got 1e-7");
  EXPECT_EQ(milliseconds("0", kNanosecondMs, 10).problem, "must be between 1e-06 and 10, got 0");
}

}  // namespace
}  // namespace pirt::test
