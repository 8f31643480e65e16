#include "workloads/inputs/sequence/transforms.h"

namespace pirt {
namespace {

/// ROS 1 had frames with a slash in front.
std::string plain_frame(const std::string& frame) {
  return frame.starts_with('/') ? frame.substr(1) : frame;
}

}  // namespace

void Transforms::add(const std::vector<TransformMessage>& messages, bool is_static) {
  for (const auto& each : messages) {
    const std::string child = plain_frame(each.child);
    const Parent parent{plain_frame(each.head.frame), each.parent_from_child};
    if (is_static) {
      fixed_[child] = parent;
      continue;
    }
    const auto& first = seen_.try_emplace(child, parent).first->second;
    const bool same = first.first == parent.first &&
                      first.second.rotation == parent.second.rotation &&
                      first.second.position == parent.second.position;
    if (!same) moving_.insert(child);
  }
}

const Transforms::Parent* Transforms::parent_of(const std::string& frame) const {
  const auto fixed = fixed_.find(frame);
  if (fixed != fixed_.end()) return &fixed->second;
  const auto seen = seen_.find(frame);
  return seen == seen_.end() || moving_.contains(frame) ? nullptr : &seen->second;
}

std::optional<Pose> Transforms::between(const std::string& to, const std::string& from) const {
  if (plain_frame(to) == plain_frame(from)) return Pose{};
  const auto [to_root, root_from_to] = root_of(plain_frame(to));
  const auto [from_root, root_from_from] = root_of(plain_frame(from));
  if (to_root != from_root) return std::nullopt;
  return root_from_to.inverse() * root_from_from;
}

Transforms::Parent Transforms::root_of(std::string frame) const {
  Pose pose;
  // A circle ends, too.
  for (std::size_t steps = 0; steps <= fixed_.size() + seen_.size(); ++steps) {
    const Parent* const parent = parent_of(frame);
    if (parent == nullptr) break;
    pose = parent->second * pose;
    frame = parent->first;
  }
  return {frame, pose};
}

}  // namespace pirt
