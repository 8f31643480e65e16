// A file of which parts are read, wherever they are; of any thread.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

#include "workloads/base/system/file_descriptor.h"

namespace pirt {

class RandomFile {
 public:
  /// @throws Error{kBadInput} if it cannot be read, is empty, or a pointer of Git LFS.
  explicit RandomFile(const std::filesystem::path& file);

  [[nodiscard]] std::uint64_t size() const { return size_; }
  /// @throws Error{kBadInput} if it ends before that.
  [[nodiscard]] std::string read(std::uint64_t at, std::uint64_t count) const;

 private:
  std::string name_;
  FileDescriptor fd_;
  std::uint64_t size_ = 0;
};

/// A chunk is some hundred kilobytes; what says that it is more than this is damaged. Packed and
/// unpacked, with those that are kept, it takes twice as much and a little.
inline constexpr std::uint64_t kMostChunkBytes = std::uint64_t{96} << 20;

/// What was unpacked last: messages are asked for one after the other, of a few topics.
class ChunkCache {
 public:
  using Content = std::shared_ptr<const std::string>;
  template <typename Unpack>
  [[nodiscard]] Content get(std::uint64_t chunk, const Unpack& unpack) {
    const std::lock_guard lock(mutex_);
    for (std::size_t i = 0; i < kept_.size(); ++i) {
      if (kept_[i].first == chunk) return kept_[i].second;
    }
    auto content = std::make_shared<const std::string>(unpack());
    bytes_ += content->size();
    while (!kept_.empty() && bytes_ > kMostBytes) {
      bytes_ -= kept_.front().second->size();
      kept_.erase(kept_.begin());
    }
    kept_.emplace_back(chunk, content);
    return content;
  }

 private:
  static constexpr std::size_t kMostBytes = std::size_t{32} << 20;

  std::mutex mutex_;
  std::vector<std::pair<std::uint64_t, Content>> kept_;  ///< The oldest first.
  std::size_t bytes_ = 0;
};

}  // namespace pirt
