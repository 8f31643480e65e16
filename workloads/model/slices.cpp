#include "workloads/model/slices.h"

#include <utility>

namespace pirt {
namespace {

thread_local SliceListener* listener_here = nullptr;

}  // namespace

HearsSlices::HearsSlices(SliceListener* listener)
    : before_(std::exchange(listener_here, listener)) {}

HearsSlices::~HearsSlices() { listener_here = before_; }

void between_slices() {
  if (listener_here != nullptr) listener_here->slice_ended();
}

bool are_slices_heard() { return listener_here != nullptr; }

}  // namespace pirt
