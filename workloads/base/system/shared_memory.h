// Memory of this process and of others that it gives the descriptor of.
#pragma once

#include <cstddef>

#include "workloads/base/system/file_descriptor.h"

namespace pirt {

/// A file in memory, mapped here. Nobody can change its size: using what it lost would be a crash.
class SharedMemory {
 public:
  /// @param bytes  At least 1.
  /// @throws Error{kEnvironment} if there is none.
  SharedMemory(const char* name, std::size_t bytes);
  ~SharedMemory();
  SharedMemory(const SharedMemory&) = delete;
  SharedMemory& operator=(const SharedMemory&) = delete;

  [[nodiscard]] int fd() const { return file_.get(); }
  [[nodiscard]] std::byte* data() const { return data_; }
  [[nodiscard]] std::size_t bytes() const { return bytes_; }

 private:
  FileDescriptor file_;
  std::size_t bytes_;
  std::byte* data_ = nullptr;
};

}  // namespace pirt
