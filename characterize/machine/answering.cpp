#include "characterize/machine/answering.h"

#include <unistd.h>

#include <algorithm>
#include <cstdint>
#include <fstream>
#include <limits>
#include <optional>
#include <sstream>
#include <string>
#include <string_view>
#include <vector>

#include "characterize/machine/system_files.h"
#include "workloads/base/text/numbers.h"

namespace pirt {
namespace {

/// The fields after the name, which is in parentheses and may hold any character: state, parent,
/// nine others, and the ticks in user and in kernel mode.
std::optional<ProcessTime> read_process(const std::filesystem::path& folder) {
  const std::string line = text_or_empty(folder / "stat");
  const auto name_ends = line.rfind(')');
  if (name_ends == std::string::npos) return std::nullopt;
  std::istringstream fields(line.substr(name_ends + 1));
  std::string skipped;
  ProcessTime found;
  fields >> skipped >> found.parent;
  for (int i = 0; i < 9; ++i) fields >> skipped;
  std::int64_t user = 0, kernel = 0;
  if (!(fields >> user >> kernel)) return std::nullopt;
  found.used = (user + kernel) * Nanos(1'000'000'000 / ::sysconf(_SC_CLK_TCK));
  return found;
}

/// Of both ends as the kernel writes them, IPv4 in the place of IPv4 in IPv6.
std::string plain(std::string address) {
  constexpr std::string_view kMapped = "0000000000000000FFFF0000";
  if (address.starts_with(kMapped)) address.erase(0, kMapped.size());
  return address;
}

struct Connected {
  std::string here, there, inode;
};

std::vector<Connected> connections(const std::filesystem::path& root) {
  constexpr std::string_view kEstablished = "01";
  std::vector<Connected> all;
  for (const char* table : {"proc/self/net/tcp", "proc/self/net/tcp6"}) {
    std::ifstream in(root / table);
    std::string line;
    std::getline(in, line);  // names of the columns
    while (std::getline(in, line)) {
      std::istringstream fields(line);
      std::string skipped, state;
      Connected each;
      fields >> skipped >> each.here >> each.there >> state;
      for (int i = 0; i < 5; ++i) fields >> skipped;
      if (!(fields >> each.inode) || state != kEstablished) continue;
      all.push_back({plain(each.here), plain(each.there), each.inode});
    }
  }
  return all;
}

/// The sockets that a process holds.
std::set<std::string> sockets_of(const std::filesystem::path& folder) {
  constexpr std::string_view kBegin = "socket:[";
  std::set<std::string> inodes;
  for (const auto& each : folder_entries(folder / "fd")) {
    std::error_code gone;
    const std::string target = std::filesystem::read_symlink(each, gone).string();
    if (!target.starts_with(kBegin) || !target.ends_with(']')) continue;
    inodes.insert(target.substr(kBegin.size(), target.size() - kBegin.size() - 1));
  }
  return inodes;
}

}  // namespace

ProcessTimes read_process_times(const std::filesystem::path& root) {
  ProcessTimes all;
  for (const auto& folder : folder_entries(root / "proc")) {
    const auto id = whole_number(folder.filename().string(), 1, std::numeric_limits<int>::max());
    if (!id.value) continue;
    if (const auto found = read_process(folder)) all.emplace(*id.value, *found);
  }
  return all;
}

std::set<int> answering_processes(const ProcessTimes& all, const std::filesystem::path& root) {
  const std::set<std::string> own = sockets_of(root / "proc/self");
  const std::vector<Connected> connected = connections(root);
  std::set<std::string> places;  // That this process is connected to.
  for (const Connected& each : connected) {
    if (own.contains(each.inode)) places.insert(each.there);
  }
  std::set<std::string> theirs;
  for (const Connected& each : connected) {
    const bool answers = places.contains(each.here) || places.contains(each.there);
    if (answers && !own.contains(each.inode)) theirs.insert(each.inode);
  }
  std::set<int> found;
  if (theirs.empty()) return found;
  for (const auto& [id, time] : all) {
    const auto sockets = sockets_of(root / "proc" / std::to_string(id));
    if (std::ranges::any_of(sockets, [&](const auto& inode) { return theirs.contains(inode); })) {
      found.insert(id);
    }
  }
  for (bool more = true; more;) {
    more = false;
    for (const auto& [id, time] : all) {
      if (found.contains(time.parent)) more = found.insert(id).second || more;
    }
  }
  return found;
}

Nanos used_by(const std::set<int>& which, const ProcessTimes& before, const ProcessTimes& after) {
  Nanos sum{0};
  for (const int id : which) {
    const auto at_end = after.find(id), at_begin = before.find(id);
    if (at_end == after.end()) continue;
    sum += at_end->second.used;
    if (at_begin != before.end()) sum -= at_begin->second.used;
  }
  return sum;
}

}  // namespace pirt
