#include "workloads/base/system/control_groups.h"

#include <unistd.h>

#include <algorithm>
#include <fstream>
#include <string>

namespace pirt {

std::vector<std::filesystem::path> control_groups(const std::filesystem::path& root,
                                                  std::string_view controller) {
  const auto tree = root / "sys/fs/cgroup";
  std::vector<std::filesystem::path> folders;
  const auto add = [&folders](const std::filesystem::path& base, std::string_view group) {
    while (group.starts_with('/')) group.remove_prefix(1);
    for (std::filesystem::path path = group; !path.empty(); path = path.parent_path()) {
      folders.push_back(base / path);
    }
    folders.push_back(base);
  };
  // Lines "0::/group" (v2) and "4:cpu,cpuacct:/group" (v1). @source cgroups(7).
  std::ifstream in(root / "proc/self/cgroup");
  const std::string wanted(controller);
  std::optional<std::string> unified;
  for (std::string number, controllers, group; std::getline(in, number, ':') &&
                                               std::getline(in, controllers, ':') &&
                                               std::getline(in, group);) {
    if (("," + controllers + ",").find("," + wanted + ",") != std::string::npos) {
      add(tree / wanted, group);
    } else if (controllers.empty()) {
      unified = group;
    }
  }
  if (unified) {
    add(tree, *unified);
    add(tree / "unified", *unified);
  } else if (folders.empty()) {
    folders = {tree};
  }
  return folders;
}

std::optional<std::int64_t> memory_limit_bytes(const std::filesystem::path& root) {
  constexpr std::int64_t kNone = std::int64_t{1} << 60;  // version 1 says 2^63 less a page
  std::optional<std::int64_t> least;
  for (const auto& folder : control_groups(root, "memory")) {
    for (const char* file : {"memory.max", "memory.high", "memory.limit_in_bytes"}) {
      std::int64_t limit = 0;
      std::ifstream in(folder / file);  // "max" is none
      if (in >> limit && limit > 0 && limit < kNone) least = std::min(least.value_or(limit), limit);
    }
  }
  return least;
}

std::int64_t most_filled_bytes(const std::filesystem::path& root) {
  const std::int64_t all = std::int64_t{::sysconf(_SC_PHYS_PAGES)} * ::sysconf(_SC_PAGE_SIZE);
  return std::min(all, memory_limit_bytes(root).value_or(all)) / 8;
}

}  // namespace pirt
