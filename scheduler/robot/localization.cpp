#include "scheduler/robot/localization.h"

#include <algorithm>
#include <condition_variable>
#include <deque>
#include <exception>
#include <iterator>
#include <memory>
#include <mutex>
#include <thread>
#include <utility>

#include "scheduler/robot/read_ahead.h"
#include "scheduler/robot/tracking.h"
#include "scheduler/runtime/time_limit.h"
#include "workloads/inputs/sequence/stamps.h"
#include "workloads/slam/workload/state_tensors.h"
#include "workloads/slam/workload/step_tensors.h"
#include "workloads/slam/workload/workloads.h"
#include "workloads/vision/vision.h"

namespace pirt {
namespace {

/// A frame on its way; futures of what it does not need stay empty.
struct Flight {
  std::size_t frame = 0;
  Nanos arrived{0};
  bool unusable = false;
  Tensor left;
  TaskFuture pyramid, pyramid_right, features;                 ///< Of the pictures alone.
  TaskFuture propagate, track, track_right, update_pose = {};  ///< After the frame before.
};

/// Absent where there are not two frames.
std::optional<Nanos> usual_period(const Sequence& sequence) {
  const Nanos step = usual_step(stamps_of(sequence.frames));
  return step > Nanos::zero() ? std::optional(step) : std::nullopt;
}

class RuntimeCaller final : public Caller {
 public:
  explicit RuntimeCaller(Runtime& runtime) : runtime_(runtime) {}
  void call(std::string_view workload, const std::vector<Tensor>& inputs,
            const TaskOptions& options, Done done) override {
    std::vector<TaskInput> given(inputs.begin(), inputs.end());
    static_cast<void>(runtime_.submit(
        workload, std::move(given), options,
        [done = std::move(done)](const TaskFuture& task, TaskEnd end) {
          done(end == TaskEnd::kCompleted ? std::optional(task.get()) : std::nullopt);
        }));
  }

 private:
  Runtime& runtime_;
};

class LiveLocalization {
 public:
  LiveLocalization(const Sequence& sequence, LocalizationOptions options)
      : sequence_(sequence),
        options_(std::move(options)),
        no_tracks_(empty(slam::track_specs(options_.setup))),
        no_features_(empty(slam::feature_specs())),
        no_better_(slam::tensors_of(slam::BetterMap{})),
        playing_(playing_times(stamps_of(sequence.frames))),
        period_(usual_period(sequence)) {
    const auto& camera = options_.setup.cameras[0];
    RuntimeOptions& runtime = options_.runtime;
    if (options_.stops) runtime.stop = [this] { return stops() > 0; };
    std::ranges::copy(slam::steps(options_.setup), std::back_inserter(runtime.workloads));
    runtime.workloads.emplace_back(vision::make_extract_features(camera.width, camera.height));
    std::ranges::copy(tracking_workloads(options_.setup), std::back_inserter(runtime.workloads));
    if (options_.companion != nullptr) options_.companion->list_workloads(runtime);
    owner_ = std::make_unique<Runtime>(runtime);
    runtime_ = owner_.get();
    caller_.emplace(*runtime_);
    if (options_.companion != nullptr) options_.companion->begin(*caller_);
  }
  ~LiveLocalization() { close(); }
  LiveLocalization(const LiveLocalization&) = delete;
  LiveLocalization& operator=(const LiveLocalization&) = delete;

  LocalizationResult run() {
    // At the sequence's own rate frames are read long before they come.
    ReadAhead pictures(
        sequence_.frames.size(), [this](std::size_t frame) { return read(frame); },
        !options_.own_rate);
    begin_ = clock_.now();
    for (std::size_t i = 0; i < sequence_.frames.size() && stops() == 0 && !failed(); ++i) {
      auto flight = std::make_shared<Flight>();
      flight->frame = i;
      const auto [left, right, failure] = pictures.next();
      if (left.empty()) {
        ++result_.run.left_out;
        continue;
      }
      if (!comes(*flight)) continue;
      look_at(*flight, left, right);
      if (options_.companion != nullptr) {
        options_.companion->arrived(sequence_.frames[i].time, left);
      }
      follow(flight);
    }
    finish();
    return std::move(result_);
  }

 private:
  static std::vector<Tensor> empty(const std::vector<TensorSpec>& specs) {
    auto tensors = make_tensors(specs);
    for (Tensor& tensor : tensors) tensor.set_rows(0);
    return tensors;
  }

  [[nodiscard]] bool failed() {
    const std::lock_guard lock(mutex_);
    return failure_ != nullptr;
  }
  [[nodiscard]] int stops() const { return options_.stops ? options_.stops() : 0; }

