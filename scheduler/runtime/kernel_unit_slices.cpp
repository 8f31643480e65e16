// What a unit's thread does between two slices of a call.
#include <algorithm>
#include <utility>

#include "scheduler/runtime/kernel_unit.h"

namespace pirt {

bool KernelUnit::suspends_calls() const {
  return setup_.slice_ended && setup_.prepare_first && !setup_.contexts && lanes_.size() == 1 &&
         !is_remote();
}

void KernelUnit::let_in(Call& call) {
  lanes_.front().let_in = &call;
  bell_.ring(1);
}

void KernelUnit::go_on() {
  lanes_.front().goes_on = true;
  bell_.ring(1);
}

std::vector<KernelUnit::Suspended> KernelUnit::suspended() {
  const std::lock_guard lock(taking_);
  return lanes_.front().suspended;
}

/// While it asks and is suspended the call does not run, for whoever looks: it does not hang.
void KernelUnit::between_slices_of(Lane& lane) {
  if (stopping_ || abandoned_) return;
  const Nanos since = clock_.now();
  const auto runs = lane.running.seen();
  lane.goes_on = false;
  // Whoever gives it up has done so before this, or sees it no more.
  if (!runs || !lane.running.end()) return;
  Call& call = *runs->call;
  {
    const std::lock_guard lock(taking_);
    lane.suspended.push_back({&call, since - runs->since});
  }
  const Nanos paused = std::exchange(lane.paused, Nanos::zero());
  std::stop_source stop = std::exchange(lane.running.stop, std::stop_source());
  setup_.slice_ended(call);
  while (!lane.goes_on.exchange(false) && !stopping_) {
    if (lane.let_in.load() == nullptr) {
      bell_.sleep_until([&] { return stopping_ || lane.let_in.load() != nullptr || lane.goes_on; });
    } else if (!run_let_in(lane)) {
      return;  // Nobody knows of it either.
    }
  }
  {
    const std::lock_guard lock(taking_);
    lane.suspended.pop_back();
  }
  lane.running.stop = std::move(stop);
  const Nanos suspended_for = clock_.now() - since;
  lane.paused = paused + suspended_for;
  lane.running.begin(call, runs->since + suspended_for);
  if (call.unwanted) lane.running.stop.request_stop();
}

/// False if it was given up.
bool KernelUnit::run_let_in(Lane& lane) {
  Call& call = *lane.let_in.exchange(nullptr);
  CallEnd end;
  if (!run_call(lane, call, end)) return false;
  const bool telling = std::exchange(lane.telling, true);
  done_(call, end);
  lane.telling = telling;
  return true;
}

}  // namespace pirt
