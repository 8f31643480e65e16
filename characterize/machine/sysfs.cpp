#include "characterize/machine/sysfs.h"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <cstring>

#include "workloads/base/system/file_descriptor.h"

namespace pirt {
namespace {

constexpr int kAttempts = 3;

/// One attempt: the text, or errno. An attribute is at most a page and comes in one read.
Attribute<std::string> read_once(const std::filesystem::path& path) {
  const FileDescriptor file(::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK));
  if (file.get() < 0) return {std::nullopt, "", errno};
  std::array<char, 4096> page{};
  ssize_t count = 0;
  do {
    count = ::read(file.get(), page.data(), page.size());
  } while (count < 0 && errno == EINTR);
  if (count < 0) return {std::nullopt, "", errno};
  std::string text(page.data(), static_cast<std::size_t>(count));
  const auto is_space = [](char c) { return c == ' ' || c == '\t' || c == '\n' || c == '\0'; };
  while (!text.empty() && is_space(text.back())) text.pop_back();
  text.erase(0, text.find_first_not_of(" \t\n"));
  return {std::move(text), "", 0};
}

}  // namespace

Attribute<std::string> read_text(const std::filesystem::path& path) {
  Attribute<std::string> result;
  for (int attempt = 0; attempt < kAttempts; ++attempt) {
    result = read_once(path);
    if (result.value || (result.code != EIO && result.code != EAGAIN)) break;
  }
  if (!result.value) result.error = path.string() + ": " + std::strerror(result.code);
  return result;
}

Attribute<std::int64_t> read_integer(const std::filesystem::path& path) {
  const auto text = read_text(path);
  if (!text.value) return {std::nullopt, text.error, text.code};
  std::int64_t value = 0;
  const char* end = text.value->data() + text.value->size();
  const auto [last, error] = std::from_chars(text.value->data(), end, value);
  if (error != std::errc() || last != end) {
    return {std::nullopt, path.string() + ": no number: '" + text.value->substr(0, 40) + "'", 0};
  }
  return {value, "", 0};
}

std::string text_or_empty(const std::filesystem::path& path) {
  return read_text(path).value.value_or("");
}

std::vector<std::filesystem::path> folder_entries(const std::filesystem::path& folder) {
  std::vector<std::filesystem::path> paths;
  std::error_code error;
  for (auto it = std::filesystem::directory_iterator(folder, error);
       !error && it != std::filesystem::directory_iterator(); it.increment(error)) {
    paths.push_back(it->path());
  }
  std::ranges::sort(paths);
  return paths;
}

}  // namespace pirt
