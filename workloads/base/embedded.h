// Text files compiled into the binary (kernels, platforms, mixes, the schema); see embed.cmake.
#pragma once

#include <algorithm>
#include <optional>
#include <span>
#include <string_view>

namespace pirt {

struct EmbeddedFile {
  std::string_view name;  ///< File name without folders, e.g. "host.yaml".
  std::string_view text;
};

[[nodiscard]] inline std::optional<std::string_view> find_embedded(
    std::span<const EmbeddedFile> files, std::string_view name) {
  const auto it = std::ranges::find(files, name, &EmbeddedFile::name);
  return it == files.end() ? std::nullopt : std::optional(it->text);
}

}  // namespace pirt
