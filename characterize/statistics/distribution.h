// How long a stage takes: always the same, anything in a range, or what was measured.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "workloads/base/time.h"

namespace pirt {

/// A duration that is constant or drawn.
struct Distribution {
  enum class Kind : std::uint8_t {
    kConstant,
    kUniform,
    kSamples,  ///< Each of the samples alike.
  };
  Kind kind = Kind::kConstant;
  Nanos low{0};   ///< The value, if constant.
  Nanos high{0};  ///< Equal to low, if constant; inclusive.
  std::shared_ptr<const std::vector<Nanos>> samples = {};  ///< Of kSamples; shared by its copies.

  [[nodiscard]] static Distribution constant(Nanos value) { return {.low = value, .high = value}; }
  /// @param samples  At least one.
  [[nodiscard]] static Distribution of(std::vector<Nanos> samples);

  [[nodiscard]] Nanos mean() const;
  /// The same number gives the same duration.
  /// @param random  Evenly spread over 64 bits.
  [[nodiscard]] Nanos draw(std::uint64_t random) const;
  friend bool operator==(const Distribution&, const Distribution&) = default;
};

}  // namespace pirt
