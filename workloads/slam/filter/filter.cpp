#include "workloads/slam/filter/filter.h"

#include <Eigen/Cholesky>
#include <Eigen/QR>
#include <cassert>
#include <cmath>

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
  Eigen::Vector3d anchor_turn = turn;
  for (std::size_t i = 0; i < state.clones.size(); ++i) {
    Pose& body = state.clones[i].body;
    anchor_turn = d.segment<3>(State::clone_at(i));
    const Eigen::Matrix3d r = rotation_of(anchor_turn);
    body.rotation = nearest_rotation(r * body.rotation);
    body.position =
        r * body.position + left_jacobian(anchor_turn) * d.segment<3>(State::clone_at(i) + 3);
  }
  const Eigen::Matrix3d anchor = rotation_of(anchor_turn);
  const Eigen::Matrix3d anchor_screw = left_jacobian(anchor_turn);
  for (std::size_t i = 0; i < state.landmarks.size(); ++i) {
    Eigen::Vector3d& p = state.landmarks[i].position;
    p = anchor * p + anchor_screw * d.segment<3>(state.landmark_at(i));
  }
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

Eigen::Index rows_of(const std::vector<RowBlock>& blocks) {
  Eigen::Index rows = 0;
  for (const auto& block : blocks) rows += block.residual.size();
  return rows;
}

}  // namespace

double innovation(const State& state, const RowBlock& block) {
  const auto rows = block.residual.size();
  Eigen::MatrixXd s = block.sigma * block.sigma * Eigen::MatrixXd::Identity(rows, rows);
  for (const auto& a : block.parts) {
    for (const auto& b : block.parts) {
      s.noalias() += a.values *
                     state.covariance.block(a.at, b.at, a.values.cols(), b.values.cols()) *
                     b.values.transpose();
    }
  }
  return block.residual.dot(s.ldlt().solve(block.residual));
}

double chi_square_95(int degrees) {
  const double k = degrees;
  const double root = 1 - 2 / (9 * k) + 1.6448536 * std::sqrt(2 / (9 * k));
  return k * root * root * root;
}

void kalman_update(State& state, const std::vector<RowBlock>& blocks) {
  const auto rows = rows_of(blocks);
  if (rows == 0) return;
  const auto n = state.covariance.rows();
  Eigen::MatrixXd ph = Eigen::MatrixXd::Zero(n, rows);  // P H^T
  Eigen::MatrixXd s = Eigen::MatrixXd::Zero(rows, rows);
  Eigen::VectorXd residual(rows);
  Eigen::Index at = 0;
  for (const auto& block : blocks) {
    const auto count = block.residual.size();
    for (const auto& part : block.parts) {
      ph.middleCols(at, count).noalias() +=
          state.covariance.middleCols(part.at, part.values.cols()) * part.values.transpose();
    }
    residual.segment(at, count) = block.residual;
    at += count;
  }
  at = 0;
  for (const auto& block : blocks) {
    const auto count = block.residual.size();
    for (const auto& part : block.parts) {
      s.middleRows(at, count).noalias() += part.values * ph.middleRows(part.at, part.values.cols());
    }
    s.diagonal().segment(at, count).array() += block.sigma * block.sigma;
    at += count;
  }
  // P - K S K^T = P - W W^T with W = P H^T L^-T, S = L L^T.
  const Eigen::LLT<Eigen::MatrixXd> cholesky(s);
  const Eigen::VectorXd correction = ph * cholesky.solve(residual);
  cholesky.matrixU().solveInPlace<Eigen::OnTheRight>(ph);
  state.covariance.selfadjointView<Eigen::Lower>().rankUpdate(ph, -1.0);
  state.covariance.triangularView<Eigen::StrictlyUpper>() =
      state.covariance.transpose().triangularView<Eigen::StrictlyUpper>();
  correct(state, correction);
}

