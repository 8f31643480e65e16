// A file of which parts are read, wherever they are; of any thread.
#pragma once

#include <cstdint>
#include <deque>
#include <exception>
#include <filesystem>
#include <functional>
#include <memory>
#include <mutex>
#include <string>

#include "workloads/base/error.h"
#include "workloads/base/system/file_descriptor.h"

namespace pirt {

class RandomFile {
 public:
  /// @throws Error{kBadInput} if it cannot be read, is empty, or a pointer of Git LFS.
  /// @param name  For messages; empty = the file's.
  explicit RandomFile(const std::filesystem::path& file, std::string name = {});

  [[nodiscard]] std::uint64_t size() const { return size_; }
  /// @throws Error{kBadInput} if it ends before that.
  [[nodiscard]] std::string read(std::uint64_t at, std::uint64_t count) const;
  /// The same piece by piece; for as long as this is there.
  [[nodiscard]] std::function<std::string(std::size_t most)> pieces(std::uint64_t at,
                                                                    std::uint64_t count) const;

 private:
  std::string name_;
  FileDescriptor fd_;
  std::uint64_t size_ = 0;
};

/// A chunk is some hundred kilobytes; what says that it is more than this is damaged.
inline constexpr std::uint64_t kMostChunkBytes = std::uint64_t{96} << 20;

/// What was unpacked last, or was damaged, of all parts of a recording. Messages are asked for one
/// after the other, of a few topics: first of all pictures their heads, which have the stamps, then
/// picture by picture. What is no larger unpacked than the largest chunk is unpacked once; more is
/// unpacked for either, since what was kept until then would have no end.
class ChunkCache {
 public:
  using Content = std::shared_ptr<const std::string>;
  /// @param file   Whose chunk it is.
  /// @param chunk  Of the same file always the same one.
  /// @param bytes  What it takes, up to kMostChunkBytes: it is made room for before.
  template <typename Unpack>
  [[nodiscard]] Content get(const void* file, std::uint64_t chunk, std::uint64_t bytes,
                            const Unpack& unpack) {
    const std::lock_guard lock(mutex_);
    for (const Kept& each : kept_) {
      if (each.chunk == chunk && each.file == file) return content_of(each);
    }
    while (!kept_.empty() && bytes_ + bytes > kMostChunkBytes) {
      bytes_ -= kept_.front().content->size();
      kept_.pop_front();
    }
    Kept made{file, chunk, nullptr, nullptr};
    try {
      made.content = std::make_shared<const std::string>(unpack());
    } catch (const Error&) {  // or each of its messages would find it out
      made.content = std::make_shared<const std::string>();
      made.failure = std::current_exception();
    }
    bytes_ += made.content->size();
    kept_.push_back(made);
    return content_of(made);
  }

 private:
  struct Kept {
    const void* file;
    std::uint64_t chunk;
    Content content;
    std::exception_ptr failure;  ///< Null = it was whole.
  };
  [[nodiscard]] static Content content_of(const Kept& kept) {
    if (kept.failure != nullptr) std::rethrow_exception(kept.failure);
    return kept.content;
  }
  std::mutex mutex_;
  std::deque<Kept> kept_;  ///< The oldest first.
  std::size_t bytes_ = 0;
};

/// How a file of a recording is opened.
struct Opening {
  /// For messages; empty = the file's. What was packed as a whole has another than its file.
  std::string name = {};
  std::shared_ptr<ChunkCache> unpacked = std::make_shared<ChunkCache>();  ///< Of all parts.
};

}  // namespace pirt
