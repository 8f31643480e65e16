#include "characterize/platform/shipped.h"

#include <algorithm>

#include "characterize/platform/platform.h"
#include "workloads/base/error.h"
#include "workloads/base/text/text.h"

namespace pirt {
namespace {

constexpr std::string_view kShippedSuffix = ".yaml";

}  // namespace

bool names_a_file(std::string_view name) {
  return name.find('/') != std::string_view::npos || name.ends_with(kShippedSuffix);
}

NamedText read_named(const std::string& what, const std::string& name,
                     std::span<const EmbeddedFile> files) {
  if (names_a_file(name)) return {name, read_text(name)};
  std::string file = name + std::string(kShippedSuffix);
  const auto shipped = find_embedded(files, file);
  if (!shipped) {
    throw_bad_input("unknown " + what + " '" + name + "'" + suggestion(name, names_of(files)) +
                    "; a file is named with a '/' or ends in .yaml");
  }
  return {std::move(file), std::string(*shipped)};
}

std::vector<std::string> names_of(std::span<const EmbeddedFile> files) {
  std::vector<std::string> names;
  for (const auto& file : files) {
    names.emplace_back(file.name.substr(0, file.name.size() - kShippedSuffix.size()));
  }
  std::ranges::sort(names);
  return names;
}

}  // namespace pirt
