#include "workloads/mapping/bundle_adjust.h"

#include <ceres/ceres.h>
#include <fmt/core.h>
#include <glog/logging.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <mutex>

#include "workloads/base/error.h"
#include "workloads/mapping/reprojection.h"
#include "workloads/model/slices.h"

namespace pirt::mapping {
namespace {

constexpr std::array<std::string_view, 3> kLossNames = {"none", "huber", "cauchy"};
/// The dense complement has (9 * cameras)^2 numbers: 100 MB.
constexpr std::size_t kSparseFrom = 400;

/// Ceres says on the standard error stream, through glog, when it tries a step again with more
/// damping. That is its work and no message of ours. Quiet while there is one on any thread.
class QuietGlog {
 public:
  QuietGlog() {
    const std::lock_guard lock(mutex_);
    if (count_++ > 0) return;
    before_ = FLAGS_minloglevel;
    FLAGS_minloglevel = google::GLOG_ERROR;
  }
  QuietGlog(const QuietGlog&) = delete;
  QuietGlog& operator=(const QuietGlog&) = delete;
  ~QuietGlog() {
    const std::lock_guard lock(mutex_);
    if (--count_ == 0) FLAGS_minloglevel = before_;
  }

 private:
  static inline std::mutex mutex_;
  static inline int count_ = 0;
  static inline int before_ = 0;
};

class ReprojectionError {
 public:
  explicit ReprojectionError(const Observation& seen) : x_(seen.x), y_(seen.y) {}

  template <typename T>
  bool operator()(const T* camera, const T* point, T* residuals) const {
    const auto pixel = project(camera, point);
    residuals[0] = pixel[0] - x_;
    residuals[1] = pixel[1] - y_;
    return true;
  }

 private:
  double x_, y_;
};

/// What is left of a camera's rotation beside the expected one.
/// @param expected  A quaternion.
template <typename T>
void turn_beside(const std::array<T, 4>& expected, const T* camera, T* turn) {
  const std::array<T, 4> back = {expected[0], -expected[1], -expected[2], -expected[3]};
  std::array<T, 4> now, left;
  ceres::AngleAxisToQuaternion(camera, now.data());
  ceres::QuaternionProduct(now.data(), back.data(), left.data());
  ceres::QuaternionToAngleAxis(left.data(), turn);
}

/// How far a camera's centre is from where it is expected, and how far it is turned, in pixels.
class PriorError {
 public:
  explicit PriorError(const PosePrior& prior) : prior_(prior) {}

  template <typename T>
  bool operator()(const T* camera, T* residuals) const {
    // The centre is -R^T t.
    const std::array<T, 3> back = {-camera[0], -camera[1], -camera[2]};
    ceres::AngleAxisRotatePoint(back.data(), camera + 3, residuals);
    for (std::size_t i = 0; i < 3; ++i) {
      residuals[i] = prior_.px_per_unit * (-residuals[i] - prior_.centre[i]);
    }
    const std::array<T, 3> turn = {T(prior_.turn[0]), T(prior_.turn[1]), T(prior_.turn[2])};
    std::array<T, 4> expected;
    ceres::AngleAxisToQuaternion(turn.data(), expected.data());
    turn_beside(expected, camera, residuals + 3);
    for (std::size_t i = 3; i < 6; ++i) residuals[i] *= prior_.px_per_rad;
    return true;
  }

 private:
  PosePrior prior_;
};

/// How a camera stands against another, beside how it should, in pixels.
class RelativeError {
 public:
  explicit RelativeError(const RelativePose& expected) : expected_(expected) {}

  template <typename T>
  bool operator()(const T* from, const T* to, T* residuals) const {
    // What is left of R_to (R(turn) R_from)^T.
    const std::array<T, 3> turn = {T(expected_.turn[0]), T(expected_.turn[1]),
                                   T(expected_.turn[2])};
    std::array<T, 4> turned, start, expected;
    ceres::AngleAxisToQuaternion(turn.data(), turned.data());
    ceres::AngleAxisToQuaternion(from, start.data());
    ceres::QuaternionProduct(turned.data(), start.data(), expected.data());
    turn_beside(expected, to, residuals);
    // t_to - R_to R_from^T t_from: where the camera `from` is seen from `to`.
    const std::array<T, 3> back = {-from[0], -from[1], -from[2]};
    std::array<T, 3> centre, carried;
    ceres::AngleAxisRotatePoint(back.data(), from + 3, centre.data());
    ceres::AngleAxisRotatePoint(to, centre.data(), carried.data());
    for (std::size_t i = 0; i < 3; ++i) {
      residuals[i] *= expected_.px_per_rad;
      residuals[3 + i] = expected_.px_per_unit * (to[3 + i] - carried[i] - expected_.move[i]);
    }
    return true;
  }

