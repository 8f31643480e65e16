#include <algorithm>
#include <map>
#include <memory>
#include <numeric>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <variant>
#include <vector>

#include "scheduler/robot/localization.h"
#include "scheduler/runtime/samples.h"
#include "scheduler/runtime/time_limit.h"
#include "workloads/backends/registry.h"
#include "workloads/catalog/catalog.h"
#include "workloads/inputs/sequence/stamps.h"
#include "workloads/model/function_kernel.h"

namespace pirt {
namespace {

Nanos steps_of(const slam::FrameResult& frame) {
  return std::accumulate(frame.stage_time.begin(), frame.stage_time.end(), Nanos::zero());
}

/// Each task when it is asked for, on the calling thread.
class CpuCaller final : public Caller {
 public:
  explicit CpuCaller(const RuntimeOptions& listed) : samples_(1) {
    device_ = find_backend("cpu").open({.unit = "cpu", .cores = {}, .device = "", .script = ""});
    for (const ServedWorkload& served : listed.workloads) {
      if (const auto* const own = std::get_if<OwnWorkload>(&served)) {
        add(own->name, std::make_unique<FunctionKernel>(own->kernels.at("cpu")), own->outputs);
        continue;
      }
      const auto& name = std::get<std::string>(served);
      const Workload& workload = find_workload(name);
      const auto first = listed.first_inputs.find(name);
      if (first != listed.first_inputs.end()) samples_.begin_with(workload, *first->second);
      const auto& sample = samples_.of(workload, 0);
      add(name, device_->prepare(workload, sample->parameters), workload.outputs);
      // As in the runtime: some compile at the first call.
      compute(prepared_.at(name), sample->inputs);
    }
  }
  void call(std::string_view workload, const std::vector<Tensor>& inputs, const TaskOptions&,
            Done done) override {
    Prepared& prepared = prepared_.find(workload)->second;
    const Nanos begin = clock_.now();
    try {
      compute(prepared, inputs);
    } catch (const std::exception& error) {
      if (problems_.size() < kMostProblems) {
        problems_.push_back(std::string(workload) + ": " + error.what());
      }
      return done(std::nullopt);
    }
    busy_ += clock_.now() - begin;
    done(prepared.outputs);
  }
  [[nodiscard]] Nanos busy() const { return busy_; }
  [[nodiscard]] const std::vector<std::string>& problems() const { return problems_; }

 private:
  static constexpr std::size_t kMostProblems = 20;
  struct Prepared {
    std::unique_ptr<Kernel> kernel;
    std::vector<Tensor> outputs;
  };
  static void compute(Prepared& prepared, const std::vector<Tensor>& inputs) {
    prepared.kernel->bind(inputs, prepared.outputs);
    prepared.kernel->upload();
    prepared.kernel->execute(1);
    prepared.kernel->download();
  }
  void add(const std::string& name, std::unique_ptr<Kernel> kernel,
           const std::vector<TensorSpec>& outputs) {
    prepared_.emplace(name, Prepared{std::move(kernel), make_tensors(outputs)});
  }

  MachineClock clock_;
  Nanos busy_{0};
  Samples samples_;
  std::unique_ptr<Device> device_;
  std::map<std::string, Prepared, std::less<>> prepared_;
  std::vector<std::string> problems_;
};

class SerialLocalization {
 public:
  SerialLocalization(const Sequence& sequence, LocalizationOptions options)
      : sequence_(sequence),
        options_(std::move(options)),
        playing_(playing_times(stamps_of(sequence.frames))) {
    if (options_.companion == nullptr) return;
    RuntimeOptions listed;
    options_.companion->list_workloads(listed);
    caller_.emplace(listed);
    options_.companion->begin(*caller_);
  }

  LocalizationResult run() {
    slam::RunOptions run;
    run.setup = options_.setup;
    run.clock = &clock_;
    run.spoil = [this](std::size_t frame, std::size_t camera, GreyImage& image) {
      if (options_.spoil) options_.spoil(frame, camera, image);
      if (camera == 0 && options_.companion != nullptr) left_ = image;
    };
    if (options_.companion != nullptr) {
      run.better_map = [this] { return options_.companion->better_map(); };
    }
    run.next = [this](std::size_t frame) { return next(frame); };
    run.seen = [this](std::size_t frame, const slam::State& state, const GreyImage& image,
                      const slam::FrameResult& seen) {
      if (options_.show && frame >= *options_.show) {
        result_.shown = slam::show(state, image);
        options_.show.reset();
      }
      done_ = clock_.now();
      if (options_.companion != nullptr) {
        options_.companion->localized(seen, [&state] { return state; });
      }
      result_.latencies.push_back(options_.own_rate ? done_ - arrived_ : steps_of(seen));
    };
    begin_ = clock_.now();
    result_.run = slam::run_serially(sequence_, run);
    result_.duration = options_.own_rate ? done_ - first_
                                         : std::accumulate(result_.latencies.begin(),
                                                           result_.latencies.end(), Nanos::zero());
    result_.stopped = stops() > 0;
    for (const auto& frame : result_.run.frames) result_.busy += steps_of(frame);
    if (caller_) {
      result_.problems = caller_->problems();
      result_.busy += caller_->busy();
    }
    return std::move(result_);
  }

 private:
  [[nodiscard]] int stops() const { return options_.stops ? options_.stops() : 0; }
  [[nodiscard]] Nanos due(std::size_t frame) const { return begin_ + playing_[frame]; }

  slam::Next next(std::size_t frame) {
    while (options_.own_rate && stops() == 0 && clock_.now() < due(frame)) {
      std::this_thread::sleep_for(std::min(due(frame) - clock_.now(), kLookEvery));
    }
    if (stops() > 0) return slam::Next::kStop;
    const bool late =
        options_.own_rate && frame + 1 < sequence_.frames.size() && clock_.now() >= due(frame + 1);
    arrived_ = options_.own_rate ? due(frame) : clock_.now();
    if (result_.arrived++ == 0) first_ = arrived_;
    if (!late) {
      if (options_.companion != nullptr) {
        options_.companion->arrived(sequence_.frames[frame].time, left_);
      }
      return slam::Next::kTake;
    }
    ++result_.dropped;
    return slam::Next::kDrop;
  }

  const Sequence& sequence_;
  LocalizationOptions options_;
  const std::vector<Nanos> playing_;  ///< When each frame comes after the first.
  MachineClock clock_;
  std::optional<CpuCaller> caller_;
  GreyImage left_;
  Nanos begin_{0}, first_{0}, arrived_{0}, done_{0};
  LocalizationResult result_;
};

}  // namespace

LocalizationResult localize_serially(const Sequence& sequence, LocalizationOptions options) {
  return SerialLocalization(sequence, std::move(options)).run();
}

}  // namespace pirt
