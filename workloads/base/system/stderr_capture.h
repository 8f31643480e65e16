// What libraries write to the standard error stream because they give no other way to hear of it.
#pragma once

#include <sys/mman.h>
#include <unistd.h>

#include <array>
#include <cstdio>
#include <string>

namespace pirt {

/// Takes what is written to the standard error stream while it lives. The process's other threads
/// must be quiet meanwhile.
class StderrCapture {
 public:
  StderrCapture() : saved_(dup(STDERR_FILENO)), memory_(memfd_create("stderr", MFD_CLOEXEC)) {
    std::fflush(stderr);
    if (saved_ >= 0 && memory_ >= 0) dup2(memory_, STDERR_FILENO);
  }
  StderrCapture(const StderrCapture&) = delete;
  StderrCapture& operator=(const StderrCapture&) = delete;
  ~StderrCapture() {
    std::fflush(stderr);
    if (saved_ >= 0) dup2(saved_, STDERR_FILENO);
    if (saved_ >= 0) close(saved_);
    if (memory_ >= 0) close(memory_);
  }

  /// Its beginning, at most 4 KiB.
  [[nodiscard]] std::string text() const {
    std::fflush(stderr);
    std::array<char, 4096> buffer{};
    const auto size = pread(memory_, buffer.data(), buffer.size(), 0);
    return size > 0 ? std::string(buffer.data(), static_cast<std::size_t>(size)) : "";
  }

 private:
  int saved_;
  int memory_;
};

}  // namespace pirt