 private:
  RelativePose expected_;
};

std::unique_ptr<ceres::LossFunction> make_loss(const BundleOptions& options) {
  switch (options.loss) {
    case Loss::kNone:
      return nullptr;
    case Loss::kHuber:
      return std::make_unique<ceres::HuberLoss>(options.loss_px);
    case Loss::kCauchy:
      break;
  }
  return std::make_unique<ceres::CauchyLoss>(options.loss_px);
}

void refuse_degenerate(const BalProblem& problem, std::span<const double> residuals) {
  const auto bad =
      std::ranges::find_if(residuals, [](double residual) { return !std::isfinite(residual); });
  if (bad == residuals.end()) return;
  const auto which = static_cast<std::size_t>(bad - residuals.begin()) / 2;
  throw_bad_input(fmt::format(
      "observation {} cannot be computed: point {} lies in the plane of camera {}, or their "
      "numbers "
      "are too large; take the observation out, or start elsewhere",
      which + 1, problem.observations[which].point, problem.observations[which].camera));
}

class Iterations : public ceres::IterationCallback {
 public:
  explicit Iterations(const BundleOptions& options) : options_(options) {}
  ceres::CallbackReturnType operator()(const ceres::IterationSummary& done) override {
    if (options_.goes_on && !options_.goes_on(done.iteration, done.cost))
      return ceres::SOLVER_ABORT;
    between_slices();
    return ceres::SOLVER_CONTINUE;
  }

 private:
  const BundleOptions& options_;
};

/// Ceres's problem over the arrays of ours.
class Adjustment {
 public:
  Adjustment(BalProblem& problem, const BundleOptions& options)
      : loss_(make_loss(options)), iterations_(options), problem_(ceres_options()) {
    auto* ordering = new ceres::ParameterBlockOrdering;  // The solver's options own it.
    solver_.linear_solver_ordering.reset(ordering);
    for (const auto& seen : problem.observations) {
      double* const camera = &problem.cameras[static_cast<std::size_t>(seen.camera) * kCameraSize];
      double* const point = &problem.points[static_cast<std::size_t>(seen.point) * kPointSize];
      problem_.AddResidualBlock(
          new ceres::AutoDiffCostFunction<ReprojectionError, 2, kCameraSize, kPointSize>(
              new ReprojectionError(seen)),
          loss_.get(), camera, point);
      ordering->AddElementToGroup(point, 0);
      ordering->AddElementToGroup(camera, 1);
    }
    expect(problem, options.priors);
    expect(problem, options.relative);
    hold(problem, options);
    solver_.linear_solver_type =
        problem.camera_count() < kSparseFrom ? ceres::DENSE_SCHUR : ceres::SPARSE_SCHUR;
    solver_.max_num_iterations = options.most_iterations;
    solver_.num_threads = options.threads;
    solver_.logging_type = ceres::SILENT;
    // Costs that differ by less are the same map.
    solver_.function_tolerance = 1e-7;
    solver_.callbacks.push_back(&iterations_);
  }

  [[nodiscard]] ceres::Solver::Summary solve() {
    const QuietGlog quiet;
    ceres::Solver::Summary summary;
    ceres::Solve(solver_, &problem_, &summary);
    return summary;
  }

 private:
  static ceres::Problem::Options ceres_options() {
    ceres::Problem::Options options;
    options.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
    options.manifold_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
    return options;
  }

  /// Of cameras that see nothing, nothing is expected: they stay as they are.
  void expect(BalProblem& problem, std::span<const PosePrior> priors) {
    for (const PosePrior& prior : priors) {
      double* const camera = &problem.cameras[static_cast<std::size_t>(prior.camera) * kCameraSize];
      if (!problem_.HasParameterBlock(camera)) continue;
      problem_.AddResidualBlock(
          new ceres::AutoDiffCostFunction<PriorError, 6, kCameraSize>(new PriorError(prior)),
          nullptr, camera);
    }
  }

  /// Of a pair of which one sees nothing, nothing is expected either.
  void expect(BalProblem& problem, std::span<const RelativePose> relative) {
    for (const RelativePose& pose : relative) {
      double* const from = &problem.cameras[static_cast<std::size_t>(pose.from) * kCameraSize];
      double* const to = &problem.cameras[static_cast<std::size_t>(pose.to) * kCameraSize];
      if (!problem_.HasParameterBlock(from) || !problem_.HasParameterBlock(to)) continue;
      problem_.AddResidualBlock(
          new ceres::AutoDiffCostFunction<RelativeError, 6, kCameraSize, kCameraSize>(
              new RelativeError(pose)),
          nullptr, from, to);
    }
  }

