#include "workloads/slam/workload/state_tensors.h"

#include <algorithm>
#include <array>
#include <concepts>
#include <string>
#include <tuple>
#include <type_traits>
#include <utility>

#include "workloads/base/error.h"

namespace pirt::slam {
namespace {

constexpr std::int64_t kDescriptorBytes = std::tuple_size_v<Descriptor>;
constexpr std::int64_t kMostWaiting = 1024;  // samples of the start: a quarter of a second
enum Part : std::uint8_t { kNumbers, kIntegers, kDescriptors, kParts };

template <typename T>
concept Scalar = std::integral<T> || std::is_enum_v<T>;

class Writer {
 public:
  explicit Writer(std::span<Tensor> tensors) : tensors_(tensors) {}

  void integer(Scalar auto value) {
    const auto bits = static_cast<std::uint64_t>(static_cast<std::int64_t>(value));
    const auto words = tensors_[kIntegers].as<std::int32_t>();
    const std::size_t at = 2 * next(kIntegers);
    words[at] = static_cast<std::int32_t>(static_cast<std::uint32_t>(bits));
    words[at + 1] = static_cast<std::int32_t>(static_cast<std::uint32_t>(bits >> 32U));
  }
  void integer(Nanos value) { integer(value.count()); }
  void number(double value) { tensors_[kNumbers].as<double>()[next(kNumbers)] = value; }
  template <typename Derived>
  void matrix(const Eigen::MatrixBase<Derived>& m) {
    if (m.size() == 0) return;
    const std::size_t at = next(kNumbers, static_cast<std::size_t>(m.size()));
    Eigen::Map<Eigen::MatrixXd>(&tensors_[kNumbers].as<double>()[at], m.rows(), m.cols()) =
        m.template cast<double>();
  }
  void square(const Eigen::MatrixXd& m) {
    integer(m.rows());
    matrix(m);
  }
  void bytes(const Descriptor& d) {
    const auto at = kDescriptorBytes * static_cast<std::int64_t>(next(kDescriptors));
    std::ranges::copy(d, tensors_[kDescriptors].as<std::uint8_t>().begin() + at);
  }
  template <typename T, typename Each>
  void list(const std::vector<T>& items, const Each& each) {
    integer(std::ssize(items));
    for (const T& item : items) each(item);
  }
  void finish() {
    for (std::size_t i = 0; i < kParts; ++i) {
      tensors_[i].set_rows(static_cast<std::int64_t>(used_[i]));
    }
  }

 private:
  /// Where the next @p count rows of a part begin.
  std::size_t next(Part part, std::size_t count = 1) {
    if (used_[part] + count > static_cast<std::size_t>(tensors_[part].dim(0))) {
      throw_bad_input("the SLAM's state has more " + tensors_[part].spec().name + " than the " +
                      std::to_string(tensors_[part].dim(0)) + " that its setup has room for");
    }
    return std::exchange(used_[part], used_[part] + count);
  }

  std::span<Tensor> tensors_;
  std::array<std::size_t, kParts> used_{};
};

class Reader {
 public:
  explicit Reader(std::span<const Tensor> tensors) : tensors_(tensors) {}

  template <Scalar T>
  void integer(T& value) {
    value = static_cast<T>(whole());
  }
  void integer(Nanos& value) { value = Nanos(whole()); }
  void number(double& value) { value = tensors_[kNumbers].as<double>()[next(kNumbers)]; }
  template <typename Derived>
  void matrix(Eigen::MatrixBase<Derived>& m) {
    if (m.size() == 0) return;
    const std::size_t at = next(kNumbers, static_cast<std::size_t>(m.size()));
    m = Eigen::Map<const Eigen::MatrixXd>(&tensors_[kNumbers].as<double>()[at], m.rows(), m.cols())
            .template cast<typename Derived::Scalar>();
  }
  void square(Eigen::MatrixXd& m) {
    const auto size = static_cast<Eigen::Index>(length(kNumbers));
    if (size * size > tensors_[kNumbers].rows()) refuse();
    m.resize(size, size);
    matrix(m);
  }
  void bytes(Descriptor& d) {
    const std::size_t at = kDescriptorBytes * next(kDescriptors);
    std::ranges::copy(tensors_[kDescriptors].as<std::uint8_t>().subspan(at, d.size()), d.begin());
  }
  template <typename T, typename Each>
  void list(std::vector<T>& items, const Each& each) {
    items.resize(length(Scalar<T> ? kIntegers : kNumbers));
    for (T& item : items) each(item);
  }
  void finish() const {
    for (std::size_t i = 0; i < kParts; ++i) {
      if (static_cast<std::int64_t>(used_[i]) != tensors_[i].rows()) refuse();
    }
  }

 private:
  [[noreturn]] static void refuse() {
    throw_bad_input("these tensors are no state of the SLAM: their lengths do not fit");
  }
  std::int64_t whole() {
    const std::size_t at = 2 * next(kIntegers);
    const auto words = tensors_[kIntegers].as<std::int32_t>();
    const auto low = static_cast<std::uint32_t>(words[at]);
    const auto high = static_cast<std::uint32_t>(words[at + 1]);
    return static_cast<std::int64_t>(std::uint64_t{high} << 32U | low);
  }
  /// Each item has at least one row of @p part.
  std::size_t length(Part part) {
    const std::int64_t size = whole();
    if (size < 0 || size > tensors_[part].rows()) refuse();
    return static_cast<std::size_t>(size);
  }
  std::size_t next(Part part, std::size_t count = 1) {
    if (static_cast<std::int64_t>(used_[part] + count) > tensors_[part].rows()) refuse();
    return std::exchange(used_[part], used_[part] + count);
  }

