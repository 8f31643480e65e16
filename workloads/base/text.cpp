#include "workloads/base/text.h"

#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <numeric>
#include <sstream>
#include <utility>

#include "workloads/base/error.h"

namespace pirt {
namespace {

std::size_t edit_distance(std::string_view a, std::string_view b) {
  std::vector<std::size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), std::size_t{0});
  for (std::size_t i = 1; i <= a.size(); ++i) {
    std::size_t diagonal = std::exchange(row[0], i);
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t substitute = diagonal + (a[i - 1] == b[j - 1] ? 0 : 1);
      diagonal = row[j];
      row[j] = std::min({row[j] + 1, row[j - 1] + 1, substitute});
    }
  }
  return row.back();
}

[[noreturn]] void throw_system(std::string_view doing, const std::filesystem::path& path,
                               int error) {
  throw_bad_input(std::string("cannot ") + std::string(doing) + " '" + path.string() +
                  "': " + std::strerror(error));
}

}  // namespace

std::vector<std::string> nearest(std::string_view word, std::span<const std::string> candidates,
                                 std::size_t limit) {
  std::vector<std::pair<std::size_t, std::string>> ranked;
  for (const auto& candidate : candidates) {
    const bool prefix = !word.empty() && candidate.starts_with(word);
    const std::size_t distance = prefix ? 0 : edit_distance(word, candidate);
    if (distance <= std::max<std::size_t>(1, std::max(word.size(), candidate.size()) / 2)) {
      ranked.emplace_back(distance, candidate);
    }
  }
  std::ranges::stable_sort(ranked, {}, &std::pair<std::size_t, std::string>::first);
  std::vector<std::string> result;
  for (std::size_t i = 0; i < std::min(limit, ranked.size()); ++i)
    result.push_back(ranked[i].second);
  return result;
}

std::string suggestion(std::string_view word, std::span<const std::string> candidates) {
  const auto near = nearest(word, candidates);
  if (!near.empty()) return " (did you mean " + join(near, ", ") + "?)";
  if (!candidates.empty() && candidates.size() <= 12)
    return " (known: " + join(candidates, ", ") + ")";
  return "";
}

std::string join(std::span<const std::string> parts, std::string_view separator) {
  std::string text;
  for (std::size_t i = 0; i < parts.size(); ++i) {
    if (i != 0) text += separator;
    text += parts[i];
  }
  return text;
}

std::vector<std::string> split(std::string_view text, char separator) {
  std::vector<std::string> parts;
  std::size_t begin = 0;
  while (begin <= text.size()) {
    const std::size_t end = std::min(text.find(separator, begin), text.size());
    parts.emplace_back(text.substr(begin, end - begin));
    begin = end + 1;
  }
  return parts;
}

std::string read_file(const std::filesystem::path& path) {
  if (std::filesystem::is_directory(path)) throw_system("read", path, EISDIR);
  errno = 0;
  std::ifstream in(path, std::ios::binary);
  if (!in) throw_system("read", path, errno != 0 ? errno : EIO);
  std::ostringstream text;
  text << in.rdbuf();
  if (in.bad()) throw_system("read", path, EIO);
  return text.str();
}

void write_file(const std::filesystem::path& path, std::string_view text) {
  // A device or a pipe cannot be replaced by renaming; it is written to directly.
  if (std::filesystem::exists(path) && !std::filesystem::is_regular_file(path)) {
    std::ofstream out(path, std::ios::binary);
    if (!(out << text << std::flush)) throw_system("write", path, errno != 0 ? errno : EIO);
    return;
  }
  auto temporary = path;
  temporary += ".tmp" + std::to_string(::getpid());
  errno = 0;
  {
    std::ofstream out(temporary, std::ios::binary);
    if (!out || !(out << text << std::flush)) {
      const int error = errno != 0 ? errno : EIO;
      std::error_code ignored;
      std::filesystem::remove(temporary, ignored);
      throw_system("write", path, error);
    }
  }
  std::error_code failed;
  std::filesystem::rename(temporary, path, failed);
  if (failed) {
    std::error_code ignored;
    std::filesystem::remove(temporary, ignored);
    throw_bad_input("cannot write '" + path.string() + "': " + failed.message());
  }
}

}  // namespace pirt
