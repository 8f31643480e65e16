#include "workloads/mapping/workloads.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <utility>

#include "workloads/base/error.h"
#include "workloads/mapping/generate_bal.h"
#include "workloads/model/host_function.h"

namespace pirt::mapping {
namespace {

constexpr double kNoisePx = 1;

void check_rows(std::span<const Tensor> inputs) {
  const auto cameras = inputs[2].rows();
  const auto priors = inputs[5].rows();
  if (inputs[0].rows() == inputs[1].rows() && cameras == inputs[4].rows() &&
      (priors == 0 || cameras == priors) && inputs[6].rows() == inputs[7].rows()) {
    return;
  }
  throw_bad_input(
      fmt::format("{} observations with {} pixels, {} cameras with {} of fixed and {} priors, and "
                  "{} pairs with "
                  "{} relative poses: each needs one, and no priors or as many as cameras",
                  inputs[0].rows(), inputs[1].rows(), cameras, inputs[4].rows(), priors,
                  inputs[6].rows(), inputs[7].rows()));
}

BalProblem problem_of(std::span<const Tensor> inputs) {
  BalProblem problem;
  const auto seen_by = inputs[0].used<std::int32_t>();
  const auto pixels = inputs[1].used<double>();
  for (std::size_t i = 0; i < seen_by.size(); i += 2) {
    problem.observations.push_back({seen_by[i], seen_by[i + 1], pixels[i], pixels[i + 1]});
  }
  const auto cameras = inputs[2].used<double>();
  const auto points = inputs[3].used<double>();
  problem.cameras.assign(cameras.begin(), cameras.end());
  problem.points.assign(points.begin(), points.end());
  return problem;
}

BundleOptions options_of(std::span<const Tensor> inputs) {
  BundleOptions options = robot_options();
  const auto fixed = inputs[4].used<std::uint8_t>();
  for (std::size_t i = 0; i < fixed.size(); ++i) {
    if (fixed[i] != 0) options.fixed_cameras.push_back(static_cast<std::int32_t>(i));
  }
  const auto priors = inputs[5].used<double>();
  for (std::size_t i = 0; i < priors.size(); i += kPriorSize) {
    const auto row = priors.subspan(i, kPriorSize);
    if (row[3] <= 0 && row[7] <= 0) continue;
    options.priors.push_back({.camera = static_cast<std::int32_t>(i / kPriorSize),
                              .centre = {row[0], row[1], row[2]},
                              .px_per_unit = row[3],
                              .turn = {row[4], row[5], row[6]},
                              .px_per_rad = row[7]});
  }
  const auto pairs = inputs[6].used<std::int32_t>();
  const auto relative = inputs[7].used<double>();
  for (std::size_t i = 0; 2 * i < pairs.size(); ++i) {
    const double* const row = &relative[i * kRelativeSize];
    options.relative.push_back({.from = pairs[2 * i],
                                .to = pairs[2 * i + 1],
                                .turn = {row[0], row[1], row[2]},
                                .move = {row[3], row[4], row[5]},
                                .px_per_rad = row[6],
                                .px_per_unit = row[7]});
  }
  return options;
}

void adjust(std::span<const Tensor> inputs, std::span<Tensor> outputs) {
  check_rows(inputs);
  BalProblem problem = problem_of(inputs);
  const BundleSummary summary = bundle_adjust(problem, options_of(inputs));
  outputs[0].set_rows(inputs[2].rows());
  const auto poses = outputs[0].used<double>();
  for (std::size_t i = 0; i < problem.camera_count(); ++i) {
    std::copy_n(&problem.cameras[i * kCameraSize], kPoseSize, &poses[i * kPoseSize]);
  }
  outputs[1].set_rows(inputs[3].rows());
  std::ranges::copy(problem.points, outputs[1].used<double>().begin());
  outputs[2].as<double>()[0] = summary.initial_cost;
  outputs[2].as<double>()[1] = summary.final_cost;
  outputs[3].as<double>()[0] = summary.inlier_rms_px;
  outputs[3].as<double>()[1] = summary.noise_px;
}

/// Of the residuals within 4 px, over what the free parameters take up.
double noise_of(std::span<const double> residuals, double parameters) {
  double sum = 0;
  double coordinates = 0;
  for (std::size_t i = 0; i < residuals.size(); i += 2) {
    const double square = residuals[i] * residuals[i] + residuals[i + 1] * residuals[i + 1];
    if (square > 16 * kNoisePx * kNoisePx) continue;
    sum += square;
    coordinates += 2;
  }
  return std::sqrt(sum / (coordinates - parameters));
}

Verdict judge(std::span<const PlayedFrame> sequence) {
  constexpr double kNoiseBound = 0.05;
  const PlayedFrame& only = sequence.front();
  static const auto close = verify_close(1e-6);
  Verdict verdict = close(only.outputs, only.expected);
  if (!verdict.ok) return verdict;
  BalProblem problem = problem_of(only.data->inputs);
  const double before = half_squares(residuals_px(problem));
  take_outputs(only.outputs, problem);
  const auto residuals = residuals_px(problem);
  const double cost = half_squares(residuals);
  const auto fixed = std::ranges::count(only.data->inputs[4].used<std::uint8_t>(), 1);
  const auto free_cameras = static_cast<std::int64_t>(problem.camera_count()) - fixed;
  const double noise =
      noise_of(residuals, static_cast<double>(kPoseSize * static_cast<std::size_t>(free_cameras) +
                                              problem.points.size()));
  verdict.ok = cost < before && std::abs(cost - only.outputs[2].as<double>()[1]) <= 1e-6 * cost &&
               std::abs(noise - kNoisePx) <= kNoiseBound * kNoisePx;
  verdict.detail += fmt::format(
      "; cost {:.6g} where it was {:.6g} and says {:.6g}, noise {:.3f} px, bound {:.2g} of {} px",
      cost, before, only.outputs[2].as<double>()[1], noise, kNoiseBound, kNoisePx);
  return verdict;
}

/// Intrinsics are known and the first two cameras are where they are.
Data sample(const DataRequest& request) {
  GeneratedBal made = generate_bal(
      {.images = 16, .points = 200, .noise_px = kNoisePx, .outliers = 0.02, .seed = request.seed});
  const auto& truth = made.truth.cameras;
  auto& cameras = made.problem.cameras;
  std::copy_n(truth.begin(), 2 * kCameraSize, cameras.begin());
  for (std::size_t i = 0; i < cameras.size(); i += kCameraSize) {
    std::copy_n(&truth[i + kPoseSize], kCameraSize - kPoseSize, &cameras[i + kPoseSize]);
  }
  Data data;
  data.inputs = bundle_inputs(made.problem, std::array{0, 1});
  return data;
}

void check_room(std::size_t count, int room, std::string_view what) {
  if (count <= static_cast<std::size_t>(room)) return;
  throw_bad_input(
      fmt::format("{} {} are more than the {} that the workload bundle_adjust has room for; "
                  "mapping::bundle_adjust takes any number",
                  count, what, room));
}

}  // namespace

std::vector<Tensor> bundle_inputs(const BalProblem& problem, std::span<const std::int32_t> fixed,
                                  std::span<const PosePrior> priors,
                                  std::span<const RelativePose> relative) {
  check_room(problem.observations.size(), kRoomForObservations, "observations");
  check_room(problem.camera_count(), kRoomForImages, "cameras");
  check_room(problem.point_count(), kRoomForPoints, "points");
  check_room(relative.size(), kRoomForRelative, "relative poses");
  auto inputs = make_tensors(specs()[0].inputs);
  inputs[0].set_rows(std::ssize(problem.observations));
  inputs[1].set_rows(std::ssize(problem.observations));
  const auto seen_by = inputs[0].as<std::int32_t>();
  const auto pixels = inputs[1].as<double>();
  for (std::size_t i = 0; i < problem.observations.size(); ++i) {
    const Observation& seen = problem.observations[i];
    seen_by[2 * i] = seen.camera;
    seen_by[2 * i + 1] = seen.point;
    pixels[2 * i] = seen.x;
    pixels[2 * i + 1] = seen.y;
  }
  const auto cameras = static_cast<std::int64_t>(problem.camera_count());
  inputs[2].set_rows(cameras);
  std::ranges::copy(problem.cameras, inputs[2].as<double>().begin());
  inputs[3].set_rows(static_cast<std::int64_t>(problem.point_count()));
  std::ranges::copy(problem.points, inputs[3].as<double>().begin());
  inputs[4].set_rows(cameras);
  for (const std::int32_t camera : fixed) {
    if (camera < 0 || camera >= cameras) {
      throw_bad_input(fmt::format("camera {} cannot be fixed: there are {}", camera, cameras));
    }
    inputs[4].as<std::uint8_t>()[static_cast<std::size_t>(camera)] = 1;
  }
  inputs[5].set_rows(priors.empty() ? 0 : cameras);
  for (const PosePrior& prior : priors) {
    if (prior.camera < 0 || prior.camera >= cameras) {
      throw_bad_input(fmt::format("camera {} cannot be expected anywhere: there are {}",
                                  prior.camera, cameras));
    }
    double* const row =
        &inputs[5].as<double>()[kPriorSize * static_cast<std::size_t>(prior.camera)];
    std::ranges::copy(prior.centre, row);
    row[3] = prior.px_per_unit;
    std::ranges::copy(prior.turn, row + 4);
    row[7] = prior.px_per_rad;
  }
  inputs[6].set_rows(std::ssize(relative));
  inputs[7].set_rows(std::ssize(relative));
  for (std::size_t i = 0; i < relative.size(); ++i) {
    const RelativePose& pose = relative[i];
    inputs[6].as<std::int32_t>()[2 * i] = pose.from;
    inputs[6].as<std::int32_t>()[2 * i + 1] = pose.to;
    double* row = &inputs[7].as<double>()[i * kRelativeSize];
    row = std::ranges::copy(pose.turn, row).out;
    row = std::ranges::copy(pose.move, row).out;
    row[0] = pose.px_per_rad;
    row[1] = pose.px_per_unit;
  }
  return inputs;
}

void take_outputs(std::span<const Tensor> outputs, BalProblem& problem) {
  const auto poses = outputs[0].used<double>();
  const auto points = outputs[1].used<double>();
  if (poses.size() != problem.camera_count() * kPoseSize ||
      points.size() != problem.points.size()) {
    throw_bad_input("the adjusted map has other cameras or points than the problem");
  }
  for (std::size_t i = 0; i < problem.camera_count(); ++i) {
    std::copy_n(&poses[i * kPoseSize], kPoseSize, &problem.cameras[i * kCameraSize]);
  }
  std::ranges::copy(points, problem.points.begin());
}

std::vector<Workload> all() {
  auto all = specs();
  Workload& w = all[0];
  auto function = std::make_shared<HostFunction>(operation_as<HostFunction>(w));
  function->prepare = [](std::span<const Tensor>) -> KernelFunction { return adjust; };
  w.operation = std::move(function);
  w.make_data = sample;
  w.reference = [](const Data& data) {
    auto outputs = make_tensors(specs()[0].outputs);
    adjust(data.inputs, outputs);
    return outputs;
  };
  w.verify = verify_close(1e-6);
  w.judge = judge;
  return all;
}

}  // namespace pirt::mapping
