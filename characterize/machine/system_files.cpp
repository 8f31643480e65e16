#include "characterize/machine/system_files.h"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <cstring>
#include <fstream>

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

std::optional<std::int64_t> leading_number(std::string_view text) {
  std::int64_t value = 0;
  const auto [end, failed] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (failed != std::errc() || end == text.data()) return std::nullopt;
  return value;
}

}  // namespace

Attribute<std::string> read_attribute(const std::filesystem::path& path) {
  Attribute<std::string> result;
  for (int attempt = 0; attempt < kAttempts; ++attempt) {
    result = read_once(path);
    if (result.value || (result.code != EIO && result.code != EAGAIN)) break;
  }
  if (!result.value) result.error = path.string() + ": " + std::strerror(result.code);
  return result;
}

Attribute<std::int64_t> read_integer(const std::filesystem::path& path) {
  const auto text = read_attribute(path);
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
  return read_attribute(path).value.value_or("");
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

std::string trimmed(std::string_view text) {
  constexpr std::string_view kBlanks = " \t\"\r\n";
  const auto first = text.find_first_not_of(kBlanks);
  if (first == std::string_view::npos) return "";
  return std::string(text.substr(first, text.find_last_not_of(kBlanks) - first + 1));
}

std::optional<std::string> first_line(const std::filesystem::path& path) {
  auto text = read_attribute(path).value;
  if (!text || text->empty()) return std::nullopt;
  text->resize(std::min(text->find('\n'), text->size()));
  while (!text->empty() && (text->back() == '\0' || text->back() == ' ')) text->pop_back();
  return text;
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

}  // namespace pirt
