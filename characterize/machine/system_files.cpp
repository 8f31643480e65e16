#include "characterize/machine/system_files.h"

#include <algorithm>
#include <charconv>
#include <fstream>

#include "workloads/base/text/text.h"

namespace pirt {
namespace {

std::optional<std::int64_t> leading_number(std::string_view text) {
  std::int64_t value = 0;
  const auto [end, failed] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (failed != std::errc() || end == text.data()) return std::nullopt;
  return value;
}

}  // namespace

std::string trimmed(std::string_view text) {
  constexpr std::string_view kBlanks = " \t\"\r\n";
  const auto first = text.find_first_not_of(kBlanks);
  if (first == std::string_view::npos) return "";
  return std::string(text.substr(first, text.find_last_not_of(kBlanks) - first + 1));
}

std::optional<std::string> first_line(const std::filesystem::path& path) {
  std::ifstream in(path);
  std::string line;
  if (!std::getline(in, line)) return std::nullopt;
  while (!line.empty() && (line.back() == '\0' || line.back() == ' ')) line.pop_back();
  return line;
}

std::optional<std::int64_t> read_number(const std::filesystem::path& path) {
  const auto line = first_line(path);
  return line ? leading_number(*line) : std::nullopt;
}

std::optional<std::string> value_of(const std::filesystem::path& path, std::string_view key,
                                    char separator) {
  std::ifstream in(path);
  for (std::string line; std::getline(in, line);) {
    const auto at = line.find(separator);
    if (at != std::string::npos && trimmed(std::string_view(line).substr(0, at)) == key) {
      return trimmed(std::string_view(line).substr(at + 1));
    }
  }
  return std::nullopt;
}

std::optional<std::int64_t> number_of(const std::filesystem::path& path, std::string_view key,
                                      char separator) {
  const auto value = value_of(path, key, separator);
  return value ? leading_number(*value) : std::nullopt;
}

std::vector<int> numbered_folders(const std::filesystem::path& folder, std::string_view prefix) {
  std::vector<int> numbers;
  std::error_code failed;
  for (const auto& entry : std::filesystem::directory_iterator(folder, failed)) {
    const std::string name = entry.path().filename().string();
    if (!name.starts_with(prefix)) continue;
    const std::string_view digits = std::string_view(name).substr(prefix.size());
    int number = 0;
    const auto* end = digits.data() + digits.size();
    if (std::from_chars(digits.data(), end, number).ptr == end && !digits.empty()) {
      numbers.push_back(number);
    }
  }
  std::ranges::sort(numbers);
  return numbers;
}

std::set<int> core_siblings(const std::filesystem::path& root, int core) {
  const auto topology =
      root / "sys/devices/system/cpu" / ("cpu" + std::to_string(core)) / "topology";
  std::set<int> cores = {core};
  for (const auto& part : split(first_line(topology / "thread_siblings_list").value_or(""), ',')) {
    int first = 0;
    const char* const end = part.data() + part.size();
    const auto [at, failed] = std::from_chars(part.data(), end, first);
    if (failed != std::errc()) continue;
    int last = first;
    if (at != end && *at == '-') std::from_chars(at + 1, end, last);
    for (int sibling = first; sibling <= last; ++sibling) cores.insert(sibling);
  }
  return cores;
}

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
  std::optional<std::string> unified;
  for (std::string line; std::getline(in, line);) {
    const auto parts = split(line, ':');
    if (parts.size() < 3) continue;
    const auto controllers = split(parts[1], ',');
    if (std::ranges::find(controllers, controller) != controllers.end()) {
      add(tree / std::string(controller), parts[2]);
    } else if (parts[1].empty()) {
      unified = parts[2];
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

}  // namespace pirt
