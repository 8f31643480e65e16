// A folder for what a run needs on the way: references, kernel caches.
#pragma once

#include <filesystem>

#include "workloads/base/system/file_descriptor.h"

namespace pirt {

/// TMPDIR, or where the system keeps temporary files.
/// @throws Error{kEnvironment} if that is no folder.
[[nodiscard]] std::filesystem::path scratch_base();

/// Made in scratch_base(); gone with this, and all that is in it. It holds a lock while it lives,
/// by which the next one knows, and removes, what a run that was killed left there.
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
  FileDescriptor lock_;
};

}  // namespace pirt