  std::span<const Tensor> tensors_;
  std::array<std::size_t, kParts> used_{};
};

void visit_pose(auto& a, auto& pose) {
  a.matrix(pose.rotation);
  a.matrix(pose.position);
}

void visit_sample(auto& a, auto& sample) {
  a.integer(sample.time);
  a.matrix(sample.gyro_rad_s);
  a.matrix(sample.accel_m_s2);
}

void visit_track(auto& a, auto& track) {
  a.integer(track.id);
  a.matrix(track.pixel);
  a.matrix(track.right_pixel);
  a.matrix(track.rest);
  a.integer(track.has_right);
  a.integer(track.landmark);
  a.integer(track.age);
  a.number(track.depth);
  a.bytes(track.descriptor);
  a.list(track.seen, [&](auto& seen) {
    a.integer(seen.frame);
    a.matrix(seen.left);
    a.matrix(seen.right);
    a.integer(seen.has_right);
  });
}

void visit_point(auto& a, auto& point) {
  a.integer(point.id);
  a.matrix(point.position);
  a.matrix(point.covariance);
  a.bytes(point.descriptor);
  a.matrix(point.seen_from);
  a.integer(point.last_frame);
  a.integer(point.milestone);
}

/// The one place that knows the order, for both directions.
void visit_points(auto& a, auto& state) {
  a.list(state.landmarks, [&](auto& landmark) {
    a.integer(landmark.id);
    a.matrix(landmark.position);
    a.bytes(landmark.descriptor);
    a.matrix(landmark.seen_from);
    a.integer(landmark.last_frame);
    a.integer(landmark.uses);
    a.integer(landmark.misses);
  });
  a.square(state.covariance);
  a.list(state.map, [&](auto& point) { visit_point(a, point); });
  a.list(state.tracks, [&](auto& track) { visit_track(a, track); });
}

void visit_similarity(auto& a, auto& similarity) {
  a.number(similarity.scale);
  visit_pose(a, similarity.pose);
}

void visit(auto& a, auto& state) {
  a.integer(state.status);
  a.integer(state.time);
  a.integer(state.frame);
  a.matrix(state.motion.rotation);
  a.matrix(state.motion.velocity);
  a.matrix(state.motion.position);
  a.matrix(state.motion.gyro_bias);
  a.matrix(state.motion.accel_bias);
  a.list(state.clones, [&](auto& clone) {
    a.integer(clone.frame);
    visit_pose(a, clone.body);
  });
  a.integer(state.milestones);
  if (state.milestones < 0 || std::cmp_greater(state.milestones, state.clones.size())) {
    throw_bad_input("these tensors are no state of the SLAM: more milestones than poses");
  }
  visit_points(a, state);
  a.integer(state.next_id);
  visit_sample(a, state.last_imu);
  a.list(state.waiting, [&](auto& sample) { visit_sample(a, sample); });
  visit_similarity(a, state.search.map_from_world);
  a.integer(state.search.views);
  a.list(state.search.points, [&](auto& point) { a.integer(point); });
  a.integer(state.search.direct);
  a.integer(state.search.mirrored);
  a.integer(state.in_map);
  visit_similarity(a, state.map_from_start);
  a.list(state.taken, [&](auto& point) { a.integer(point); });
  a.integer(state.previous_time);
  a.integer(state.still);
  a.integer(state.blind_frames);
  a.integer(state.good_frames);
  a.integer(state.still_frames);
  a.finish();
}

}  // namespace

std::vector<TensorSpec> state_specs(const Setup& setup) {
  const std::int64_t window = setup.most_clones + 1;
  const std::int64_t clones = window + setup.most_milestones;
  const std::int64_t landmarks = setup.most_landmarks;
  // Landmarks that are known again are followed beyond the others' number.
  const std::int64_t tracks = setup.most_tracks + setup.most_landmarks;
  const std::int64_t points = setup.most_map_points;
  const std::int64_t size = kMotionSize + kCloneSize * clones + 3 * landmarks;
  const auto known = setup.known ? std::ssize(*setup.known) : std::int64_t{0};
  const std::int64_t numbers = size * size + 47 + 12 * clones + 6 * landmarks + 15 * points +
                               tracks * (7 + 4 * window) + 6 * (kMostWaiting + 1);
  const std::int64_t integers = 23 + clones + 4 * landmarks + 3 * points +
                                tracks * (5 + 2 * window) + kMostWaiting + 1 + 2 * known;
  return {{"numbers", Element::kF64, {numbers}, true},
          {"integers", Element::kI32, {integers, 2}, true},
          {"descriptors", Element::kU8, {landmarks + tracks + points, kDescriptorBytes}, true}};
}

void write_state(const State& state, std::span<Tensor> tensors) {
  Writer writer(tensors);
  visit(writer, state);
}

State read_state(std::span<const Tensor> tensors) {
  State state;
  Reader reader(tensors);
  visit(reader, state);
  return state;
}

}  // namespace pirt::slam
