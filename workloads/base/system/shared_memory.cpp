#include "workloads/base/system/shared_memory.h"

#include <fcntl.h>
#include <fmt/core.h>
#include <sys/mman.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

#include "workloads/base/error.h"

namespace pirt {

SharedMemory::SharedMemory(const char* name, std::size_t bytes)
    : file_(::memfd_create(name, MFD_CLOEXEC | MFD_ALLOW_SEALING)), bytes_(bytes) {
  void* place = MAP_FAILED;
  if (fd() >= 0 && ::ftruncate(fd(), static_cast<off_t>(bytes)) == 0 &&
      ::fcntl(fd(), F_ADD_SEALS, F_SEAL_SHRINK | F_SEAL_GROW | F_SEAL_SEAL) == 0) {
    place = ::mmap(nullptr, bytes, PROT_READ | PROT_WRITE, MAP_SHARED, fd(), 0);
  }
  if (place == MAP_FAILED) {
    throw_environment(fmt::format(
        "cannot share {} bytes of memory: {}; check the limits on memory and open files", bytes,
        std::strerror(errno)));
  }
  data_ = static_cast<std::byte*>(place);
}

SharedMemory::~SharedMemory() { ::munmap(data_, bytes_); }

}  // namespace pirt
