#include "characterize/worker/scratch.h"

#include <fcntl.h>
#include <fmt/core.h>
#include <stdlib.h>
#include <sys/file.h>
#include <sys/stat.h>

#include <cerrno>
#include <cstring>
#include <optional>
#include <string>
#include <string_view>

#include "workloads/base/error.h"

namespace pirt {
namespace {

constexpr std::string_view kScratchPrefix = "pirt-scratch-";
constexpr std::string_view kRandom = "XXXXXX";
constexpr const char* kLock = "lock";

/// Removes a folder whose lock is held. The lock goes last: a folder that is found half removed can
/// still be told from one that is being made.
void remove_locked(const std::filesystem::path& folder) {
  std::error_code ignored;
  for (auto it = std::filesystem::directory_iterator(folder, ignored);
       !ignored && it != std::filesystem::directory_iterator(); it.increment(ignored)) {
    if (it->path().filename() == kLock) continue;
    std::error_code failed;
    std::filesystem::remove_all(it->path(), failed);
    if (failed) return;
  }
  std::filesystem::remove(folder / kLock, ignored);
  std::filesystem::remove(folder, ignored);
}

bool is_own_scratch(const std::filesystem::path& path) {
  const std::string name = path.filename().string();
  if (!name.starts_with(kScratchPrefix) || name.size() != kScratchPrefix.size() + kRandom.size())
    return false;
  struct stat status {};
  return ::lstat(path.c_str(), &status) == 0 && S_ISDIR(status.st_mode) &&
         status.st_uid == ::geteuid();
}

/// Removes @p folder if nobody holds its lock. One without a lock is just being made, or was left
/// at that moment: it goes if it is empty, and whoever makes it makes another.
void remove_left(const std::filesystem::path& folder) {
  const FileDescriptor lock(::open((folder / kLock).c_str(), O_RDWR | O_CLOEXEC | O_NOFOLLOW));
  if (lock.get() < 0) {
    if (errno == ENOENT) ::rmdir(folder.c_str());
    return;
  }
  if (::flock(lock.get(), LOCK_EX | LOCK_NB) == 0) remove_locked(folder);
}

void remove_what_was_left(const std::filesystem::path& base) {
  std::error_code ignored;
  for (auto it = std::filesystem::directory_iterator(base, ignored);
       !ignored && it != std::filesystem::directory_iterator(); it.increment(ignored)) {
    if (is_own_scratch(it->path())) remove_left(it->path());
  }
}

/// The lock of a new folder; nothing if somebody who cleans up came first.
/// @throws std::system_error
std::optional<FileDescriptor> lock_new(const std::filesystem::path& folder) {
  FileDescriptor lock(::open((folder / kLock).c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0600));
  if (lock.get() < 0) {
    if (errno == ENOENT) return std::nullopt;
    throw std::system_error(errno, std::generic_category());
  }
  if (::flock(lock.get(), LOCK_EX | LOCK_NB) != 0) {
    if (errno == EWOULDBLOCK) return std::nullopt;
    return lock;  // A file system without locks: then nobody can take this one either.
  }
  struct stat status {};
  if (::fstat(lock.get(), &status) != 0 || status.st_nlink == 0) return std::nullopt;
  return lock;
}

[[noreturn]] void throw_cannot_make(const std::string& where, const std::string& why) {
  throw_environment(
      fmt::format("cannot make a scratch folder in '{}': {}; set TMPDIR to a folder that can be "
                  "written and has space",
                  where, why));
}

}  // namespace

std::filesystem::path scratch_base() {
  std::error_code failed;
  auto base = std::filesystem::temp_directory_path(failed);
  if (!failed) return base;
  const char* const set = ::getenv("TMPDIR");
  throw_cannot_make(set != nullptr ? set : "/tmp", failed.message());
}

ScratchFolder::ScratchFolder() {
  const auto base = scratch_base();
  remove_what_was_left(base);
  while (lock_.get() < 0) {
    std::string name = (base / kScratchPrefix).string() + std::string(kRandom);
    if (::mkdtemp(name.data()) == nullptr) throw_cannot_make(base.string(), std::strerror(errno));
    try {
      if (auto lock = lock_new(name)) lock_ = std::move(*lock);
    } catch (const std::system_error& error) {
      ::rmdir(name.c_str());
      throw_cannot_make(base.string(), error.code().message());
    }
    path_ = name;
  }
}

ScratchFolder::~ScratchFolder() { remove_locked(path_); }

}  // namespace pirt
