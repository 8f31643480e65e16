#include "characterize/duet/duet.h"

#include <fmt/core.h>

#include <exception>
#include <memory>
#include <mutex>
#include <thread>

#include "characterize/worker/process.h"
#include "characterize/worker/scratch.h"
#include "workloads/backends/registry.h"
#include "workloads/base/error.h"
#include "workloads/base/hash.h"
#include "workloads/base/system/thread.h"
#include "workloads/base/text/json.h"
#include "workloads/base/text/text.h"
#include "workloads/base/time.h"

namespace pirt {
namespace {

constexpr std::size_t kLastWords = 300;  // characters of standard error that a reason quotes

class Programs {
 public:
  explicit Programs(DuetPrograms programs) : programs_(std::move(programs)) {}

  SampleOutcome take(Side side, const DuetCell& cell, SampleKind kind) const {
    ProcessRequest request;
    request.program = side == Side::kBaseline ? programs_.baseline : programs_.candidate;
    request.arguments = arguments(side, cell, kind);
    request.environment = environment(side, cell);
    request.limit = programs_.limit;
    request.stop = programs_.stop;
    const ProcessResult process = run_process(request);
    SampleOutcome outcome;
    if (process.end == ProcessResult::End::kStopped) {
      outcome.stopped = true;
      return outcome;
    }
    if (process.end != ProcessResult::End::kExited || process.code != 0) {
      const std::string words = one_line(process.diagnostics, kLastWords);
      outcome.error = how_it_ended(process, programs_.limit) + (words.empty() ? "" : ": " + words);
      return outcome;
    }
    try {
      outcome.sample = sample_from_json(process.output);
    } catch (const Error& error) {
      outcome.error = error.what();
    }
    return outcome;
  }

 private:
  [[nodiscard]] std::vector<std::string> arguments(Side side, const DuetCell& cell,
                                                   SampleKind kind) const {
    std::vector<std::string> arguments = {"sample",
                                          "--workload",
                                          cell.workload,
                                          "--seed",
                                          std::to_string(programs_.seed),
                                          "--work",
                                          fmt::format("{}ms", to_ms(programs_.work))};
    if (!cell.unit.empty()) {
      arguments.insert(arguments.end(),
                       {"--unit", cell.unit, "--platform", programs_.platform_argument});
    }
    if (kind == SampleKind::kVerified) arguments.emplace_back("--verify");
    if (kind == SampleKind::kSetup) arguments.emplace_back("--setup");
    if (side == Side::kCandidate && kind != SampleKind::kVerified && programs_.injection.any() &&
        cell == programs_.injected) {
      arguments.insert(arguments.end(), {"--inject", to_string(programs_.injection)});
    }
    return arguments;
  }

  /// A kernel cache of the side's own, which is emptied where cold set-ups are wanted.
  [[nodiscard]] std::vector<std::pair<std::string, std::string>> environment(
      Side side, const DuetCell& cell) const {
    if (cell.unit.empty()) return {};
    const auto folder = scratch_.path() /
                        fmt::format("{}-{}", to_string(side), programs_.platform.name) / cell.unit;
    if (programs_.cold) std::filesystem::remove_all(folder);
    std::filesystem::create_directories(folder);
    const UnitModel& unit = programs_.platform.unit(cell.unit);
    return find_backend(unit.backend).kernel_cache_environment(folder.string());
  }

  DuetPrograms programs_;
  ScratchFolder scratch_;
};

bool is_set(const std::atomic<bool>* flag) { return flag != nullptr && flag->load(); }

/// One run over all lanes. Comparison and ledger change under the lock; processes run outside it.
class DuetRun {
 public:
  DuetRun(DuetComparison& comparison, Ledger& ledger, const TakeSample& take,
          const DuetLimits& limits, const std::function<void(const DuetStep&)>& on_step)
      : comparison_(comparison), ledger_(ledger), take_(take), limits_(limits), on_step_(on_step) {}

  /// Until @p lane is decided, or any lane had to end.
  void measure(const DuetLane& lane) {
    try {
      while (const auto step = begin(lane)) {
        auto outcomes = take(*step);
        if (outcomes.back().stopped) return end_all(DuetEnd::kStopped);
        keep(*step, std::move(outcomes));
      }
    } catch (...) {
      fail(std::current_exception());
    }
  }

