// What the tests of the FPGA backend share.
#pragma once

#include <cstring>
#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "tests/workloads/backends/fpga/fpga_models.h"
#include "tests/workloads/catalog/workload_support.h"
#include "workloads/backends/fpga/core.h"
#include "workloads/backends/fpga/fpga_backend.h"
#include "workloads/backends/fpga/kernels.h"
#include "workloads/vision/image_data.h"
#include "workloads/vision/vision.h"

namespace pirt::test {

inline std::unique_ptr<Device> open_fpga(std::map<std::string, double> options = {}) {
  UnitRequest request;
  request.unit = "fpga";
  request.options = std::move(options);
  return make_fpga_backend()->open(request);
}

/// Elements that go through a core, and those that must come out.
struct CoreCase {
  std::string core;
  int width = 0, height = 0;
  std::vector<std::uint8_t> parameters;
  std::vector<std::uint64_t> in, expected;
};

/// Elements side by side of tensors that have one a pixel.
inline std::vector<std::uint64_t> elements_of(std::span<const Tensor> tensors, std::size_t pixels) {
  std::vector<std::uint64_t> all(pixels, 0);
  int shift = 0;
  for (const Tensor& tensor : tensors) {
    const std::size_t bytes = tensor.bytes().size() / pixels;
    for (std::size_t i = 0; i < pixels; ++i) {
      std::uint64_t value = 0;
      std::memcpy(&value, tensor.bytes().data() + i * bytes, bytes);
      all[i] |= value << shift;
    }
    shift += static_cast<int>(8 * bytes);
  }
  return all;
}

inline Workload workload_of_core(const std::string& core, int width, int height) {
  if (core == "gaussian_blur") return vision::make_gaussian_blur(width, height);
  if (core == "convolution") return vision::make_convolution(width, height);
  if (core == "sobel") return vision::make_sobel(width, height);
  if (core == "undistort") return vision::make_undistort(width, height);
  if (core == "feature_score") return vision::make_feature_detect(width, height);
  return vision::make_optical_flow(width, height);
}

/// The sums that the definition of optical_flow has, one window after the other.
inline std::vector<std::uint64_t> flow_model(const Data& data, int width, int height) {
  const auto previous = data.inputs[0].as<std::uint8_t>(), next = data.inputs[1].as<std::uint8_t>();
  const auto at = [&](int x, int y) {
    return std::size_t{1} * static_cast<std::size_t>(vision::replicate(y, height)) *
               static_cast<std::size_t>(width) +
           static_cast<std::size_t>(vision::replicate(x, width));
  };
  std::vector<std::array<std::int64_t, 5>> products;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const std::int64_t dx = previous[at(x + 1, y)] - previous[at(x - 1, y)];
      const std::int64_t dy = previous[at(x, y + 1)] - previous[at(x, y - 1)];
      const std::int64_t dt = next[at(x, y)] - previous[at(x, y)];
      products.push_back({dx * dx, dx * dy, dy * dy, dx * dt, dy * dt});
    }
  }
  std::vector<std::uint64_t> flow;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      std::array<std::int64_t, 5> sums{};
      for (int j = -26; j <= 25; ++j) {
        for (int i = -26; i <= 25; ++i) {
          for (std::size_t k = 0; k < 5; ++k) sums[k] += products[at(x + i, y + j)][k];
        }
      }
      flow.push_back(flow_of(sums));
    }
  }
  return flow;
}

inline std::vector<std::uint64_t> score_model(const Data& data, int width, int height) {
  const auto g = vision::sobel_gradients(data.inputs[0].as<std::uint8_t>(), width, height);
  std::vector<std::uint64_t> scores;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      std::int64_t xx = 0, xy = 0, yy = 0;
      for (int j = -1; j <= 1; ++j) {
        for (int i = -1; i <= 1; ++i) {
          const auto at = static_cast<std::size_t>(vision::reflect101(y + j, height) * width +
                                                   vision::reflect101(x + i, width));
          xx += std::int64_t{g.gx[at]} * g.gx[at];
          xy += std::int64_t{g.gx[at]} * g.gy[at];
          yy += std::int64_t{g.gy[at]} * g.gy[at];
        }
      }
      scores.push_back(score_of(xx, xy, yy));
    }
  }
  return scores;
}

/// Noise through @p core: what goes in as the backend lays it, and what its definition or the model
/// of its numbers says.
/// @param pixel  In place of noise; weights of filters are then the smallest that there are.
using Pixel = std::uint8_t(int x, int y);
inline CoreCase core_case(const std::string& core, int width, int height, Pixel* pixel = nullptr) {
  const Workload workload = workload_of_core(core, width, height);
  Data data = noise_data(workload);
  if (pixel != nullptr) {
    for (Tensor& picture : data.inputs) {
      const auto pixels = picture.as<std::uint8_t>();
      for (int i = 0; i < std::ssize(pixels); ++i) {
        pixels[static_cast<std::size_t>(i)] = pixel(i % width, i / width);
      }
    }
    if (core == "convolution") std::ranges::fill(data.parameters[0].as<std::int16_t>(), -128);
  }
  const auto pixels = static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
  const auto call = fpga::find_kernel(workload.kernel)->make(workload, data.parameters);
  CoreCase one{core, width, height, call.parameters, elements_of(data.inputs, pixels), {}};
  one.in.resize(call.in[0].memory.size(), 0x5a);
  if (core == "undistort") {
    for (std::size_t i = 0; i < one.in.size(); ++i) {
      std::uint16_t value = 0;
      std::memcpy(&value, call.in[1].memory.data() + 2 * i, 2);
      one.in[i] = (one.in[i] & 0xff) | std::uint64_t{value} << 8;
    }
  }
  if (core == "optical_flow") {
    one.expected = flow_model(data, width, height);
  } else if (core == "feature_score") {
    one.expected = score_model(data, width, height);
  } else {
    one.expected = elements_of(workload.reference(data), pixels);
  }
  return one;
}

}  // namespace pirt::test
