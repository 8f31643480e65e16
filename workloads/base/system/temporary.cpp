#include "workloads/base/system/temporary.h"

#include <fcntl.h>
#include <fmt/core.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <string>
#include <system_error>
#include <tuple>
#include <utility>
#include <vector>

#include "workloads/base/error.h"

namespace pirt {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kMark = ".pirt-tmp-";

fs::path folder_of(const fs::path& path) {
  return path.has_parent_path() ? path.parent_path() : fs::path(".");
}

/// The @p i th name of this process beside @p target.
fs::path name_beside(fs::path target, int i) {
  target += fmt::format("{}{}-{}", kMark, ::getpid(), i);
  return target;
}

/// Whether @p name is one of name_beside(), of whatever process.
bool is_beside(std::string_view name, std::string_view target) {
  if (!name.starts_with(target) || !name.substr(target.size()).starts_with(kMark)) return false;
  const auto numbers = name.substr(target.size() + kMark.size());
  return !numbers.empty() && numbers.find_first_not_of("0123456789-") == std::string_view::npos;
}

[[noreturn]] void throw_cannot_write(const fs::path& path, int error) {
  // A file that may be written is not enough: what is complete takes its name.
  const fs::path folder = path.has_parent_path() ? path.parent_path() : fs::path(".");
  const bool takes_none = error == EACCES && ::access(folder.c_str(), W_OK | X_OK) != 0;
  throw_bad_input(
      fmt::format("cannot write '{}': {}", path.string(),
                  takes_none ? fmt::format("its folder '{}' takes no new file", folder.string())
                             : std::strerror(error)));
}

/// Says that the owner of @p fd lives, until it is closed; false if somebody who removes what was
/// left holds it. Where a file system has no locks, nobody can take this one either.
bool lock(int fd) { return ::flock(fd, LOCK_EX | LOCK_NB) == 0 || errno != EWOULDBLOCK; }

bool leads_to(const fs::path& path, int fd) {
  struct stat named {};
  struct stat open {};
  return ::lstat(path.c_str(), &named) == 0 && ::fstat(fd, &open) == 0 &&
         named.st_dev == open.st_dev && named.st_ino == open.st_ino;
}

/// Under the first name that is free.
/// @param make  Opens what it makes under a name; below 0 with errno if it cannot.
template <typename Make>
std::pair<fs::path, FileDescriptor> make_locked(const fs::path& target, const Make& make) {
  constexpr int kMostTries = 1000;
  for (int i = 0; i < kMostTries; ++i) {
    auto name = name_beside(target, i);
    FileDescriptor made(make(name));
    if (made.get() >= 0 && lock(made.get()) && leads_to(name, made.get())) {
      return {std::move(name), std::move(made)};
    }
    if (made.get() < 0 && errno != EEXIST) throw_cannot_write(target, errno);
  }
  throw_cannot_write(target, EEXIST);
}

/// Open, without a name; below 0 where there is none of that kind, or no way to name it later.
FileDescriptor make_nameless(const fs::path& target) {
  FileDescriptor made(::open(folder_of(target).c_str(), O_TMPFILE | O_RDWR | O_CLOEXEC, 0666));
  const auto link = fmt::format("/proc/self/fd/{}", made.get());
  if (made.get() >= 0 && ::access(link.c_str(), F_OK) == 0 && lock(made.get())) return made;
  return {};
}

}  // namespace

