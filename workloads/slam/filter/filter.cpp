#include "workloads/slam/filter/filter.h"

#include <Eigen/Cholesky>
#include <Eigen/QR>
#include <algorithm>
#include <cassert>
#include <cmath>
#include <utility>

#include "workloads/slam/filter/dense_update.h"

namespace pirt::slam {
namespace {

/// V(w), which takes the translation part of an SE(3) vector along the screw.
Eigen::Matrix3d left_jacobian(const Eigen::Vector3d& w) {
  const double angle = w.norm();
  const Eigen::Matrix3d k = cross_matrix(w);
  if (angle < 1e-6) return Eigen::Matrix3d::Identity() + 0.5 * k;
  const double square = angle * angle;
  return Eigen::Matrix3d::Identity() + (1 - std::cos(angle)) / square * k +
         (angle - std::sin(angle)) / (square * angle) * k * k;
}

/// Points go with their milestones, whose poses were @p before.
void move_map(State& state, std::span<const Pose> before) {
  std::vector<Pose> moves;
  for (std::size_t i = 0; i < before.size(); ++i) {
    moves.push_back(state.clones[i].body * before[i].inverse());
  }
  const auto milestones = std::span(state.clones).first(before.size());
  for (MapPoint& point : state.map) {
    if (point.milestone < 0) continue;
    const auto its = std::ranges::lower_bound(milestones, point.milestone, {}, &Clone::frame);
    if (its == milestones.end()) continue;
    const Pose& move = moves[static_cast<std::size_t>(its - milestones.begin())];
    point.position = move * point.position;
    point.seen_from = move * point.seen_from;
  }
}

/// A landmark's own error, which is that beside the newest clone's place, grows by this.
struct Growth {
  std::size_t landmark = 0;
  Eigen::Matrix3d by;
};

void grow_errors(State& state, std::span<const Growth> growths) {
  if (growths.empty()) return;
  Eigen::MatrixXd& p = state.covariance;
  const int place = State::clone_at(state.clones.size() - 1) + 3;
  for (Eigen::Index c = 0; c < p.cols(); ++c) {
    for (const auto& [landmark, by] : growths) {
      auto its = p.block<3, 1>(state.landmark_at(landmark), c);
      const Eigen::Vector3d shared = p.block<3, 1>(place, c);
      its = shared + by * (its - shared);
    }
  }
  for (const auto& [landmark, by] : growths) {
    auto its = p.middleCols<3>(state.landmark_at(landmark));
    const auto shared = p.middleCols<3>(place);
    its = (shared + (its - shared) * by.transpose()).eval();
  }
}

/// Moves landmarks with the newest clone, and then each by its own correction: its direction from
/// there, and the inverse of its range, in which what is seen of it is nearly linear. Its range is
/// what is known least; corrected in metres, one camera's scale comes out too small, since the
/// square of each error has the same sign.
/// @param moved  What the clone is moved by.
/// @source  Civera, Davison and Montiel, Inverse depth parametrization for monocular SLAM, TRO
/// 2008.
void correct_landmarks(State& state, const Eigen::VectorXd& d, const Pose& moved,
                       const Eigen::Matrix3d& screw) {
  constexpr double kMost = 0.5;    // of a range, in one correction
  constexpr double kLeast = 1e-3;  // of a range, that errors change by
  const Eigen::Vector3d& from = state.clones.back().body.position;
  const Eigen::Vector3d shared = d.segment<3>(State::clone_at(state.clones.size() - 1) + 3);
  std::vector<Growth> growths;
  for (std::size_t i = 0; i < state.landmarks.size(); ++i) {
    Eigen::Vector3d& p = state.landmarks[i].position;
    const Eigen::Vector3d arm = moved * p - from;
    const double range = std::max(arm.norm(), 1e-6);
    const Eigen::Vector3d along = arm / range;
    const Eigen::Vector3d own = screw * (d.segment<3>(state.landmark_at(i)) - shared) / range;
    const double farther = along.dot(own);
    const double grows = 1 / (1 - std::clamp(farther, -1.0, kMost));
    const Eigen::Vector3d across = own - farther * along;
    p = from + grows * range * (along + across).normalized();
    if (std::abs(grows - 1) < kLeast) continue;
    // Of what lies across as the range, of what lies along as its square.
    growths.push_back(
        {i, grows * (Eigen::Matrix3d::Identity() + (grows - 1) * along * along.transpose())});
  }
  grow_errors(state, growths);
}

/// Adds a correction, each group of vectors along the screw of its own rotation error.
void correct(State& state, const Eigen::VectorXd& d) {
  MotionState& m = state.motion;
  const Eigen::Vector3d turn = d.head<3>();
  const Eigen::Matrix3d rotation = rotation_of(turn);
  const Eigen::Matrix3d screw = left_jacobian(turn);
  m.rotation = nearest_rotation(rotation * m.rotation);
  m.velocity = rotation * m.velocity + screw * d.segment<3>(kVelocityAt);
  m.position = rotation * m.position + screw * d.segment<3>(kPositionAt);
  m.gyro_bias += d.segment<3>(kGyroBiasAt);
  m.accel_bias += d.segment<3>(kAccelBiasAt);
  std::vector<Pose> milestones;
  for (int i = 0; i < state.milestones; ++i) {
    milestones.push_back(state.clones[static_cast<std::size_t>(i)].body);
  }
  Pose moved;
  Eigen::Matrix3d its_screw = screw;
  for (std::size_t i = 0; i < state.clones.size(); ++i) {
    const Eigen::Vector3d its_turn = d.segment<3>(State::clone_at(i));
    its_screw = left_jacobian(its_turn);
    moved = {rotation_of(its_turn), its_screw * d.segment<3>(State::clone_at(i) + 3)};
    Pose& body = state.clones[i].body;
    body = {nearest_rotation(moved.rotation * body.rotation), moved * body.position};
  }
  if (!state.landmarks.empty()) correct_landmarks(state, d, moved, its_screw);
  move_map(state, milestones);
}

/// Rows [at, at + count) and columns alike, taken out.
void erase_from(Eigen::MatrixXd& p, int at, int count) {
  const auto n = p.rows();
  const auto tail = n - at - count;
  Eigen::MatrixXd kept(n - count, n - count);
  kept.topLeftCorner(at, at) = p.topLeftCorner(at, at);
  kept.topRightCorner(at, tail) = p.topRightCorner(at, tail);
  kept.bottomLeftCorner(tail, at) = p.bottomLeftCorner(tail, at);
  kept.bottomRightCorner(tail, tail) = p.bottomRightCorner(tail, tail);
  p.swap(kept);
}

/// Landmarks' errors relative to the rotation error at @p from become relative to that at @p to:
/// the error of the point itself, turn x f + error, does not change.
void change_anchor(State& state, int from, int to) {
  Eigen::MatrixXd& p = state.covariance;
  const Eigen::MatrixXd rows = p.middleRows<3>(to) - p.middleRows<3>(from);
  for (std::size_t i = 0; i < state.landmarks.size(); ++i) {
    p.middleRows<3>(state.landmark_at(i)) += cross_matrix(state.landmarks[i].position) * rows;
  }
  const Eigen::MatrixXd columns = p.middleCols<3>(to) - p.middleCols<3>(from);
  for (std::size_t i = 0; i < state.landmarks.size(); ++i) {
    p.middleCols<3>(state.landmark_at(i)) +=
        columns * cross_matrix(state.landmarks[i].position).transpose();
  }
}

/// to += a * b. Of few columns of a, packing them for Eigen's blocks takes longer than the product.
template <class A, class B>
void add_product(Eigen::Ref<Eigen::MatrixXd> to, const A& a, const B& b) {
  constexpr Eigen::Index kFew = 8;
  if (a.cols() <= kFew) {
    to += a.lazyProduct(b);
  } else {
    to.noalias() += a * b;
  }
}

Eigen::Index rows_of(const std::vector<RowBlock>& blocks) {
  Eigen::Index rows = 0;
  for (const auto& block : blocks) rows += block.residual.size();
  return rows;
}

/// Rows [at, at + count) of a block turned so that only its first three see a point.
RowBlock turned(const RowBlock& block, const Eigen::MatrixXd& to_point, Eigen::Index at,
                Eigen::Index count) {
  const Eigen::HouseholderQR<Eigen::MatrixXd> qr(to_point);
  const auto part_of = [&](const Eigen::MatrixXd& m) -> Eigen::MatrixXd {
    const Eigen::MatrixXd all = qr.householderQ().transpose() * m;
    return all.middleRows(at, count);
  };
  RowBlock some;
  some.sigma = block.sigma;
  some.residual = part_of(block.residual);
  for (const auto& part : block.parts) some.parts.push_back({part.at, part_of(part.values)});
  return some;
}

}  // namespace

Eigen::MatrixXd predicted_covariance(const State& state, const RowBlock& block) {
  std::vector<Eigen::Index> columns;
  for (const auto& part : block.parts) {
    for (Eigen::Index i = 0; i < part.values.cols(); ++i) columns.push_back(part.at + i);
  }
  Eigen::MatrixXd jacobian(block.residual.size(), std::ssize(columns));
  Eigen::Index at = 0;
  for (const auto& part : block.parts) {
    jacobian.middleCols(at, part.values.cols()) = part.values;
    at += part.values.cols();
  }
  const Eigen::MatrixXd its = state.covariance(columns, columns);
  return jacobian * its * jacobian.transpose();
}

double innovation(const State& state, const RowBlock& block) {
  Eigen::MatrixXd s = predicted_covariance(state, block);
  s.diagonal().array() += block.sigma * block.sigma;
  return block.residual.dot(s.ldlt().solve(block.residual));
}

double median(std::vector<double> values) {
  const auto middle = values.begin() + std::ssize(values) / 2;
  std::ranges::nth_element(values, middle);
  return *middle;
}

double chi_square_95(int degrees) {
  const double k = degrees;
  const double root = 1 - 2 / (9 * k) + 1.6448536 * std::sqrt(2 / (9 * k));
  return k * root * root * root;
}

bool kalman_update(State& state, const std::vector<RowBlock>& blocks) {
  const auto rows = rows_of(blocks);
  if (rows == 0) return true;
  const auto n = state.covariance.rows();
  Eigen::MatrixXd ph = Eigen::MatrixXd::Zero(n, rows);  // P H^T
  Eigen::MatrixXd s = Eigen::MatrixXd::Zero(rows, rows);
  Eigen::VectorXd residual(rows);
  Eigen::Index at = 0;
  for (const auto& block : blocks) {
    const auto count = block.residual.size();
    for (const auto& part : block.parts) {
      add_product(ph.middleCols(at, count),
                  state.covariance.middleCols(part.at, part.values.cols()),
                  part.values.transpose());
    }
    residual.segment(at, count) = block.residual;
    at += count;
  }
  at = 0;
  for (const auto& block : blocks) {
    const auto count = block.residual.size();
    for (const auto& part : block.parts) {
      add_product(s.middleRows(at, count), part.values, ph.middleRows(part.at, part.values.cols()));
    }
    s.diagonal().segment(at, count).array() += block.sigma * block.sigma;
    at += count;
  }
  const auto correction = dense_update(state.covariance, s, ph, residual);
  if (!correction) return false;
  correct(state, *correction);
  return true;
}

void add_clone(State& state, std::int64_t frame) {
  const auto n = state.covariance.rows();
  const int at = State::clone_at(state.clones.size());
  const auto tail = n - at;
  // The clone's rows and columns are those of the body's rotation and position.
  const Eigen::MatrixXd& p = state.covariance;
  Eigen::MatrixXd wide(n, n + kCloneSize);
  wide.leftCols(at) = p.leftCols(at);
  wide.middleCols<3>(at) = p.leftCols<3>();
  wide.middleCols<3>(at + 3) = p.middleCols<3>(kPositionAt);
  wide.rightCols(tail) = p.rightCols(tail);
  Eigen::MatrixXd grown(n + kCloneSize, n + kCloneSize);
  grown.topRows(at) = wide.topRows(at);
  grown.middleRows<3>(at) = wide.topRows<3>();
  grown.middleRows<3>(at + 3) = wide.middleRows<3>(kPositionAt);
  grown.bottomRows(tail) = wide.bottomRows(tail);
  state.covariance.swap(grown);
  state.clones.push_back({frame, state.body()});
  state.frame = frame;
  if (state.clones.size() > 1) change_anchor(state, State::clone_at(state.clones.size() - 2), at);
}

void remove_clone(State& state, std::size_t index) {
  const std::int64_t frame = state.clones[index].frame;
  if (index + 1 == state.clones.size()) {
    assert(state.landmarks.empty() || index > 0);
    if (index > 0) change_anchor(state, State::clone_at(index), State::clone_at(index - 1));
  }
  if (std::cmp_less(index, state.milestones)) --state.milestones;
  erase_from(state.covariance, State::clone_at(index), kCloneSize);
  state.clones.erase(state.clones.begin() + static_cast<std::ptrdiff_t>(index));
  for (auto& track : state.tracks) {
    std::erase_if(track.seen, [&](const Observation& seen) { return seen.frame == frame; });
  }
}

void remove_landmarks(State& state, std::span<const std::size_t> indices) {
  if (indices.empty()) return;
  std::vector<Eigen::Index> kept;
  std::vector<Landmark> landmarks;
  for (Eigen::Index i = 0; i < state.landmark_at(0); ++i) kept.push_back(i);
  for (std::size_t i = 0; i < state.landmarks.size(); ++i) {
    const Landmark& landmark = state.landmarks[i];
    if (!std::ranges::binary_search(indices, i)) {
      landmarks.push_back(landmark);
      for (int k = 0; k < 3; ++k) kept.push_back(state.landmark_at(i) + k);
      continue;
    }
    for (auto& track : state.tracks) {
      if (track.landmark == landmark.id) track.landmark = -1;
    }
  }
  Eigen::MatrixXd p = state.covariance(kept, kept);
  state.covariance.swap(p);
  state.landmarks = std::move(landmarks);
}

void add_landmarks(State& state, std::span<const NewLandmark> added) {
  if (added.empty()) return;
  const auto n = state.covariance.rows();
  const auto count = 3 * std::ssize(added);
  Eigen::MatrixXd hp = Eigen::MatrixXd::Zero(count, n);
  Eigen::MatrixXd own = Eigen::MatrixXd::Zero(count, count);
  std::vector<std::vector<Eigen::MatrixXd>> reduced(added.size());
  for (std::size_t i = 0; i < added.size(); ++i) {
    const RowBlock& block = added[i].block;
    const Eigen::HouseholderQR<Eigen::MatrixXd> qr(added[i].to_point);
    const Eigen::Matrix3d triangle =
        Eigen::Matrix3d(qr.matrixQR().topRows<3>().triangularView<Eigen::Upper>());
    const Eigen::MatrixXd q =
        qr.householderQ() * Eigen::MatrixXd::Identity(block.residual.size(), 3);
    // error of the point = R^-1 (q^T residual - q^T H error - noise)
    const Eigen::Matrix3d inverse =
        triangle.triangularView<Eigen::Upper>().solve(Eigen::Matrix3d::Identity());
    const auto at = static_cast<Eigen::Index>(3 * i);
    for (const auto& part : block.parts) {
      reduced[i].emplace_back(inverse * q.transpose() * part.values);
      hp.middleRows<3>(at).noalias() +=
          reduced[i].back() * state.covariance.middleRows(part.at, part.values.cols());
    }
    own.block<3, 3>(at, at) = block.sigma * block.sigma * inverse * inverse.transpose();
  }
  for (std::size_t i = 0; i < added.size(); ++i) {
    const auto at = static_cast<Eigen::Index>(3 * i);
    for (std::size_t k = 0; k < reduced[i].size(); ++k) {
      const Eigen::MatrixXd& part = reduced[i][k];
      own.middleCols<3>(at).noalias() +=
          hp.middleCols(added[i].block.parts[k].at, part.cols()) * part.transpose();
    }
    state.landmarks.push_back(added[i].landmark);
  }
  Eigen::MatrixXd grown(n + count, n + count);
  grown.topLeftCorner(n, n) = state.covariance;
  grown.bottomLeftCorner(count, n) = -hp;
  grown.topRightCorner(n, count) = -hp.transpose();
  grown.bottomRightCorner(count, count) = 0.5 * (own + own.transpose());
  state.covariance.swap(grown);
}

void add_known_landmarks(State& state, std::span<const Landmark> landmarks,
                         const Eigen::MatrixXd& covariance) {
  const auto n = state.covariance.rows();
  const auto count = 3 * std::ssize(landmarks);
  const int turn = State::clone_at(state.clones.size() - 1);
  // f = error of the place + place x turn of the newest clone
  Eigen::MatrixXd arms(count, 3);
  for (Eigen::Index i = 0; i < count / 3; ++i) {
    arms.middleRows<3>(3 * i) = cross_matrix(landmarks[static_cast<std::size_t>(i)].position);
  }
  Eigen::MatrixXd grown(n + count, n + count);
  grown.topLeftCorner(n, n) = state.covariance;
  grown.bottomLeftCorner(count, n) = arms * state.covariance.middleRows<3>(turn);
  grown.topRightCorner(n, count) = grown.bottomLeftCorner(count, n).transpose();
  grown.bottomRightCorner(count, count) =
      covariance + arms * state.covariance.block<3, 3>(turn, turn) * arms.transpose();
  state.covariance.swap(grown);
  state.landmarks.insert(state.landmarks.end(), landmarks.begin(), landmarks.end());
}

PlaceCovariance covariance_at(const Eigen::Vector3d& at, const Eigen::Vector3d& turn_sigma_rad,
                              double position_sigma, double scale_sigma) {
  // The position error about the origin is that at the point + point x turn - scale point.
  Eigen::Matrix<double, 7, 7> j = Eigen::Matrix<double, 7, 7>::Identity();
  j.block<3, 3>(3, 0) = cross_matrix(at);
  j.block<3, 1>(3, 6) = -at;
  Eigen::Matrix<double, 7, 1> sigma;
  sigma << turn_sigma_rad, Eigen::Vector3d::Constant(position_sigma), scale_sigma;
  return j * sigma.cwiseAbs2().asDiagonal() * j.transpose();
}

void move_world(State& state, const Similarity& to_world, const PlaceCovariance& covariance) {
  const Eigen::Matrix3d& r = to_world.pose.rotation;
  const double s = to_world.scale;
  const auto moved = [&](Pose& pose) {
    pose = {nearest_rotation(r * pose.rotation), to_world * pose.position};
  };
  const Eigen::Matrix3d lever = cross_matrix(to_world.pose.position) * r;
  const auto n = state.covariance.rows();
  // Each group of errors turns; positions' errors are about the new origin.
  Eigen::MatrixXd turned(n, n);
  Eigen::MatrixXd shared = Eigen::MatrixXd::Zero(n, 7);  // of the place's own error
  const auto rotation_rows = [&](const Eigen::MatrixXd& p, Eigen::MatrixXd& out, int at) {
    out.middleRows<3>(at) = r * p.middleRows<3>(at);
  };
  const auto position_rows = [&](const Eigen::MatrixXd& p, Eigen::MatrixXd& out, int at, int turn) {
    out.middleRows<3>(at) = s * r * p.middleRows<3>(at) + lever * p.middleRows<3>(turn);
  };
  const int newest = State::clone_at(state.clones.size() - 1);
  const auto all_rows = [&](const Eigen::MatrixXd& p, Eigen::MatrixXd& out) {
    rotation_rows(p, out, 0);
    out.middleRows<3>(kVelocityAt) = s * r * p.middleRows<3>(kVelocityAt);
    position_rows(p, out, kPositionAt, 0);
    out.middleRows<6>(kGyroBiasAt) = p.middleRows<6>(kGyroBiasAt);
    for (std::size_t i = 0; i < state.clones.size(); ++i) {
      rotation_rows(p, out, State::clone_at(i));
      position_rows(p, out, State::clone_at(i) + 3, State::clone_at(i));
    }
    for (std::size_t i = 0; i < state.landmarks.size(); ++i) {
      position_rows(p, out, state.landmark_at(i), newest);
    }
  };
  all_rows(state.covariance, turned);
  const Eigen::MatrixXd half = turned.transpose();
  all_rows(half, turned);

  MotionState& m = state.motion;
  m.rotation = nearest_rotation(r * m.rotation);
  m.velocity = s * r * m.velocity;
  m.position = to_world * m.position;
  const auto shares = [&](int turn, int position, const Eigen::Vector3d& place) {
    if (turn >= 0) shared.block<3, 3>(turn, 0).setIdentity();
    shared.block<3, 3>(position, 3).setIdentity();
    shared.block<3, 1>(position, 6) = place;
  };
  shares(0, kPositionAt, m.position);
  shared.block<3, 1>(kVelocityAt, 6) = m.velocity;
  for (std::size_t i = 0; i < state.clones.size(); ++i) {
    moved(state.clones[i].body);
    shares(State::clone_at(i), State::clone_at(i) + 3, state.clones[i].body.position);
  }
  for (std::size_t i = 0; i < state.landmarks.size(); ++i) {
    Landmark& landmark = state.landmarks[i];
    landmark.position = to_world * landmark.position;
    landmark.seen_from = to_world * landmark.seen_from;
    shares(-1, state.landmark_at(i), landmark.position);
  }
  state.covariance = turned + shared * covariance * shared.transpose();
  for (MapPoint& point : state.map) move_point(point, to_world);
  for (Track& track : state.tracks) track.depth *= s;
}

void move_point(MapPoint& point, const Similarity& to_world) {
  const double s = to_world.scale;
  const Eigen::Matrix3d& r = to_world.pose.rotation;
  point.position = to_world * point.position;
  point.seen_from = to_world * point.seen_from;
  point.covariance = s * s * r * point.covariance * r.transpose();
}

RowBlock without_point(const RowBlock& block, const Eigen::MatrixXd& to_point) {
  return turned(block, to_point, 3, block.residual.size() - 3);
}

RowBlock in_three_rows(const RowBlock& block) {
  if (block.residual.size() <= 3) return block;
  return turned(block, block.parts.back().values, 0, 3);
}

RowBlock compressed(const std::vector<RowBlock>& blocks, int first_column, int columns) {
  const auto rows = rows_of(blocks);
  RowBlock all;
  all.sigma = blocks.front().sigma;
  all.residual.resize(rows);
  Eigen::MatrixXd jacobian = Eigen::MatrixXd::Zero(rows, columns);
  Eigen::Index at = 0;
  for (const auto& block : blocks) {
    const auto count = block.residual.size();
    for (const auto& part : block.parts) {
      jacobian.block(at, part.at - first_column, count, part.values.cols()) += part.values;
    }
    all.residual.segment(at, count) = block.residual;
    at += count;
  }
  if (rows > columns) {
    const Eigen::HouseholderQR<Eigen::MatrixXd> qr(jacobian);
    const Eigen::VectorXd turned = qr.householderQ().transpose() * all.residual;
    const Eigen::MatrixXd triangle = qr.matrixQR().topRows(columns).triangularView<Eigen::Upper>();
    all.residual = turned.head(columns);
    jacobian = triangle;
  }
  all.parts.push_back({first_column, std::move(jacobian)});
  return all;
}

}  // namespace pirt::slam
