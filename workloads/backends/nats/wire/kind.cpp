#include <algorithm>

#include "workloads/backends/nats/wire/tensors.h"
#include "workloads/dnn/dnn.h"
#include "workloads/own/definition.h"
#include "workloads/recognition/scene_workload.h"
#include "workloads/recognition/specs.h"
#include "workloads/vision/vision.h"

namespace pirt::cloud {
namespace {

// A picture's; what is larger would be no camera's.
constexpr std::int64_t kLeastSide = 64, kMostSide = 16384;
constexpr std::int64_t kMostPixels = std::int64_t{1} << 26;
// A batch's.
constexpr std::int64_t kLeastImages = 2, kMostImages = 256;

/// As the catalogue names it: fc6@batch8.
std::string batch_suffix(std::int64_t images) { return "batch" + std::to_string(images); }

/// Why no workload of the kind could be made in these sizes; empty if one may.
std::string wrong_sizes(const std::string& kind, std::span<const std::int64_t> sizes) {
  const auto is_side = [](std::int64_t side) { return side >= kLeastSide && side <= kMostSide; };
  if (sizes.size() == 1) {
    const bool right = sizes[0] >= kLeastImages && sizes[0] <= kMostImages;
    return right ? "" : kind + ": no number of images";
  }
  const bool right = sizes.size() == 2 && std::ranges::all_of(sizes, is_side) &&
                     sizes[0] * sizes[1] <= kMostPixels;
  return right ? "" : kind + ": no sizes of a picture";
}

/// @param sizes  Not wrong ones.
std::optional<Workload> made_in(const Workload& kind, std::span<const std::int64_t> sizes) {
  if (sizes.size() == 1) {
    if (!kind.has_tag("dnn") || !kind.variant.empty() || kind.batch > 1) return std::nullopt;
    Workload made = dnn::batched(kind, static_cast<int>(sizes[0]));
    made.variant = batch_suffix(sizes[0]);
    made.name = kind.name + "@" + made.variant;
    return made;
  }
  const int width = static_cast<int>(sizes[0]), height = static_cast<int>(sizes[1]);
  if (const auto* const scene =
          dynamic_cast<const recognition::DescribeByModels*>(kind.operation.get())) {
    return recognition::resized(*scene, width, height);
  }
  if (!kind.at_size) return std::nullopt;
  return kind.at_size(width, height);
}

}  // namespace

Kind kind_of(const Workload& workload) {
  const std::string suffix = batch_suffix(workload.batch);
  if (workload.batch > 1 && workload.variant == suffix && workload.name.ends_with("@" + suffix)) {
    return {workload.name.substr(0, workload.name.size() - suffix.size() - 1), {workload.batch}};
  }
  if (const auto size = own::size_in(workload.name)) {
    return {own::plain_name(workload.name), {size->width, size->height}};
  }
  const Operation* const operation = workload.operation.get();
  if (const auto* const scene = dynamic_cast<const recognition::DescribeByModels*>(operation)) {
    const Workload known =
        recognition::resized(*scene, recognition::kPictureWidth, recognition::kPictureHeight);
    return {.name = workload.name,
            .sizes = {scene->width, scene->height},
            .known_by = spec_digest(known),
            .differs = "other models, or another version of pirt",
            .missing = ": it was given no models (pirt cloud-worker --model)"};
  }
  const auto* const image = dynamic_cast<const vision::ImageOperation*>(operation);
  if (image == nullptr || !workload.variant.empty() || workload.batch > 1) {
    return {.name = workload.name, .known_by = spec_digest(workload)};
  }
  return {workload.name, {image->width, image->height}};
}

Decoded<std::shared_ptr<const Workload>> of_kind(const Workload& known,
                                                 std::span<const std::int64_t> sizes,
                                                 const Digest& spec) {
  const auto refuse = [](std::string why) {
    return Decoded<std::shared_ptr<const Workload>>{std::nullopt, std::move(why)};
  };
  if (spec == spec_digest(known))
    return {std::shared_ptr<const Workload>(std::shared_ptr<void>(), &known), ""};
  if (sizes.empty()) {
    return refuse(known.name + " is something else here: other sizes, or another version of pirt");
  }
  if (std::string problem = wrong_sizes(known.name, sizes); !problem.empty()) {
    return refuse(std::move(problem));
  }
  auto made = made_in(known, sizes);
  if (!made || made->state) return refuse(known.name + ": made in one size only");
  if (spec_digest(*made) != spec) {
    return refuse(known.name + " is something else here: other models, or another version of pirt");
  }
  return {std::make_shared<const Workload>(*std::move(made)), ""};
}

}  // namespace pirt::cloud