void add_clone(State& state, std::int64_t frame) {
  const auto n = state.covariance.rows();
  const int at = State::clone_at(state.clones.size());
  const auto tail = n - at;
  // Which old row each new one is: the clone's are those of the body's rotation and position.
  Eigen::VectorXi source(n + kCloneSize);
  for (int i = 0; i < at; ++i) source(i) = i;
  for (int i = 0; i < 3; ++i) source(at + i) = i, source(at + 3 + i) = kPositionAt + i;
  for (int i = 0; i < tail; ++i) source(at + kCloneSize + i) = at + i;
  Eigen::MatrixXd grown(n + kCloneSize, n + kCloneSize);
  for (Eigen::Index c = 0; c < grown.cols(); ++c) {
    for (Eigen::Index r = 0; r < grown.rows(); ++r) {
      grown(r, c) = state.covariance(source(r), source(c));
    }
  }
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
  erase_from(state.covariance, State::clone_at(index), kCloneSize);
  state.clones.erase(state.clones.begin() + static_cast<std::ptrdiff_t>(index));
  for (auto& track : state.tracks) {
    std::erase_if(track.seen, [&](const Observation& seen) { return seen.frame == frame; });
  }
}

void remove_landmark(State& state, std::size_t index) {
  for (auto& track : state.tracks) {
    if (track.landmark == state.landmarks[index].id) track.landmark = -1;
  }
  erase_from(state.covariance, state.landmark_at(index), 3);
  state.landmarks.erase(state.landmarks.begin() + static_cast<std::ptrdiff_t>(index));
}

void add_landmark(State& state, const Landmark& landmark, const RowBlock& block,
                  const Eigen::MatrixXd& to_point) {
  const auto rows = block.residual.size();
  const Eigen::HouseholderQR<Eigen::MatrixXd> qr(to_point);
  const Eigen::Matrix3d triangle =
      Eigen::Matrix3d(qr.matrixQR().topRows<3>().triangularView<Eigen::Upper>());
  const Eigen::MatrixXd q = qr.householderQ() * Eigen::MatrixXd::Identity(rows, 3);
  // error of the point = R^-1 (q^T residual - q^T H error - noise)
  const Eigen::Matrix3d inverse =
      triangle.triangularView<Eigen::Upper>().solve(Eigen::Matrix3d::Identity());
  const auto n = state.covariance.rows();
  Eigen::MatrixXd hp = Eigen::MatrixXd::Zero(3, n);
  std::vector<Eigen::MatrixXd> reduced;
  for (const auto& part : block.parts) {
    reduced.emplace_back(inverse * q.transpose() * part.values);
    hp.noalias() += reduced.back() * state.covariance.middleRows(part.at, part.values.cols());
  }
  Eigen::Matrix3d own = block.sigma * block.sigma * inverse * inverse.transpose();
  for (std::size_t i = 0; i < reduced.size(); ++i) {
    own.noalias() += hp.middleCols(block.parts[i].at, reduced[i].cols()) * reduced[i].transpose();
  }
  Eigen::MatrixXd grown(n + 3, n + 3);
  grown.topLeftCorner(n, n) = state.covariance;
  grown.bottomLeftCorner(3, n) = -hp;
  grown.topRightCorner(n, 3) = -hp.transpose();
  grown.bottomRightCorner<3, 3>() = own;
  state.covariance.swap(grown);
  state.landmarks.push_back(landmark);
}

RowBlock without_point(const RowBlock& block, const Eigen::MatrixXd& to_point) {
  const auto rows = block.residual.size();
  const Eigen::HouseholderQR<Eigen::MatrixXd> qr(to_point);
  const auto turned = [&](const Eigen::MatrixXd& m) -> Eigen::MatrixXd {
    const Eigen::MatrixXd all = qr.householderQ().transpose() * m;
    return all.bottomRows(rows - 3);
  };
  RowBlock left;
  left.sigma = block.sigma;
  left.residual = turned(block.residual);
  for (const auto& part : block.parts) left.parts.push_back({part.at, turned(part.values)});
  return left;
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
