// Recognition with boxes and words as workloads: what their tensors mean.
#pragma once

#include <span>
#include <vector>

#include "workloads/model/workload.h"
#include "workloads/recognition/detector_outputs.h"
#include "workloads/recognition/specs.h"

namespace pirt::recognition {

/// What a kernel of detect_objects writes for what its network is sure of: overlaps suppressed,
/// boxes in pixels. @param outputs  boxes, scores and classes.
void write_objects(std::vector<Candidate> candidates, std::span<Tensor> outputs);
/// The least score that it is sure of.
[[nodiscard]] double least_score();

/// Kernel and workload have the same name; both are functions of the host (host_function.h), by
/// OpenCV's dnn with generated networks of seeded weights: what they see means nothing, and takes
/// the time. A user's model has other tensors; pirt describe runs it.
/// - "detect_objects": input image u8 [3,480,640] (R, G, B), parameter weights f32 [..] of the
///   generated detector. Outputs the lists boxes f32 [<=1200,4] (x, y, width, height in pixels),
///   scores f32 [<=1200] and classes i32 [<=1200], highest score first. The weights are such that
///   it is sure of 12 boxes of its own picture, overlapping ones among them.
/// - "describe_scene": the same detector and a classifier, whose weights are a second parameter.
///   Besides, outputs labels i32 [5] and label_scores f32 [5], the best classes of the picture.
///
/// Verified against convolutions in double precision: the same boxes and classes, coordinates to
/// 1e-4 of the largest, scores to 1e-4.
[[nodiscard]] std::vector<Workload> all();

}  // namespace pirt::recognition
