// Where a call can be left: between two slices its kernel says so, and whoever runs it may run
// another kernel on the same thread before the call goes on. Nothing of it is computed anew, so
// that its bits do not depend on that.
#pragma once

#include <stop_token>

namespace pirt {

class SliceListener {
 public:
  virtual ~SliceListener() = default;
  /// On the call's own thread, which goes on when this returns. Must not throw.
  virtual void slice_ended() = 0;
};

/// As long as it is there, the listener hears of the slices that the calling thread computes; the
/// last one made counts.
class HearsSlices {
 public:
  /// @param listener  Null = nobody does.
  explicit HearsSlices(SliceListener* listener);
  ~HearsSlices();
  HearsSlices(const HearsSlices&) = delete;
  HearsSlices& operator=(const HearsSlices&) = delete;

 private:
  SliceListener* before_;
};

/// For kernels: one slice of the call has ended, and another one follows. No lock may be held, and
/// no other thread wait for this one.
void between_slices();
/// Whether somebody hears of that.
[[nodiscard]] bool are_slices_heard();

/// What says, from now on, that the result of the call that this thread computes is wanted no more.
/// @param stop  Lives until the next one is told; null = nothing does.
void tell_stop_of_call(const std::stop_source* stop);
/// For kernels. A token that never stops where nothing says so.
[[nodiscard]] std::stop_token stop_of_call();

}  // namespace pirt
