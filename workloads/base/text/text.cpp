#include "workloads/base/text/text.h"

#include <fcntl.h>
#include <fmt/core.h>
#include <poll.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <numeric>
#include <utility>

#include "workloads/base/error.h"
#include "workloads/base/system/temporary.h"

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

constexpr std::size_t kLeastRead = 4096;

/// A file that the user named, open for reading.
class InputFile {
 public:
  explicit InputFile(const std::filesystem::path& path) : path_(path) {
    // Looked at before it is opened, since opening alone sets some devices going.
    if (::stat(path.c_str(), &status_) != 0) throw_system("read", path, errno);
    if (S_ISDIR(status_.st_mode)) throw_system("read", path, EISDIR);
    if (!S_ISREG(status_.st_mode) && !S_ISFIFO(status_.st_mode) && !is_own_terminal()) {
      throw_bad_input("cannot read '" + path.string() +
                      "': it is a device or a socket; name a file or a pipe");
    }
    // Without O_NONBLOCK, opening a FIFO waits for its writer, and handled signals do not end that.
    fd_ = ::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NOCTTY | O_NONBLOCK);
    if (fd_ < 0) throw_system("read", path, errno);
  }
  InputFile(const InputFile&) = delete;
  InputFile& operator=(const InputFile&) = delete;
  ~InputFile() { ::close(fd_); }

  /// One more than the size, so that the end is met without growing; a guess for pipes.
  [[nodiscard]] std::size_t expected_bytes() const {
    constexpr off_t kMost = off_t{1} << 30;
    return status_.st_size < kMost ? static_cast<std::size_t>(status_.st_size) + 1 : kLeastRead;
  }

  /// @return bytes read; 0 = the end.
  [[nodiscard]] std::size_t read(char* to, std::size_t bytes) const {
    while (true) {
      if (!S_ISREG(status_.st_mode)) wait();
      const ssize_t got = ::read(fd_, to, bytes);
      if (got >= 0) return static_cast<std::size_t>(got);
      if (errno != EINTR && errno != EAGAIN) throw_system("read", path_, errno);
    }
  }

 private:
  /// What /dev/stdin is when somebody types; other devices need not have an end.
  [[nodiscard]] bool is_own_terminal() const {
    struct stat input {};
    return S_ISCHR(status_.st_mode) && ::isatty(STDIN_FILENO) == 1 &&
           ::fstat(STDIN_FILENO, &input) == 0 && input.st_rdev == status_.st_rdev;
  }

  /// Until a writer has written or gone. poll() is never restarted after a handler has run.
  void wait() const {
    pollfd state{.fd = fd_, .events = POLLIN, .revents = 0};
    if (::poll(&state, 1, -1) >= 0) return;
    if (errno != EINTR) throw_system("read", path_, errno);
    throw_environment("stopped by a signal while waiting for '" + path_.string() + "'");
  }

  std::filesystem::path path_;
  struct stat status_ {};
  int fd_ = -1;
};
/// In the order of their first: a unit's name may be its role as well.
std::vector<std::string> once_each(std::span<const std::string> words) {
  std::vector<std::string> once;
  for (const auto& word : words) {
    if (std::ranges::find(once, word) == once.end()) once.push_back(word);
  }
  return once;
}

}  // namespace

