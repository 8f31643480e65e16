// What the paper prints: the figures that reports compare with.
#pragma once

#include <array>
#include <optional>
#include <string_view>

namespace pirt::paper {

/// @source Table I. Operations a call, as printed: rounded to 0.1 million.
struct Ops {
  std::string_view workload;
  double millions;
};
inline constexpr std::array kTable1 = {
    Ops{"gaussian_blur", 15.4}, Ops{"convolution", 30.1}, Ops{"sobel", 74.7},  Ops{"conv1", 210.8},
    Ops{"conv2", 895.5},        Ops{"conv3", 299.0},      Ops{"conv4", 448.6}, Ops{"conv5", 299.0},
    Ops{"fc6", 75.5},           Ops{"fc7", 33.6},         Ops{"fc8", 8}};

/// @source Table II, the Snapdragon 820's DSP: a hardware thread's clock, and the peak.
inline constexpr double kDspThreadHz = 500e6, kDspOpsPerSecond = 4e9;

/// What Table IV calls inference.
inline constexpr const char* kInference = "alexnet";
/// @source Table IV.
struct Inference {
  std::string_view where;
  double energy_j, low_s, high_s;
};
inline constexpr std::array kTable4 = {Inference{"CPU (TX1)", 0.800, 0.400, 0.400},
                                       Inference{"GPU (TX1)", 0.132, 0.033, 0.033},
                                       Inference{"cloud", 0.010, 2, 5}};

/// @source Table V; latencies in ms.
struct Scheduling {
  std::string_view mode;
  double frames_per_ms;
  std::optional<double> cpu_ms, gpu_ms, dsp_ms;
  double energy_j;
};
inline constexpr std::array kTable5 = {
    Scheduling{"throughput", 0.745, 8.21, 10.42, std::nullopt, 4.76},
    Scheduling{"latency", 0.467, 6.84, 7.45, 19.62, 4.20},
    Scheduling{"energy", 0.307, std::nullopt, 8.24, 18.61, 3.36}};

}  // namespace pirt::paper
