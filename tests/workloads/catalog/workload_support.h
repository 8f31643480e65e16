// What the tests of references, catalog and backends share.
#pragma once

#include <algorithm>
#include <cstdint>
#include <initializer_list>
#include <vector>

#include "workloads/inputs/pictures/images.h"
#include "workloads/model/backend.h"
#include "workloads/model/player.h"
#include "workloads/model/workload.h"

namespace pirt::test {

/// The reference's outputs in the types that a backend gives: what a perfect backend would return.
inline std::vector<Tensor> as_outputs(const Workload& workload,
                                      const std::vector<Tensor>& expected) {
  std::vector<Tensor> outputs = make_tensors(workload.outputs);
  for (std::size_t i = 0; i < outputs.size(); ++i) {
    if (outputs[i].spec().varies) outputs[i].set_rows(expected[i].rows());
    if (expected[i].spec().element != outputs[i].spec().element) {
      std::ranges::transform(expected[i].used<double>(), outputs[i].as<float>().begin(),
                             [](double value) { return static_cast<float>(value); });
    } else {
      std::ranges::copy(expected[i].used_bytes(), outputs[i].data());
    }
  }
  return outputs;
}

/// All inputs of a workload's sequence, of seed 1.
inline std::vector<Data> sequence_of(const Workload& workload) {
  const auto images = generated_images(1);
  return make_sequence(workload, {.seed = 1, .images = images.get()});
}

/// Plays @p frames on a fresh kernel of @p device and compares each with the reference.
inline Verdict play_and_verify(Device& device, const Workload& workload,
                               std::span<const Data> frames) {
  Player player(device.prepare(workload, frames.front().parameters), workload, frames);
  player.scribble();
  player.complete();
  return verify_sequence(workload, player.played(reference_of(workload, frames)));
}

template <typename T>
Tensor tensor_of(std::vector<std::int64_t> shape, std::initializer_list<T> values) {
  Tensor tensor({"test", element_of<T>(), std::move(shape)});
  std::ranges::copy(values, tensor.as<T>().begin());
  return tensor;
}

/// A picture of random pixels: harder on borders and rounding than a textured one.
inline Tensor noise_picture(int width, int height, std::uint64_t seed) {
  Tensor picture({"image", Element::kU8, {height, width}});
  auto pixels = picture.as<std::uint8_t>();
  for (std::size_t i = 0; i < pixels.size(); ++i) {
    pixels[i] = static_cast<std::uint8_t>(
        (seed = seed * 6364136223846793005ULL + 1442695040888963407ULL) >> 56);
  }
  return picture;
}

/// Has @p workload prepared, runs it @p repeats times on @p data, and compares with its reference.
/// @param prepare  Takes the parameters, gives the kernel.
template <typename Prepare>
Verdict run_and_verify_prepared(const Workload& workload, const Data& data, int repeats,
                                const Prepare& prepare) {
  const std::span frame(&data, 1);
  Player player(prepare(data.parameters), workload, frame);
  player.scribble();
  player.kernel().upload();
  player.kernel().execute(repeats);
  player.kernel().download();
  player.called();
  return verify_sequence(workload, player.played(reference_of(workload, frame)));
}

inline Data data_of_seed_1(const Workload& workload) {
  const auto images = generated_images(1);
  return workload.make_data({.seed = 1, .images = images.get()});
}

inline Verdict run_and_verify(Device& device, const Workload& workload, const Data& data,
                              int repeats = 1) {
  return run_and_verify_prepared(workload, data, repeats, [&](const auto& parameters) {
    return device.prepare(workload, parameters);
  });
}

/// The same on data of seed 1.
inline Verdict run_and_verify(Device& device, const Workload& workload, int repeats = 1) {
  return run_and_verify(device, workload, data_of_seed_1(workload), repeats);
}

/// Pictures of random pixels as @p workload's inputs.
inline Data noise_data(const Workload& workload) {
  const auto images = generated_images(2);
  Data data = workload.make_data({.seed = 3, .images = images.get()});
  // To follow a point through unrelated noise is chaos: pictures with a list are alike.
  const bool alike = std::ranges::any_of(workload.inputs, &TensorSpec::varies);
  for (std::uint64_t seed = 1; auto& input : data.inputs) {
    if (input.spec().element != Element::kU8) continue;
    input = noise_picture(static_cast<int>(input.dim(1)), static_cast<int>(input.dim(0)), seed);
    if (!alike) ++seed;
  }
  return data;
}

/// Sizes with borders that overlap (1x1, 7x5), even ones, and odd ones that no vector width
/// divides.
inline constexpr std::initializer_list<std::pair<int, int>> kOddSizes = {
    {1, 1}, {2, 1}, {1, 3}, {7, 5}, {64, 48}, {641, 479}};

}  // namespace pirt::test
