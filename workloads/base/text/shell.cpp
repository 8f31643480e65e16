#include "workloads/base/text/shell.h"

#include <algorithm>

namespace pirt {
namespace {

/// Of which no shell makes anything.
bool is_plain_in_shell(char c) {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ||
         std::string_view("_./:=,+@%-").find(c) != std::string_view::npos;
}

}  // namespace

std::string in_shell(std::string_view word) {
  if (!word.empty() && std::ranges::all_of(word, is_plain_in_shell)) return std::string(word);
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

}  // namespace pirt
