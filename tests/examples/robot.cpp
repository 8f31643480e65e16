// A small robot: a camera at 25 Hz whose pictures are flattened, blurred and searched for corners,
// and a controller of its own that steers by them. It names no device: the runtime decides.
//
// Usage: robot [frames [platform]]    host-cpu where there is no driver of OpenCL
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <thread>

#include "scheduler/runtime/runtime.h"
#include "workloads/base/error.h"
#include "workloads/catalog/catalog.h"

namespace {

using namespace std::chrono_literals;

/// What a camera's driver would fill in: here, squares that move.
pirt::Tensor take_picture(const pirt::TensorSpec& spec, int frame) {
  pirt::Tensor picture(spec);
  const auto pixels = picture.as<std::uint8_t>();
  const auto width = picture.dim(1);
  for (std::int64_t y = 0; y < picture.dim(0); ++y) {
    for (std::int64_t x = 0; x < width; ++x) {
      const bool light = ((x + 3 * frame) / 40 + y / 40) % 2 == 0;
      pixels[static_cast<std::size_t>(y * width + x)] = light ? 200 : 40;
    }
  }
  return picture;
}

/// A workload of the robot's own: towards the middle of the corners; [turn in rad/s].
pirt::OwnWorkload make_steering(const pirt::TensorSpec& corners) {
  const auto steer = [](std::span<const pirt::Tensor> inputs, std::span<pirt::Tensor> outputs) {
    const auto rows = inputs[0].used<float>();
    const auto count = static_cast<std::size_t>(inputs[0].rows());
    const std::size_t columns = count == 0 ? 1 : rows.size() / count;
    double sum = 0;
    for (std::size_t i = 0; i < count; ++i) sum += rows[i * columns];
    const double middle = count == 0 ? 320.0 : sum / static_cast<double>(count);
    outputs[0].as<float>()[0] = static_cast<float>((320.0 - middle) / 320.0);
  };
  return {.name = "steer",
          .inputs = {corners},
          .outputs = {{.name = "turn_rad_s", .element = pirt::Element::kF32, .shape = {1}}},
          .kernels = {{"cpu", steer}},
          .expected = {{"cpu", 1ms}}};  // So that a call that hangs is noticed.
}

}  // namespace

int main(int argc, char** argv) try {
  const int frames = argc > 1 ? std::atoi(argv[1]) : 50;
  const pirt::Workload& undistort = pirt::find_workload("undistort");
  const pirt::Workload& detect = pirt::find_workload("feature_detect");

  pirt::RuntimeOptions options;
  if (argc > 2) options.platform = pirt::load_platform(argv[2]);
  options.workloads = {"undistort", "gaussian_blur", "feature_detect",
                       make_steering(detect.outputs[0])};
  options.progress = [](const std::string& line) { std::printf("%s\n", line.c_str()); };
  options.time_limit = 5s;  // Without a profile nobody knows what the others take.
  pirt::Runtime runtime(std::move(options));

  const auto undistorting = runtime.workload("undistort");
  const auto blurring = runtime.workload("gaussian_blur");
  const auto detecting = runtime.workload("feature_detect");
  const auto steering = runtime.workload("steer");
  const pirt::TaskOptions soon{.real_time = true, .deadline = 40ms, .expires = 40ms};
  pirt::TaskFuture last;
  auto next = std::chrono::steady_clock::now();
  for (int frame = 0; frame < frames; ++frame, next += 40ms) {
    std::this_thread::sleep_until(next);
    const pirt::Tensor picture = take_picture(undistort.inputs[0], frame);
    const auto flat = runtime.submit(undistorting, {picture}, soon);
    const auto blurred = runtime.submit(blurring, {flat.output(0)}, soon);
    const auto corners = runtime.submit(detecting, {blurred.output(0)}, soon);
    last = runtime.submit(steering, {corners.output(0)}, soon,
                          [frame](const pirt::TaskFuture& task, pirt::TaskEnd end) {
                            if (end != pirt::TaskEnd::kCompleted) {
                              std::printf("frame %d: no turn, %s\n", frame,
                                          std::string(pirt::to_string(end)).c_str());
                            } else if (frame % 25 == 0) {
                              std::printf("frame %d: corners found on %s\n", frame,
                                          task.unit().c_str());
                            }
                          });
  }
  runtime.wait_all();

  const auto statistics = runtime.statistics();
  std::printf("%lld of %lld tasks completed\n", static_cast<long long>(statistics.completed),
              static_cast<long long>(statistics.submitted));
  for (const auto& unit : statistics.units) {
    std::printf("%-8s %6lld tasks, busy for %.0f ms\n", unit.name.c_str(),
                static_cast<long long>(unit.completed), pirt::to_ms(unit.busy));
  }
  if (last.end() == pirt::TaskEnd::kCompleted) {
    std::printf("last turn: %+.3f rad/s\n", static_cast<double>(last.get()[0].as<float>()[0]));
  }
  return statistics.failed == 0 ? 0 : 1;  // What is late is let go; that is no failure.
} catch (const pirt::Error& error) {      // A unit that is not there, say: what, and the remedy.
  std::fprintf(stderr, "robot: %s\n", error.what());
  return pirt::exit_code(error.code());
}
