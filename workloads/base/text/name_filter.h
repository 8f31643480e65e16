// What --filter means, in every command and program: a regular expression that is searched in
// names.
//
// It is matched in time linear in the name, whatever the expression (RE2), so that no filter hangs
// a run or exhausts its stack. What cannot be had in linear time, look-around and back-references,
// is refused.
#pragma once

#include <cstddef>
#include <memory>
#include <string>
#include <string_view>

namespace re2 {
class RE2;
}

namespace pirt {

/// In bytes; all names of the catalog as alternatives take a third of it.
inline constexpr std::size_t kLongestFilter = 1000;

class NameFilter {
 public:
  /// @param text  RE2 syntax (https://github.com/google/re2/wiki/Syntax); empty picks every name.
  /// @throws Error{kBadInput} naming --filter if it is too long or no such expression.
  explicit NameFilter(const std::string& text);

  /// Whether @p name contains a match.
  [[nodiscard]] bool picks(std::string_view name) const;

 private:
  std::shared_ptr<const re2::RE2> expression_;
};

}  // namespace pirt