TemporaryFile::TemporaryFile(fs::path target, Name name) : target_(std::move(target)) {
  FileDescriptor made;
  if (name == Name::kNoneIfPossible) made = make_nameless(target_);
  if (made.get() < 0) {
    std::tie(name_, made) = make_locked(target_, [](const fs::path& path) {
      return ::open(path.c_str(), O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
    });
  }
  file_.reset(::fdopen(made.get(), "w+b"));
  if (!file_) {
    const int error = errno;
    if (!name_.empty()) ::unlink(name_.c_str());
    fail(error);
  }
  static_cast<void>(made.release());
  std::setvbuf(file_.get(), nullptr, _IOFBF, 1 << 16);
}

TemporaryFile::~TemporaryFile() {
  if (!name_.empty()) ::unlink(name_.c_str());
}

void TemporaryFile::write(std::string_view bytes) {
  if (error_ != 0) return;
  if (std::fwrite(bytes.data(), 1, bytes.size(), file_.get()) != bytes.size()) error_ = errno;
}

void TemporaryFile::append(TemporaryFile& other) {
  other.flush();
  std::rewind(other.file_.get());
  std::array<char, 1 << 16> buffer{};
  while (const auto got = std::fread(buffer.data(), 1, buffer.size(), other.file_.get())) {
    write({buffer.data(), got});
  }
  if (std::ferror(other.file_.get()) != 0) fail(EIO);
}

void TemporaryFile::publish() {
  flush();
  for (int i = 0; name_.empty(); ++i) {
    auto name = name_beside(target_, i);
    const int error = link_to(name);
    if (error == 0) name_ = std::move(name);
    if (error != 0 && error != EEXIST) fail(error);
  }
  if (::rename(name_.c_str(), target_.c_str()) != 0) fail(errno);
  name_.clear();
}

void TemporaryFile::publish_if_new() {
  flush();
  const int error = link_to(target_);
  if (error == 0 || error == EEXIST) return;
  std::error_code ignored;
  if (fs::exists(fs::symlink_status(target_, ignored))) return;
  if (name_.empty()) fail(error);
  publish();  // File systems without hard links (FAT).
}

void TemporaryFile::fail(int error) const { throw_cannot_write(target_, error); }

void TemporaryFile::check_written() {
  try {
    flush();
  } catch (const Error& error) {
    throw_environment(error.what());
  }
}

void TemporaryFile::flush() {
  if (std::fflush(file_.get()) != 0 && error_ == 0) error_ = errno;
  if (error_ != 0) fail(error_);
}

int TemporaryFile::link_to(const fs::path& name) const {
  const auto open =
      name_.empty() ? fs::path(fmt::format("/proc/self/fd/{}", ::fileno(file_.get()))) : name_;
  const int flags = name_.empty() ? AT_SYMLINK_FOLLOW : 0;
  return ::linkat(AT_FDCWD, open.c_str(), AT_FDCWD, name.c_str(), flags) == 0 ? 0 : errno;
}

TemporaryFolder::TemporaryFolder(fs::path target) : target_(std::move(target)) {
  std::tie(path_, lock_) = make_locked(target_, [](const fs::path& path) {
    if (::mkdir(path.c_str(), 0777) != 0) return -1;
    return ::open(path.c_str(), O_RDONLY | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC);
  });
}

TemporaryFolder::~TemporaryFolder() {
  std::error_code ignored;
  if (!path_.empty()) fs::remove_all(path_, ignored);
}

void TemporaryFolder::publish() {
  if (::rename(path_.c_str(), target_.c_str()) != 0) throw_cannot_write(target_, errno);
  path_.clear();
}

void remove_left_beside(const fs::path& target) {
  std::error_code ignored;
  std::vector<fs::path> found;
  for (auto it = fs::directory_iterator(folder_of(target), ignored);
       !ignored && it != fs::directory_iterator(); it.increment(ignored)) {
    if (is_beside(it->path().filename().string(), target.filename().string())) {
      found.push_back(it->path());
    }
  }
  for (const auto& path : found) {
    // Where locks are the server's (NFS), only what may be written can be locked.
    constexpr int kFlags = O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC;
    FileDescriptor left(::open(path.c_str(), O_RDWR | kFlags));
    if (left.get() < 0 && errno == EISDIR) {
      left = FileDescriptor(::open(path.c_str(), O_RDONLY | O_DIRECTORY | kFlags));
    }
    if (left.get() < 0 || ::flock(left.get(), LOCK_EX | LOCK_NB) != 0) continue;
    if (leads_to(path, left.get())) fs::remove_all(path, ignored);
  }
}

}  // namespace pirt
