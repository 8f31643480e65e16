// What an output is until it is complete: a file or a folder beside it that takes its name in one
// step, so that nothing is ever half written. It goes with the process, whatever ends that: a file
// has no name until then where the file system allows it (O_TMPFILE). What has a name is locked
// while its process lives, so that the next one can tell what was left and remove it.
#pragma once

#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <string_view>

#include "workloads/base/system/file_descriptor.h"

namespace pirt {

class TemporaryFile {
 public:
  enum class Name : std::uint8_t { kNoneIfPossible, kAlways };

  /// @param target  What it is to become; no link. Another file there stays until publish().
  /// @throws Error{kBadInput} if nothing can be written there.
  explicit TemporaryFile(std::filesystem::path target, Name name = Name::kNoneIfPossible);
  /// Leaves nothing behind unless published.
  ~TemporaryFile();
  TemporaryFile(const TemporaryFile&) = delete;
  TemporaryFile& operator=(const TemporaryFile&) = delete;

  // A write that fails shows when it is published or flushed; nothing is written after it.

  void write(std::string_view bytes);
  /// All that was written to @p other, which is not written to any more.
  void append(TemporaryFile& other);

  /// All of it is with the system by now, and survives the process if it has its name.
  /// @throws Error{kBadInput} if something could not be written.
  void flush();
  /// The same, for those to whom it is the disk's fault.
  /// @throws Error{kEnvironment} if something could not be written: the disk is full.
  void check_written();
  /// Puts it where the target is. What is written afterwards is there once it is flushed.
  /// @throws Error{kBadInput} if something could not be written; the target is then as it was.
  void publish();
  /// The same, unless something has the target's name by now: that stays.
  void publish_if_new();

 private:
  [[noreturn]] void fail(int error) const;
  /// @return  The system's error, 0 = none.
  [[nodiscard]] int link_to(const std::filesystem::path& name) const;

  std::filesystem::path target_, name_;  ///< No name = it has none.
  struct Close {
    void operator()(std::FILE* file) const { std::fclose(file); }
  };
  std::unique_ptr<std::FILE, Close> file_;
  int error_ = 0;  ///< Of the first write that failed.
};

class TemporaryFolder {
 public:
  /// @throws Error{kBadInput} if none can be made there.
  explicit TemporaryFolder(std::filesystem::path target);
  /// Removes it with all that is in it unless published.
  ~TemporaryFolder();
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;

  [[nodiscard]] const std::filesystem::path& path() const { return path_; }
  /// Gives it the target's name. An empty folder of that name goes.
  /// @throws Error{kBadInput} if something else is there.
  void publish();

 private:
  std::filesystem::path target_, path_;
  FileDescriptor lock_;
};

/// Removes what processes that are gone left beside @p target on its behalf. What cannot be removed
/// stays without a word: somebody else's, or a file system without locks.
void remove_left_beside(const std::filesystem::path& target);

}  // namespace pirt
