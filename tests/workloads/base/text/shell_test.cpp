#include "workloads/base/text/shell.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cstdio>
#include <memory>
#include <string>

#include "tests/support/errors.h"

namespace pirt::test {
namespace {

std::string output_of(const std::string& command) {
  const std::unique_ptr<FILE, int (*)(FILE*)> pipe(popen(command.c_str(), "r"), pclose);
  std::string text;
  std::array<char, 256> part{};
  while (const std::size_t got = fread(part.data(), 1, part.size(), pipe.get())) {
    text.append(part.data(), got);
  }
  return text;
}

/// What a shell makes of the word.
std::string echoed(const std::string& word) { return output_of("printf %s " + word); }

TEST(Shell, TakesAWordForWhatItIs) {
  for (const char* word : {"plain", "My Drive (1)/p.db", "it's", "$HOME", "a;b", "'", "\"", "*",
                           "^(fc8|sobel)$", "two\nlines", "back\\slash", "~", "#"}) {
    EXPECT_EQ(echoed(in_shell(word)), word);
  }
  EXPECT_EQ(in_shell("results/p-1.db"), "results/p-1.db");
  EXPECT_EQ(in_shell(""), "''");
  EXPECT_EQ(path_in_shell("-q.db"), "./-q.db");
}

TEST(ShellWords, AreThoseThatAShellMakes) {
  for (const char* command :
       {"a b  c", "'a b' c", R"("a b"c 'd'"e")", R"(a\ b "x\"y" "p\q" '')", "--x='1 2'\tz"}) {
    std::string echoed_words;
    for (const std::string& word : shell_words(command)) echoed_words += "[" + word + "]";
    EXPECT_EQ(echoed_words, output_of(std::string("printf [%s] ") + command)) << command;
  }
}

TEST(ShellWords, RefuseWhatOnlyAShellUnderstands) {
  EXPECT_THAT(test::bad_input([] { static_cast<void>(shell_words("a | b")); }),
              testing::AllOf(testing::HasSubstr("has |"), testing::HasSubstr("sh -c")));
  EXPECT_THAT(test::bad_input([] { static_cast<void>(shell_words("a 'b")); }),
              testing::HasSubstr("without its end"));
  EXPECT_THAT(test::bad_input([] { static_cast<void>(shell_words("  ")); }),
              testing::HasSubstr("no word"));
  EXPECT_THAT(shell_words("sh -c 'a | b'"), testing::ElementsAre("sh", "-c", "a | b"));
}

}  // namespace
}  // namespace pirt::test
