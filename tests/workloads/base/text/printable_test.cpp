// Text from outside: what is printable, and how the rest is shown.
#include "workloads/base/text/printable.h"

#include <gtest/gtest.h>

namespace pirt::test {
namespace {

TEST(Printable, TextOfAnyLanguageStaysAsItIs) {
  for (const char* text : {"", "sobel", "Π-RT µ 日本語 🤖", "\u00a0", "a\\nb"}) {
    EXPECT_FALSE(find_unprintable(text)) << text;
    EXPECT_EQ(printable(text), text);
  }
}

TEST(Printable, ControlCharactersAreShownAsEscapes) {
  EXPECT_EQ(printable("a\nb\tc\rd"), "a\\nb\\tc\\rd");
  EXPECT_EQ(printable("\x1b[31mred\x7f"), "\\x1b[31mred\\x7f");
  EXPECT_EQ(printable("\u0085\u009b"), "\\xc2\\x85\\xc2\\x9b");
  EXPECT_EQ(printable(std::string_view("\0", 1)), "\\x00");
  // A right-to-left override, an isolate, a line separator.
  for (const char* bytes : {"\xe2\x80\xae", "\xe2\x81\xa6", "\xe2\x80\xa8"}) {
    EXPECT_TRUE(find_unprintable(bytes));
  }
  EXPECT_EQ(printable("\xe2\x80\xae"), "\\xe2\\x80\\xae");
  EXPECT_EQ(printable("a\nb\x1b", "\n"), "a\nb\\x1b");
}

TEST(Printable, BytesThatAreNotUtf8AreShownAsEscapes) {
  // A lone continuation, Latin-1, cut off, overlong (2, 3 and 4 bytes), a surrogate, above 10FFFF.
  for (const char* bytes : {"\x80", "\xe9", "\xe2\x82", "\xc0\xaf", "\xe0\x80\xaf",
                            "\xf0\x80\x80\xaf", "\xed\xa0\x80", "\xf4\x90\x80\x80", "\xff"}) {
    const auto found = find_unprintable(std::string("ok") + bytes + "!");
    ASSERT_TRUE(found) << bytes;
    EXPECT_EQ(found->at, 2U);
    EXPECT_FALSE(find_unprintable(printable(std::string("ok") + bytes + "!")));
  }
  EXPECT_EQ(printable("caf\xe9 au"), "caf\\xe9 au");
}

TEST(Printable, SaysWhatAndWhere) {
  EXPECT_EQ(find_unprintable("ab\x1b")->at, 2U);
  EXPECT_EQ(find_unprintable("ab\x1b")->what, "the control character \\x1b");
  EXPECT_EQ(find_unprintable("\xff")->what, "the byte \\xff, which is not UTF-8");
  EXPECT_FALSE(find_unprintable("a\n\tb", "\n\t"));
  EXPECT_EQ(find_unprintable("a\n\tb", "\n")->at, 2U);
}

}  // namespace
}  // namespace pirt::test
