// Inputs that nobody else gives, and the parameters: of each workload its recorded sequence.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "workloads/inputs/pictures/images.h"
#include "workloads/model/workload.h"

namespace pirt {

/// Used by one thread at a time.
class Samples {
 public:
  explicit Samples(std::uint64_t seed) : seed_(seed), images_(generated_images(seed)) {}

  /// Which frame of the sequence it is.
  [[nodiscard]] static std::uint64_t frame(const Workload& workload, std::uint64_t firing) {
    return firing % static_cast<std::uint64_t>(workload.frames);
  }
  /// Made when it is first asked for.
  /// @param firing  Number of the firing.
  const std::shared_ptr<const Data>& of(const Workload& workload, std::uint64_t firing) {
    auto& frames = frames_[&workload];
    frames.resize(static_cast<std::size_t>(workload.frames));
    const auto number = frame(workload, firing);
    auto& data = frames[number];
    if (data == nullptr) {
      data = std::make_shared<const Data>(workload.make_data(
          {.seed = seed_, .images = images_.get(), .frame = static_cast<int>(number)}));
    }
    return data;
  }
  /// The first frame has these inputs from now on.
  void begin_with(const Workload& workload, std::span<const Tensor> inputs) {
    auto data = std::make_shared<Data>();
    for (const Tensor& each : of(workload, 0)->parameters) data->parameters.push_back(each.share());
    for (const Tensor& each : inputs) data->inputs.push_back(each.share());
    frames_[&workload].front() = std::move(data);
  }

 private:
  std::uint64_t seed_;
  std::unique_ptr<ImageSource> images_;
  std::map<const Workload*, std::vector<std::shared_ptr<const Data>>> frames_;
};

}  // namespace pirt