  [[nodiscard]] ReadAhead::Pictures read(std::size_t frame) const {
    const bool has_right = options_.setup.cameras.size() > 1 && sequence_.frames[frame].present[1];
    return {picture(frame, 0), has_right ? picture(frame, 1) : GreyImage{}};
  }
  GreyImage picture(std::size_t frame, std::size_t camera) const {
    GreyImage image = sequence_.image(frame, camera);
    if (options_.spoil && !image.empty()) options_.spoil(frame, camera, image);
    return image;
  }

  [[nodiscard]] Nanos due(std::size_t frame) const { return begin_ + playing_[frame]; }

  /// Waits for the frame's time, or for room. False: it is dropped, or nothing comes any more.
  bool comes(Flight& flight) {
    std::unique_lock lock(mutex_);
    const auto until = [&](Nanos at, const auto& reached) {
      while (!reached() && stops() == 0 && clock_.now() < at) {
        const Nanos look = std::min(at, clock_.now() + kLookEvery);
        changed_.wait_until(lock, std::chrono::steady_clock::time_point(look), reached);
      }
    };
    const auto has_room = [this] { return in_flight_ < options_.most_in_flight; };
    bool late = false;
    if (options_.own_rate) {
      // It counts from then, whenever it was there to be looked at; once the next one has come it
      // is not looked at any more.
      flight.arrived = due(flight.frame);
      until(flight.arrived, [] { return false; });
      late = flight.frame + 1 < sequence_.frames.size() && clock_.now() >= due(flight.frame + 1);
    } else {
      until(Nanos::max(), has_room);
      flight.arrived = clock_.now();
    }
    if (stops() > 0 || failure_ != nullptr) return false;
    ++result_.arrived;
    if (result_.arrived == 1) first_ = flight.arrived;
    if (late || !has_room()) {
      ++result_.dropped;
      return false;
    }
    ++in_flight_;
    return true;
  }

  /// All steps of a frame are due when the next one comes, whenever they begin.
  [[nodiscard]] TaskFuture submit(const Flight& flight, const char* workload,
                                  std::vector<TaskInput> inputs, std::vector<TaskFuture> after = {},
                                  Runtime::Callback callback = {}) {
    std::optional<Nanos> deadline;
    if (period_) deadline = flight.arrived + *period_ - clock_.now();
    return runtime_->submit(workload, std::move(inputs),
                            {.real_time = true, .deadline = deadline, .after = std::move(after)},
                            std::move(callback));
  }

  static void add(std::vector<TaskInput>& inputs, const TaskFuture& task, std::size_t first,
                  std::size_t count) {
    for (std::size_t i = first; i < first + count; ++i) inputs.emplace_back(task.output(i));
  }
  static void add(std::vector<TaskInput>& inputs, std::span<const Tensor> tensors) {
    for (const Tensor& tensor : tensors) inputs.emplace_back(tensor);
  }

  void look_at(Flight& flight, const GreyImage& left, const GreyImage& right) {
    flight.unusable = slam::is_blank(left);
    flight.left = slam::tensor_of(left);
    flight.pyramid = submit(flight, "pyramid", {flight.left});
    if (flight.unusable) return;
    flight.features = submit(flight, "extract_features", {flight.left});
    if (!right.empty()) {
      flight.pyramid_right = submit(flight, "pyramid_right", {slam::tensor_of(right)});
    }
  }

  /// What the state decides begins when the frame before has ended.
  void follow(const std::shared_ptr<Flight>& flight) {
    {
      const std::lock_guard lock(mutex_);
      if (std::exchange(following_, true)) {
        waiting_.push_back(flight);
        return;
      }
    }
    begin_steps(flight);
  }