std::vector<std::string> nearest(std::string_view word, std::span<const std::string> candidates,
                                 std::size_t limit) {
  std::vector<std::pair<std::size_t, std::string>> ranked;
  for (const auto& candidate : once_each(candidates)) {
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
  const auto known = once_each(candidates);
  if (!known.empty() && known.size() <= 12) return " (known: " + join(known, ", ") + ")";
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

std::vector<std::string> words_in(std::string_view text) {
  constexpr std::string_view kBlanks = " \t\r\n";
  std::vector<std::string> words;
  while (true) {
    text.remove_prefix(std::min(text.find_first_not_of(kBlanks), text.size()));
    if (text.empty()) return words;
    words.emplace_back(text.substr(0, text.find_first_of(kBlanks)));
    text.remove_prefix(words.back().size());
  }
}

bool is_made_of(std::string_view text, std::string_view others) {
  return std::ranges::all_of(text, [others](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ||
           others.find(c) != std::string_view::npos;
  });
}

std::string read_file(const std::filesystem::path& path, std::size_t max_bytes) {
  const InputFile file(path);
  std::string text(std::min(file.expected_bytes(), max_bytes), '\0');
  std::size_t size = 0;
  while (true) {
    if (size > max_bytes) {
      throw_bad_input(fmt::format("'{}' is longer than the {} MiB that are read of such a file",
                                  path.string(), max_bytes >> 20));
    }
    if (size == text.size()) text.resize(size + std::max(size, kLeastRead));
    const std::size_t got = file.read(text.data() + size, text.size() - size);
    if (got == 0) break;
    size += got;
  }
  text.resize(size);
  refuse_pointer(path, text);
  return text;
}

std::string read_text(const std::filesystem::path& path, std::size_t max_bytes) {
  std::string text = read_file(path, max_bytes);
  if (text.starts_with("\xff\xfe") || text.starts_with("\xfe\xff")) {
    throw_bad_input("'" + path.string() + "' is in UTF-16; save it as UTF-8");
  }
  const std::size_t mark = text.starts_with("\xef\xbb\xbf") ? 3 : 0;
  std::size_t kept = 0;
  for (std::size_t i = mark; i < text.size(); ++i) {
    if (text[i] != '\r' || i + 1 == text.size() || text[i + 1] != '\n') text[kept++] = text[i];
  }
  text.resize(kept);
  return text;
}

void refuse_pointer(const std::filesystem::path& path, std::string_view head) {
  const auto refuse = [&path](const char* what) {
    throw_bad_input("'" + path.string() + "' is not the file itself but " + what);
  };
  if (head.starts_with("version https://git-lfs.github.com/spec/")) {
    refuse("a pointer of Git LFS; fetch it with `git lfs pull`");
  }
  if (head.starts_with("/annex/objects/")) {
    refuse("a pointer of git-annex; fetch it with `git annex get`");
  }
  std::string begin(head.substr(0, 14));
  std::ranges::transform(begin, begin.begin(),
                         [](char c) { return c >= 'A' && c <= 'Z' ? char(c - 'A' + 'a') : c; });
  if (begin == "<!doctype html" || begin.starts_with("<html")) {
    refuse("a web page that was downloaded in its place; open it in a browser to see why");
  }
}

std::filesystem::path follow_links(std::filesystem::path path) {
  constexpr int kMostLinks = 40;  // as Linux follows
  std::error_code failed;
  for (int links = 0; links < kMostLinks && std::filesystem::is_symlink(path, failed); ++links) {
    auto next = path.parent_path() / std::filesystem::read_symlink(path, failed);
    // A pipe among /proc's open files leads to no name.
    if (std::filesystem::exists(path, failed) && !std::filesystem::exists(next, failed)) break;
    path = std::move(next);
  }
  return path;
}

void write_file(const std::filesystem::path& path, std::string_view text) {
  // A device or a pipe cannot be replaced by renaming; it is written to directly.
  if (std::filesystem::exists(path) && !std::filesystem::is_regular_file(path)) {
    std::ofstream out(path, std::ios::binary);
    if (!(out << text << std::flush)) throw_system("write", path, errno != 0 ? errno : EIO);
    return;
  }
  TemporaryFile file(follow_links(path));
  file.write(text);
  file.publish();
}

void check_writable(const std::filesystem::path& path) {
  std::error_code failed;
  if (std::filesystem::is_directory(path, failed)) throw_system("write", path, EISDIR);
  if (std::filesystem::exists(path, failed) && !std::filesystem::is_regular_file(path, failed)) {
    return;
  }
  const auto target = follow_links(path);
  remove_left_beside(target);
  // With a name, since a folder may take a file and not such a name.
  const TemporaryFile tried(target, TemporaryFile::Name::kAlways);
}

}  // namespace pirt
