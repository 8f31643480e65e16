// Whether one more call keeps a cap on the joules of any second.
//
// A call counts whole from its start to a second after its end: all that could fall into a second
// that ends now, or later, is then counted, however it is spread. So the cap holds, and what lasts
// long is counted for more than it draws.
#pragma once

#include <deque>
#include <utility>

#include "scheduler/services/call_plan.h"
#include "workloads/base/time.h"

namespace pirt {

class PowerWindow {
 public:
  explicit PowerWindow(double most_j) : most_j_(most_j) {}

  [[nodiscard]] bool allows(double call_j, Nanos now) {
    forget(now);
    // What was added and taken away again leaves some rounding.
    return running_j_ + ended_j_ + call_j <= most_j_ * (1 + 1e-12) + 1e-12;
  }
  void started(double call_j) {
    running_j_ += call_j;
    ++running_;
  }
  void ended(double call_j, Nanos now) {
    running_j_ = --running_ == 0 ? 0 : running_j_ - call_j;
    ended_.emplace_back(now, call_j);
    ended_j_ += call_j;
  }
  /// When the next call that has ended counts no more; Nanos::max() = none has.
  [[nodiscard]] Nanos next() const {
    return ended_.empty() ? Nanos::max() : ended_.front().first + kPowerWindow + Nanos(1);
  }

 private:
  void forget(Nanos now) {
    while (!ended_.empty() && ended_.front().first + kPowerWindow < now) {
      ended_j_ -= ended_.front().second;
      ended_.pop_front();
    }
    if (ended_.empty()) ended_j_ = 0;
  }

  double most_j_;
  double running_j_ = 0, ended_j_ = 0;
  int running_ = 0;
  std::deque<std::pair<Nanos, double>> ended_;
};

}  // namespace pirt
