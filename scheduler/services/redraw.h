// What calls would take if what was measured of them were a little else, within what is known of
// it.
//
// One factor a cell, for all phases and conditions of it, drawn so that its 95 % interval is the
// row's own, and one for the joules that a meter showed, likewise; where other programs took the
// cores, one a unit more, common to its rows, since they took them from all of these. No bootstrap
// of the samples: of 2 to 4 processes it covers too little (characterize/statistics/statistics.h).
#pragma once

#include "scheduler/services/services.h"

namespace pirt {

struct Redraw {
  enum class Kind : std::uint8_t {
    kDrawn,     ///< By a number: the same gives the same factors, whatever the mode.
    kShortest,  ///< All calls at the lower ends of their intervals,
    kLongest,   ///< or at the upper ones.
  };
  Kind kind = Kind::kDrawn;
  int number = 0;
};
void redraw(const Platform& platform, const Redraw& how, ServiceTable& services);

/// Whether anything about them is uncertain by more than a part in a thousand.
[[nodiscard]] bool is_uncertain(const ServiceTable& services);

/// How many redrawn profiles tell 2.5 and 97.5 %.
inline constexpr int kRedraws = 40;

}  // namespace pirt
