#include "workloads/own/libraries.h"

#include <elf.h>
#include <link.h>

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>

#include "workloads/base/text/text.h"

namespace pirt {

namespace fs = std::filesystem;

namespace {

/// The T at @p offset; absent beyond the end.
template <typename T>
std::optional<T> read_at(std::string_view bytes, std::uint64_t offset) {
  if (offset > bytes.size() || bytes.size() - offset < sizeof(T)) return std::nullopt;
  T found{};
  std::memcpy(&found, bytes.data() + offset, sizeof(T));
  return found;
}

/// What a dynamic section says.
struct Links {
  std::vector<std::string> needed, folders;
};

Links links_of(std::string_view bytes) {
  constexpr unsigned char kClass = sizeof(void*) == 8 ? ELFCLASS64 : ELFCLASS32;
  const auto header = read_at<ElfW(Ehdr)>(bytes, 0);
  if (!header || !bytes.starts_with(ELFMAG) || header->e_ident[EI_CLASS] != kClass) return {};
  std::vector<ElfW(Phdr)> loaded;
  std::uint64_t offset = bytes.size();  // of the dynamic section
  for (std::uint64_t i = 0; i < header->e_phnum; ++i) {
    const auto segment = read_at<ElfW(Phdr)>(bytes, header->e_phoff + i * sizeof(ElfW(Phdr)));
    if (segment && segment->p_type == PT_LOAD) loaded.push_back(*segment);
    if (segment && segment->p_type == PT_DYNAMIC) offset = segment->p_offset;
  }
  std::vector<ElfW(Dyn)> entries;
  std::uint64_t strings = 0;  // their address
  for (; const auto entry = read_at<ElfW(Dyn)>(bytes, offset); offset += sizeof(*entry)) {
    if (entry->d_tag == DT_NULL) break;
    if (entry->d_tag == DT_STRTAB) strings = entry->d_un.d_ptr;
    entries.push_back(*entry);
  }
  const auto text_at = [&](std::uint64_t address) -> std::string {
    for (const auto& segment : loaded) {
      const std::uint64_t within = address - segment.p_vaddr;
      const std::uint64_t begin = segment.p_offset + within;
      if (address < segment.p_vaddr || within >= segment.p_filesz || begin >= bytes.size()) {
        continue;
      }
      return std::string(bytes.substr(begin, bytes.find('\0', begin) - begin));
    }
    return "";
  };
  Links links;
  for (const auto& entry : entries) {
    const std::string text = text_at(strings + entry.d_un.d_val);
    if (text.empty()) continue;
    if (entry.d_tag == DT_NEEDED) links.needed.push_back(text);
    if (entry.d_tag == DT_RUNPATH || entry.d_tag == DT_RPATH) links.folders = split(text, ':');
  }
  return links;
}

/// A folder of a run path, of a file in @p origin.
fs::path place_of(std::string folder, const fs::path& origin) {
  for (const std::string_view word : {"${ORIGIN}", "$ORIGIN"}) {
    const auto at = folder.find(word);
    if (at != std::string::npos) folder.replace(at, word.size(), origin.string());
  }
  return folder;
}

}  // namespace

std::vector<fs::path> linked_libraries(const fs::path& file) {
  std::error_code missing;
  std::vector<fs::path> all = {fs::absolute(file)};
  std::set<fs::path> known = {fs::canonical(file, missing)};
  for (std::size_t i = 0; i < all.size(); ++i) {
    const Links links = links_of(read_file(all[i], kAnySize));
    std::vector<fs::path> places;
    for (const fs::path& origin :
         {all[i].parent_path(), fs::canonical(all[i], missing).parent_path()}) {
      for (const std::string& folder : links.folders) places.push_back(place_of(folder, origin));
      places.push_back(origin);
    }
    for (const std::string& name : links.needed) {
      const auto place = std::ranges::find_if(places, [&](const fs::path& folder) {
        return fs::is_regular_file(folder / name, missing);
      });
      if (place == places.end()) continue;
      fs::path library = *place / name;
      if (known.insert(fs::canonical(library, missing)).second) all.push_back(std::move(library));
    }
  }
  all.erase(all.begin());
  return all;
}

}  // namespace pirt
