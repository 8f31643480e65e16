// The pictures of a sequence, read by a thread of its own ahead of whoever takes them.
#pragma once

#include <condition_variable>
#include <cstddef>
#include <deque>
#include <exception>
#include <functional>
#include <mutex>
#include <thread>

#include "workloads/model/grey_image.h"

namespace pirt {

class ReadAhead {
 public:
  struct Pictures {
    GreyImage left, right;  ///< Empty: there is none.
    std::exception_ptr failure = nullptr;
  };
  using Read = std::function<Pictures(std::size_t frame)>;

  /// @param read       Of frames 0, 1, ... to @p frames, one after the other.
  /// @param gives_way  To other threads: what computes does not wait for what it needs later.
  /// @throws Error{kEnvironment} if the thread cannot be started.
  ReadAhead(std::size_t frames, Read read, bool gives_way);
  /// Waits for the frame that is being read.
  ~ReadAhead() = default;
  ReadAhead(const ReadAhead&) = delete;
  ReadAhead& operator=(const ReadAhead&) = delete;

  /// Of the next frame, of which there must be one. @throws What reading it threw.
  [[nodiscard]] Pictures next();

 private:
  void read_all(const std::stop_token& stop, std::size_t frames, const Read& read);

  std::mutex mutex_;
  std::condition_variable_any changed_;
  std::deque<Pictures> ready_;
  std::jthread thread_;  ///< Last: it uses the rest.
};

}  // namespace pirt
