#include "workloads/model/slices.h"

#include <utility>

namespace pirt {
namespace {

thread_local SliceListener* listener_here = nullptr;
thread_local const std::stop_source* stop_here = nullptr;

}  // namespace

HearsSlices::HearsSlices(SliceListener* listener)
    : before_(std::exchange(listener_here, listener)) {}

HearsSlices::~HearsSlices() { listener_here = before_; }

void between_slices() {
  if (listener_here != nullptr) listener_here->slice_ended();
}

bool are_slices_heard() { return listener_here != nullptr; }

void tell_stop_of_call(const std::stop_source* stop) { stop_here = stop; }

std::stop_token stop_of_call() {
  return stop_here != nullptr ? stop_here->get_token() : std::stop_token();
}

}  // namespace pirt