  void hold(BalProblem& problem, const BundleOptions& options) {
    for (std::size_t i = 0; i < problem.camera_count(); ++i) {
      double* const camera = &problem.cameras[i * kCameraSize];
      if (!problem_.HasParameterBlock(camera)) continue;
      if (options.fixed_intrinsics) problem_.SetManifold(camera, &pose_only_);
      if (std::ranges::find(options.fixed_cameras, static_cast<std::int32_t>(i)) !=
          options.fixed_cameras.end()) {
        problem_.SetParameterBlockConstant(camera);
      }
    }
  }

  std::unique_ptr<ceres::LossFunction> loss_;
  Iterations iterations_;
  ceres::SubsetManifold pose_only_{kCameraSize, {6, 7, 8}};
  ceres::Problem problem_;
  ceres::Solver::Options solver_;
};

void judge_inliers(std::span<const double> residuals, BundleSummary& summary) {
  constexpr double kMedianOfNorm = 1.17741;  // sqrt(2 ln 2): of two coordinates of deviation 1
  constexpr double kFarthest = 4;
  std::vector<double> squares;
  for (std::size_t i = 0; i < residuals.size(); i += 2) {
    squares.push_back(residuals[i] * residuals[i] + residuals[i + 1] * residuals[i + 1]);
  }
  auto sorted = squares;
  const auto middle = sorted.begin() + std::ssize(sorted) / 2;
  std::ranges::nth_element(sorted, middle);
  const double noise = std::sqrt(*middle) / kMedianOfNorm;
  double sum = 0;
  for (const double square : squares) {
    if (square > kFarthest * kFarthest * noise * noise) continue;
    ++summary.inliers;
    sum += square;
  }
  const auto coordinates = static_cast<double>(2 * summary.inliers);
  const auto spare = coordinates - static_cast<double>(summary.free_parameters);
  summary.inlier_rms_px = std::sqrt(sum / coordinates);
  summary.noise_px = spare > 0 ? std::sqrt(sum / spare) : 0;
}

void check(const BalProblem& problem, const BundleOptions& options) {
  if (problem.observations.empty() || problem.cameras.size() % kCameraSize != 0 ||
      problem.points.size() % kPointSize != 0) {
    throw_bad_input(fmt::format(
        "there must be observations, {} numbers a camera and {} a point; got {}, {} and {}",
        kCameraSize, kPointSize, problem.observations.size(), problem.cameras.size(),
        problem.points.size()));
  }
  const auto check_index = [](const char* whose, std::size_t i, const char* what,
                              std::int32_t index, std::size_t count) {
    if (index >= 0 && static_cast<std::size_t>(index) < count) return;
    throw_bad_input(
        fmt::format("{} {}: {} {} does not exist; there are {}", whose, i + 1, what, index, count));
  };
  for (std::size_t i = 0; i < problem.observations.size(); ++i) {
    const Observation& seen = problem.observations[i];
    check_index("observation", i, "camera", seen.camera, problem.camera_count());
    check_index("observation", i, "point", seen.point, problem.point_count());
  }
  for (std::size_t i = 0; i < options.priors.size(); ++i) {
    check_index("prior", i, "camera", options.priors[i].camera, problem.camera_count());
  }
  for (std::size_t i = 0; i < options.relative.size(); ++i) {
    for (const std::int32_t camera : {options.relative[i].from, options.relative[i].to}) {
      check_index("relative pose", i, "camera", camera, problem.camera_count());
    }
    if (options.relative[i].from == options.relative[i].to) {
      throw_bad_input(fmt::format("relative pose {}: camera {} cannot stand against itself", i + 1,
                                  options.relative[i].from));
    }
  }
}

}  // namespace

std::string_view to_string(Loss loss) { return kLossNames[static_cast<std::size_t>(loss)]; }

std::vector<std::string> loss_names() { return {kLossNames.begin(), kLossNames.end()}; }

BundleSummary bundle_adjust(BalProblem& problem, const BundleOptions& options) {
  check(problem, options);
  const auto initial = residuals_px(problem);
  refuse_degenerate(problem, initial);
  BundleSummary summary;
  summary.initial_cost = half_squares(initial);

  Adjustment adjustment(problem, options);
  const auto solved = adjustment.solve();
  summary.stopped = solved.termination_type == ceres::USER_FAILURE;
  summary.iterations = static_cast<int>(solved.iterations.size()) - 1;
  if (summary.stopped) return summary;
  if (!solved.IsSolutionUsable()) {
    throw_bad_input("the problem cannot be adjusted: " + solved.message);
  }
  const auto residuals = residuals_px(problem);
  summary.final_cost = half_squares(residuals);
  summary.converged = solved.termination_type == ceres::CONVERGENCE;
  summary.free_parameters = solved.num_effective_parameters_reduced;
  judge_inliers(residuals, summary);
  return summary;
}

}  // namespace pirt::mapping