  /// All lanes end, and end() throws the first @p error.
  void fail(const std::exception_ptr& error) {
    const std::lock_guard lock(mutex_);
    if (!error_) error_ = error;
  }

  /// @throws whatever ended a lane.
  [[nodiscard]] DuetEnd end() const {
    if (error_) std::rethrow_exception(error_);
    return end_.value_or(DuetEnd::kDecided);
  }

 private:
  std::optional<DuetStep> begin(const DuetLane& lane) {
    const std::lock_guard lock(mutex_);
    if (end_ || error_) return std::nullopt;
    auto step = comparison_.next(lane);
    if (!step) return std::nullopt;
    if (is_set(limits_.stop)) end_ = DuetEnd::kStopped;
    if (!end_ && limits_.time && clock_.now() - start_ >= *limits_.time) {
      end_ = DuetEnd::kOutOfTime;
    }
    if (end_) return std::nullopt;
    if (on_step_) on_step_(*step);
    return step;
  }

  /// Of the step's processes up to the first that gave no sample.
  [[nodiscard]] std::vector<SampleOutcome> take(const DuetStep& step) const {
    const DuetCell& cell = comparison_.cells()[step.cell].cell;
    std::vector<SampleOutcome> outcomes;
    for (const Side side : step.order) {
      outcomes.push_back(take_(side, cell, step.sample));
      if (!outcomes.back().sample) break;
    }
    return outcomes;
  }

  void keep(const DuetStep& step, std::vector<SampleOutcome> outcomes) {
    const std::lock_guard lock(mutex_);
    std::vector<Sample> samples;
    std::optional<DuetComparison::Event> event;
    for (SampleOutcome& outcome : outcomes) {
      if (outcome.sample) {
        samples.push_back(std::move(*outcome.sample));
      } else {
        event = comparison_.failure_of(step, step.order[samples.size()], outcome.error);
      }
    }
    if (!event) event = comparison_.event_of(step, samples);
    ledger_.append(*event);
    comparison_.apply(*event);
  }

  void end_all(DuetEnd end) {
    const std::lock_guard lock(mutex_);
    end_ = end;
  }

  DuetComparison& comparison_;
  Ledger& ledger_;
  const TakeSample& take_;
  const DuetLimits& limits_;
  const std::function<void(const DuetStep&)>& on_step_;
  const MachineClock clock_;
  const Nanos start_ = clock_.now();
  std::mutex mutex_;
  std::optional<DuetEnd> end_;  ///< Why some lane ended early.
  std::exception_ptr error_;
};

}  // namespace

TakeSample program_samples(const DuetPrograms& programs) {
  const auto runner = std::make_shared<const Programs>(programs);
  return [runner](Side side, const DuetCell& cell, SampleKind kind) {
    return runner->take(side, cell, kind);
  };
}

Ledger::Event ledger_key(const DuetPrograms& programs, const std::vector<DuetCell>& cells) {
  const auto content = [](const std::filesystem::path& program) {
    return fmt::format("{:016x}", Hash64().add(read_file(program, kAnySize)).value());
  };
  Ledger::Event names = Ledger::Event::array();
  for (const DuetCell& cell : cells) names.push_back(to_string(cell));
  return {{"baseline", content(programs.baseline)},
          {"candidate", content(programs.candidate)},
          {"platform", programs.platform_argument},
          {"cells", names},
          {"seed", programs.seed},
          {"work_ms", to_ms(programs.work)},
          {"cold", programs.cold},
          {"inject", to_string(programs.injection)}};
}

DuetEnd run_duet(DuetComparison& comparison, Ledger& ledger, const TakeSample& take,
                 const DuetRounds& rounds, const DuetLimits& limits,
                 const std::function<void(const DuetStep&)>& on_step) {
  DuetRun run(comparison, ledger, take, limits, on_step);
  for (const auto& lanes : rounds) {
    std::vector<std::jthread> others;
    try {
      for (std::size_t i = 1; i < lanes.size(); ++i) {
        others.push_back(start_thread([&run, &lane = lanes[i]] { run.measure(lane); }));
      }
    } catch (...) {
      run.fail(std::current_exception());  // the lanes that are measured end with their step
    }
    if (!lanes.empty()) run.measure(lanes.front());
  }
  return run.end();
}

}  // namespace pirt