  /// Without the mutex: a task whose predecessor has failed ends as it is submitted.
  void begin_steps(const std::shared_ptr<Flight>& flight) {
    Flight& f = *flight;
    f.propagate = submit_propagate(f);
    constexpr std::size_t kLevels = slam::kPyramidLevels;
    if (!f.unusable && before_.valid()) {
      std::vector<TaskInput> inputs;
      add(inputs, before_, 0, kLevels);
      add(inputs, f.pyramid, 0, kLevels);
      add(inputs, f.propagate, 2, 2);
      f.track = submit(f, "track", std::move(inputs));
    }
    if (f.track.valid() && f.pyramid_right.valid()) {
      std::vector<TaskInput> inputs;
      add(inputs, f.pyramid, 0, kLevels);
      add(inputs, f.pyramid_right, 0, kLevels);
      add(inputs, f.track, 0, 2);
      add(inputs, f.propagate, 4, 1);
      f.track_right = submit(f, "track_right", std::move(inputs));
    }
    std::vector<TaskInput> features;
    f.features.valid() ? add(features, f.features, 0, 3) : add(features, no_features_);
    std::vector<TaskInput> inputs;
    f.track.valid() ? add(inputs, f.track, 0, 2) : add(inputs, no_tracks_);
    f.track_right.valid() ? add(inputs, f.track_right, 0, 2) : add(inputs, no_tracks_);
    std::ranges::copy(features, std::back_inserter(inputs));
    // The pyramid is what the next frame is compared with.
    f.update_pose = submit(f, "update_pose", std::move(inputs), {f.propagate, f.pyramid});
    const auto better =
        options_.companion != nullptr ? options_.companion->better_map() : slam::BetterMap{};
    better.points.empty() ? add(features, no_better_) : add(features, slam::tensors_of(better));
    static_cast<void>(
        submit(f, "extend_map", std::move(features), {f.update_pose},
               [this, flight](const TaskFuture& task, TaskEnd end) { ended(flight, task, end); }));
  }

  /// One call takes so many samples; after a long gap there are more.
  TaskFuture submit_propagate(const Flight& flight) {
    const Nanos until = sequence_.frames[flight.frame].time;
    TaskFuture last;
    Nanos from = state_time_;
    while (true) {
      auto samples = slam::samples_between(sequence_, from, until);
      const bool all = samples.size() <= slam::kMostSamples;
      if (!all) samples = samples.first(slam::kMostSamples);
      from = all ? until : samples.back().time;
      std::vector<TaskInput> inputs;
      add(inputs, slam::tensors_of(samples, from));
      last = submit(flight, "imu_propagate", std::move(inputs),
                    last.valid() ? std::vector{last} : std::vector<TaskFuture>{});
      if (all) return last;
    }
  }

  /// On the thread that ended the frame's last task.
  void ended(const std::shared_ptr<Flight>& flight, const TaskFuture& extend, TaskEnd end) {
    const Flight& f = *flight;
    // The next frame has not begun: all of this is still ours.
    if (f.propagate.end() == TaskEnd::kCompleted) {
      state_time_ = sequence_.frames[f.frame].time;
    }
    if (f.update_pose.end() == TaskEnd::kCompleted) before_ = f.pyramid;
    count(f, extend);
    try {
      if (end == TaskEnd::kCompleted) record(f, extend);
    } catch (...) {
      const std::lock_guard lock(mutex_);
      if (failure_ == nullptr) failure_ = std::current_exception();
    }
    std::shared_ptr<Flight> next;
    {
      const std::lock_guard lock(mutex_);
      if (end != TaskEnd::kCompleted) ++result_.failed;
      --in_flight_;
      following_ = !waiting_.empty() && !closing_;
      if (following_) {
        next = std::move(waiting_.front());
        waiting_.pop_front();
      }
      changed_.notify_all();
    }
    if (next) begin_next(next);
  }

  /// On a thread of the runtime, which takes nothing new once it ends: then the frame goes with it.
  void begin_next(const std::shared_ptr<Flight>& next) {
    try {
      begin_steps(next);
    } catch (...) {
      const std::lock_guard lock(mutex_);
      if (!closing_ && failure_ == nullptr) failure_ = std::current_exception();
      ++result_.failed;
      --in_flight_;
      changed_.notify_all();
    }
  }

  /// What a frame that was localized leaves.
  void record(const Flight& f, const TaskFuture& extend) {
    result_.run.frames.push_back(result_of(f, extend));
    last_ = clock_.now();
    result_.latencies.push_back(last_ - f.arrived);
    const auto state = [this] { return slam::read_state(runtime_->state("slam")); };
    if (options_.show && f.frame >= *options_.show) {
      result_.shown = slam::show(state(), slam::image_of(f.left));
      options_.show.reset();
    }
    if (options_.companion != nullptr) {
      options_.companion->localized(result_.run.frames.back(), state);
    }
  }

  void count(const Flight& f, const TaskFuture& extend) {
    const auto served = [this](const char* workload, const TaskFuture& task) {
      if (task.valid() && task.end() == TaskEnd::kCompleted) {
        ++result_.served[workload][task.unit()];
      }
    };
    served("imu_propagate", f.propagate);
    served("pyramid", f.pyramid);
    served("pyramid_right", f.pyramid_right);
    served("extract_features", f.features);
    served("track", f.track);
    served("track_right", f.track_right);
    served("update_pose", f.update_pose);
    served("extend_map", extend);
  }

