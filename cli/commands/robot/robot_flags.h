// What pirt run-robot does besides localizing: its options, and what they come to.
#pragma once

#include <optional>
#include <string>

#include "cli/options/models.h"
#include "cli/options/output.h"
#include "scheduler/robot/activities.h"
#include "workloads/inputs/sequence/sequence.h"

namespace pirt::cli {

struct ActivityFlags {
  std::optional<std::string> map, goal, start;
  ModelFlags model, classifier;
  Output scenes;  ///< Of what a user's detector sees.
  bool localize_only = false, keep_map = false;

  /// @param dataset  Its folder, whose map.yaml and goal.yaml are the defaults.
  /// @return  Nothing where there is no map and no model, or nothing else is wanted.
  [[nodiscard]] std::optional<ActivityOptions> options(const std::string& dataset,
                                                       const Sequence& sequence) const;
};

void add_activities(Command& command, ActivityFlags& flags);

}  // namespace pirt::cli
