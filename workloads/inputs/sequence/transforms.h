// Where frames of coordinates are in each other, as a recording's transforms say.
#pragma once

#include <map>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "workloads/base/geometry/geometry.h"
#include "workloads/inputs/recording/messages.h"

namespace pirt {

/// What moves is no place of a sensor: of /tf those count that never change and that /tf_static
/// does not say.
class Transforms {
 public:
  void add(const std::vector<TransformMessage>& messages, bool is_static);

  /// By all that were added. Nothing if no transforms lead from one to the other.
  [[nodiscard]] std::optional<Pose> between(const std::string& to, const std::string& from) const;

 private:
  using Parent = std::pair<std::string, Pose>;  ///< And the child in it.
  [[nodiscard]] const Parent* parent_of(const std::string& frame) const;
  [[nodiscard]] Parent root_of(std::string frame) const;

  std::map<std::string, Parent> fixed_, seen_;  ///< Of /tf_static, and the first of /tf.
  std::set<std::string> moving_;
};

}  // namespace pirt
