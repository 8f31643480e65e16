#include "workloads/inputs/sequence/transforms.h"

#include <set>

#include "workloads/inputs/recording/messages.h"

namespace pirt {
namespace {

/// ROS 1 had frames with a slash in front.
std::string plain_frame(const std::string& frame) {
  return frame.starts_with('/') ? frame.substr(1) : frame;
}

}  // namespace

Transforms::Transforms(const Recording& recording) {
  std::map<std::string, Parent> seen;
  std::set<std::string> moving;
  for (const std::size_t topic : recording.of_type(TransformMessage::kType)) {
    const bool is_static = recording.topics()[topic].name.ends_with("tf_static");
    for (std::size_t i = 0; i < recording.topics()[topic].messages; ++i) {
      const std::string bytes = recording.message(topic, i);
      auto in = recording.reader(topic, i, bytes);
      for (const auto& each : read_transforms(in)) {
        const std::string child = plain_frame(each.child);
        const Parent parent{plain_frame(each.head.frame), each.parent_from_child};
        if (is_static) {
          parents_[child] = parent;
          continue;
        }
        const auto& first = seen.try_emplace(child, parent).first->second;
        const bool same = first.first == parent.first &&
                          first.second.rotation == parent.second.rotation &&
                          first.second.position == parent.second.position;
        if (!same) moving.insert(child);
      }
    }
  }
  for (const auto& [child, parent] : seen) {
    if (!moving.contains(child)) parents_.try_emplace(child, parent);
  }
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
  for (std::size_t steps = 0; steps <= parents_.size(); ++steps) {  // a circle ends, too
    const auto parent = parents_.find(frame);
    if (parent == parents_.end()) break;
    frame = parent->second.first;
    pose = parent->second.second * pose;
  }
  return {frame, pose};
}

}  // namespace pirt