  [[nodiscard]] slam::FrameResult result_of(const Flight& f, const TaskFuture& extend) const {
    slam::FrameResult result;
    const auto outputs = extend.get();
    result.pose = {sequence_.frames[f.frame].time, slam::pose_of(outputs[2])};
    std::ranges::copy(outputs[3].as<double>(), result.position_covariance.data());
    result.status = static_cast<slam::Status>(outputs[4].as<std::int32_t>()[0]);
    result.in_map = outputs[4].as<std::int32_t>()[1] != 0;
    result.unusable = f.unusable;
    const auto counts = outputs[1].as<std::int32_t>();
    result.map_change = {counts[2], counts[3], counts[4]};
    const auto report = f.update_pose.get()[2].as<std::int32_t>();
    result.report = {report[0], report[1], report[2], report[3], report[4], report[5], report[6]};
    const auto took = [&](slam::Stage stage, const TaskFuture& task) {
      if (task.valid()) result.stage_time[static_cast<std::size_t>(stage)] += task.busy();
    };
    took(slam::Stage::kPropagate, f.propagate);
    took(slam::Stage::kPyramid, f.pyramid);
    took(slam::Stage::kExtract, f.features);
    took(slam::Stage::kTrack, f.track);
    took(slam::Stage::kTrackRight, f.pyramid_right);
    took(slam::Stage::kTrackRight, f.track_right);
    took(slam::Stage::kUpdate, f.update_pose);
    took(slam::Stage::kExtend, extend);
    return result;
  }

  void finish() {
    bool all = false;
    {
      std::unique_lock lock(mutex_);
      while (in_flight_ > 0 && failure_ == nullptr && stops() < 2) {
        changed_.wait_for(lock, kLookEvery,
                          [this] { return in_flight_ == 0 || failure_ != nullptr; });
      }
      all = in_flight_ == 0;
      if (failure_ != nullptr) std::rethrow_exception(failure_);
    }
    // What the companion asked for goes on.
    while (all && runtime_->statistics().live > 0 && stops() < 2) {
      std::this_thread::sleep_for(kLookEvery / 10);
    }
    all = all && stops() < 2;
    result_.run.last = slam::read_state(runtime_->state("slam"));
    if (options_.runtime.trace) write_trace();
    result_.statistics = runtime_->statistics();
    result_.problems = result_.statistics.problems;
    close();
    result_.stopped = stops() > 0;
    result_.failed += waiting_.size();
    result_.duration = std::max(last_ - first_, Nanos::zero());
  }

  /// Also of a run that was cut short: what nobody waits for any more is cancelled.
  void write_trace() {
    begin_no_more();
    try {
      runtime_->cancel_all();
      runtime_->write_trace();
    } catch (const Error& error) {
      result_.trace_problem = error.what();
    }
  }

  /// No frame begins any more.
  void begin_no_more() {
    const std::lock_guard lock(mutex_);
    closing_ = true;
  }
  /// The same, and what runs is waited for.
  void close() {
    begin_no_more();
    owner_.reset();
  }

  const Sequence& sequence_;
  LocalizationOptions options_;
  const std::vector<Tensor> no_tracks_, no_features_, no_better_;
  const std::vector<Nanos> playing_;   ///< When each frame comes after the first.
  const std::optional<Nanos> period_;  ///< Between two frames; a pose is due before the next comes.
  MachineClock clock_;
  Nanos begin_{0};
  Nanos first_{0}, last_{0};  ///< Arrival of the first frame, pose of the last.

  // Of whoever follows a frame.
  Nanos state_time_{0};
  TaskFuture before_;  ///< Pyramid of the frame that the state's tracks are of.
  LocalizationResult result_;

  std::mutex mutex_;
  std::condition_variable changed_;
  std::size_t in_flight_ = 0;
  bool following_ = false;  ///< The steps of some frame are on their way.
  bool closing_ = false;
  std::deque<std::shared_ptr<Flight>> waiting_;
  std::exception_ptr failure_;  ///< Of the companion, on a unit's thread.

  Runtime* runtime_ = nullptr;  ///< Also while it goes.
  std::optional<RuntimeCaller> caller_;
  std::unique_ptr<Runtime> owner_;  ///< Last: its threads use all of it.
};

}  // namespace

double LocalizationResult::rate_hz() const {
  return duration > Nanos::zero() ? static_cast<double>(run.frames.size()) / to_s(duration) : 0.0;
}

LocalizationResult localize_live(const Sequence& sequence, LocalizationOptions options) {
  return LiveLocalization(sequence, std::move(options)).run();
}

}  // namespace pirt
