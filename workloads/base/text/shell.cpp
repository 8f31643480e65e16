#include "workloads/base/text/shell.h"

#include <utility>

#include "workloads/base/error.h"
#include "workloads/base/text/text.h"

namespace pirt {

std::string in_shell(std::string_view word) {
  // Of which no shell makes anything.
  if (!word.empty() && is_made_of(word, "_./:=,+@%-")) return std::string(word);
  std::string quoted = "'";
  for (const char c : word) {
    if (c == '\'') {
      quoted += R"('\'')";
    } else {
      quoted += c;
    }
  }
  return quoted + "'";
}

std::string path_in_shell(std::string_view path) {
  return in_shell(path.starts_with('-') ? "./" + std::string(path) : std::string(path));
}

std::vector<std::string> shell_words(std::string_view command) {
  std::vector<std::string> words;
  std::string word;
  bool in_word = false;
  const auto fail = [&command](const std::string& why) {
    throw_bad_input("the command '" + std::string(command) + "' " + why);
  };
  for (std::size_t i = 0; i < command.size(); ++i) {
    const char c = command[i];
    if (c == ' ' || c == '\t' || c == '\n') {
      if (in_word) words.push_back(std::exchange(word, ""));
      in_word = false;
      continue;
    }
    const bool expands = std::string_view("|&;<>()$`*?[").find(c) != std::string_view::npos ||
                         (!in_word && (c == '~' || c == '#'));
    in_word = true;
    if (c == '\\' && i + 1 < command.size()) {
      word += command[++i];
    } else if (c == '\'' || c == '"') {
      std::size_t end = i + 1;
      for (; end < command.size() && command[end] != c; ++end) {
        const bool escaped =
            c == '"' && command[end] == '\\' && end + 1 < command.size() &&
            std::string_view("\"\\$`").find(command[end + 1]) != std::string_view::npos;
        if (escaped) ++end;
        word += command[end];
      }
      if (end >= command.size()) fail(std::string("has a quote ") + c + " without its end");
      i = end;
    } else if (expands) {
      fail(std::string("has ") + c +
           ", which only a shell understands, and none runs; quote it, or give sh -c '...'");
    } else {
      word += c;
    }
  }
  if (in_word) words.push_back(word);
  if (words.empty()) fail("has no word; give a program and its arguments");
  return words;
}

}  // namespace pirt
