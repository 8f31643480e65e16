#include "workloads/base/text/shell.h"

#include <gtest/gtest.h>

#include <array>
#include <cstdio>
#include <memory>
#include <string>

namespace pirt::test {
namespace {

/// What a shell makes of the word.
std::string echoed(const std::string& word) {
  const std::string command = "printf %s " + word;
  const std::unique_ptr<FILE, int (*)(FILE*)> pipe(popen(command.c_str(), "r"), pclose);
  std::string text;
  std::array<char, 256> part{};
  while (const std::size_t got = fread(part.data(), 1, part.size(), pipe.get())) {
    text.append(part.data(), got);
  }
  return text;
}

TEST(Shell, TakesAWordForWhatItIs) {
  for (const char* word : {"plain", "My Drive (1)/p.db", "it's", "$HOME", "a;b", "'", "\"", "*",
                           "^(fc8|sobel)$", "two\nlines", "back\\slash", "~", "#"}) {
    EXPECT_EQ(echoed(in_shell(word)), word);
  }
  EXPECT_EQ(in_shell("results/p-1.db"), "results/p-1.db");
  EXPECT_EQ(in_shell(""), "''");
  EXPECT_EQ(path_in_shell("-q.db"), "./-q.db");
}

}  // namespace
}  // namespace pirt::test
