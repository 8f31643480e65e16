// Where frames of coordinates are in each other, as a recording's transforms say.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <utility>

#include "workloads/base/geometry/geometry.h"
#include "workloads/inputs/recording/recording.h"

namespace pirt {

/// What moves is no place of a sensor: of /tf those count that never change and that /tf_static
/// does not say.
class Transforms {
 public:
  explicit Transforms(const Recording& recording);

  /// Nothing if no transforms lead from one to the other.
  [[nodiscard]] std::optional<Pose> between(const std::string& to, const std::string& from) const;

 private:
  using Parent = std::pair<std::string, Pose>;  ///< And the child in it.
  [[nodiscard]] Parent root_of(std::string frame) const;

  std::map<std::string, Parent> parents_;
};

}  // namespace pirt
