// Describing scenes by models of a user's own, as a workload: what it computes is in files, so that
// whoever computes it elsewhere has to have the same.
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "workloads/model/host_function.h"
#include "workloads/recognition/model.h"

namespace pirt::recognition {

struct SceneModels {
  ModelOptions detector;
  std::optional<ModelOptions> classifier = {};  ///< None: no labels.
};

struct DescribeByModels : HostFunction {
  int width = 0, height = 0;  ///< Of the pictures.
  SceneModels models;
  std::string fingerprint;  ///< All that a description follows from but the picture.
};

/// "describe": input image u8 [3,height,width] (R, G, B) and the list name u8 [<=32], output the
/// list text u8 [<=2^18], a line of JSON as to_json(Scene) has it. A kernel of it opens the models.
/// @throws Error{kBadInput} as Model, for what shows without opening them.
[[nodiscard]] Workload make_describe(const SceneModels& models, int width, int height);
/// The same for pictures of another size.
[[nodiscard]] Workload resized(const DescribeByModels& operation, int width, int height);

/// What a kernel of make_describe() calls, after it has described a blank picture.
/// @throws Error{kBadInput} for models that are none, or do not detect or classify.
[[nodiscard]] KernelFunction open_described(const Workload& describe);

/// Of tensors that hold a text.
[[nodiscard]] std::string text_of(const Tensor& tensor);
/// @throws Error{kBadInput} if it is too long.
void set_text(Tensor& tensor, std::string_view text);

}  // namespace pirt::recognition
