// A folder for what a run needs on the way: references, kernel caches.
#pragma once

#include <filesystem>

namespace pirt {

/// Made in TMPDIR; gone with this, and all that is in it.
class ScratchFolder {
 public:
  /// @throws Error{kEnvironment} if it cannot be made.
  ScratchFolder();
  ~ScratchFolder();
  ScratchFolder(const ScratchFolder&) = delete;
  ScratchFolder& operator=(const ScratchFolder&) = delete;
  [[nodiscard]] const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

}  // namespace pirt
