#include "scheduler/robot/read_ahead.h"

#include <utility>

#include "workloads/base/system/thread.h"

namespace pirt {
namespace {

/// Frames that are kept for who comes late.
constexpr std::size_t kMostReady = 2;

}  // namespace

ReadAhead::ReadAhead(std::size_t frames, Read read, bool gives_way)
    : thread_(start_thread(
          [this, frames, read = std::move(read), gives_way](const std::stop_token& stop) {
            name_thread("pirt-pictures");
            if (gives_way) give_way();
            read_all(stop, frames, read);
          })) {}

void ReadAhead::read_all(const std::stop_token& stop, std::size_t frames, const Read& read) {
  for (std::size_t frame = 0; frame < frames && !stop.stop_requested(); ++frame) {
    Pictures pictures;
    try {
      pictures = read(frame);
    } catch (...) {
      pictures.failure = std::current_exception();
    }
    std::unique_lock lock(mutex_);
    if (!changed_.wait(lock, stop, [this] { return ready_.size() < kMostReady; })) return;
    ready_.push_back(std::move(pictures));
    changed_.notify_all();
  }
}

ReadAhead::Pictures ReadAhead::next() {
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [this] { return !ready_.empty(); });
  Pictures pictures = std::move(ready_.front());
  ready_.pop_front();
  changed_.notify_all();
  if (pictures.failure != nullptr) std::rethrow_exception(pictures.failure);
  return pictures;
}

}  // namespace pirt
