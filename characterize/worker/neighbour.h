// What keeps the cores of another unit busy while one is measured.
#pragma once

#include <cstdint>
#include <thread>
#include <vector>

namespace pirt {

/// A thread on each of some cores, until this goes.
class Neighbour {
 public:
  enum class Work : std::uint8_t {
    kStreams,   ///< Reads and writes more bytes than the cores' own caches hold, again and again.
    kComputes,  ///< Multiplies and adds what registers hold.
  };
  /// Returns once all are at it.
  /// @throws Error{kEnvironment} if a core may not be used, or a thread not be started.
  Neighbour(const std::vector<int>& cores, Work work);

 private:
  std::vector<std::jthread> threads_;
};

}  // namespace pirt
