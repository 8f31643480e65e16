// What is named: a file, or one of those that are compiled into the binary.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "workloads/base/embedded.h"

namespace pirt {

struct NamedText {
  std::string file, text;
};

/// @param what   "platform", "mix": what is named.
/// @param files  Those that are shipped, NAME.yaml.
/// @throws Error{kBadInput} if it is neither shipped nor a file that can be read.
[[nodiscard]] NamedText read_named(const std::string& what, const std::string& name,
                                   std::span<const EmbeddedFile> files);

/// Their names, sorted.
[[nodiscard]] std::vector<std::string> names_of(std::span<const EmbeddedFile> files);

}  // namespace pirt
