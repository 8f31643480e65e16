#include "characterize/duet/duet.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <sys/stat.h>

#include <algorithm>
#include <ctime>
#include <exception>
#include <map>
#include <memory>
#include <mutex>
#include <thread>
#include <tuple>

#include "characterize/duet/readers.h"
#include "characterize/machine/environment.h"
#include "characterize/worker/process.h"
#include "characterize/worker/scratch.h"
#include "workloads/backends/registry.h"
#include "workloads/base/error.h"
#include "workloads/base/hash.h"
#include "workloads/base/system/cores.h"
#include "workloads/base/system/module.h"
#include "workloads/base/system/program_path.h"
#include "workloads/base/system/thread.h"
#include "workloads/base/text/json.h"
#include "workloads/base/text/text.h"
#include "workloads/base/time.h"

namespace pirt {
namespace {

class Programs {
 public:
  explicit Programs(DuetPrograms programs) : programs_(std::move(programs)) {}

  SampleOutcome take(Side side, const DuetCell& cell, SampleKind kind, Nanos most) const {
    ProcessRequest request;
    request.program = side == Side::kBaseline ? programs_.baseline : programs_.candidate;
    request.arguments = arguments(side, cell, kind);
    request.environment = environment(side, cell);
    request.limit = programs_.limit;
    request.stop = programs_.stop;
    return run_sample(request, find_reader("pirt"), most);
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

  /// Until @p lane is decided or has no time left, or any lane was stopped.
  void measure(DuetLane lane) {
    try {
      while (const auto step = begin(lane)) {
        auto outcomes = take(*step);
        if (outcomes.back().stopped) return note(DuetEnd::kStopped);
        if (outcomes.back().out_of_time) return note(DuetEnd::kOutOfTime);
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
  /// @param lane  Loses the cells whose next step would last too long.
  std::optional<DuetStep> begin(DuetLane& lane) {
    const std::lock_guard lock(mutex_);
    while (end_ != DuetEnd::kStopped && !error_) {
      auto step = comparison_.next(lane);
      if (!step) break;
      if (is_set(limits_.stop)) {
        end_ = DuetEnd::kStopped;
        break;
      }
      const Nanos lasts = static_cast<std::int64_t>(step->order.size()) * longest_[step->cell];
      if (!limits_.time || clock_.now() - start_ + lasts < *limits_.time) {
        if (on_step_) on_step_(*step);
        return step;
      }
      end_ = DuetEnd::kOutOfTime;
      std::erase(lane, step->cell);
    }
    return std::nullopt;
  }

  /// Of the step's processes up to the first that gave no sample.
  [[nodiscard]] std::vector<SampleOutcome> take(const DuetStep& step) {
    const DuetCell& cell = comparison_.cells()[step.cell].cell;
    std::vector<SampleOutcome> outcomes;
    for (const Side side : step.order) {
      const Nanos begin = clock_.now();
      const Nanos left =
          limits_.time ? std::max(*limits_.time - (begin - start_), Nanos(0)) : Nanos::max();
      outcomes.push_back(take_(side, cell, step.sample, left));
      const auto& sample = outcomes.back().sample;
      if (!sample) break;
      // Of several, such as those that warm up, the last one.
      const Nanos took = sample->wall_s > 0 ? from_s(sample->wall_s) : clock_.now() - begin;
      const std::lock_guard lock(mutex_);
      Nanos& longest = longest_[step.cell];
      longest = std::max(longest, took);
    }
    return outcomes;
  }

  void keep(const DuetStep& step, std::vector<SampleOutcome> outcomes) {
    const std::lock_guard lock(mutex_);
    std::vector<Sample> samples;
    std::optional<DuetComparison::Event> event;
    for (SampleOutcome& outcome : outcomes) {
      const Side side = step.order[samples.size()];
      if (outcome.sample) outcome.error = comparison_.unlike_first(step, side, *outcome.sample);
      if (!outcome.error.empty()) {
        event = comparison_.failure_of(step, side, outcome.error, outcome.timed_out);
        break;
      }
      samples.push_back(std::move(*outcome.sample));
    }
    if (!event) event = comparison_.event_of(step, samples);
    comparison_.apply(*event);  // What it does not take does not get into the ledger.
    ledger_.append(*event);
  }

  /// That some lane ended early; being stopped ends all.
  void note(DuetEnd end) {
    const std::lock_guard lock(mutex_);
    if (end_ != DuetEnd::kStopped) end_ = end;
  }

  DuetComparison& comparison_;
  Ledger& ledger_;
  const TakeSample& take_;
  const DuetLimits& limits_;
  const std::function<void(const DuetStep&)>& on_step_;
  const MachineClock clock_;
  const Nanos start_ = clock_.now();
  std::mutex mutex_;
  std::map<std::size_t, Nanos> longest_;  ///< Of a process that gave a sample, by cell.
  std::optional<DuetEnd> end_;            ///< Why some lane ended early.
  std::exception_ptr error_;
};

}  // namespace

SampleOutcome run_sample(ProcessRequest request, const OutputReader& reader, Nanos most) {
  const bool bounded = most < request.limit;
  request.limit = std::min(most, request.limit);
  request.most_output = kMostOutput;
  const ProcessResult process = run_process(request);
  SampleOutcome outcome;
  outcome.stopped = process.end == ProcessResult::End::kStopped;
  outcome.out_of_time = bounded && process.end == ProcessResult::End::kTimedOut;
  if (outcome.stopped || outcome.out_of_time) return outcome;
  if (process.end != ProcessResult::End::kExited || process.code != 0) {
    const std::string words = one_line(process.diagnostics, kLastWords);
    outcome.error = how_it_ended(process, request.limit) + (words.empty() ? "" : ": " + words);
    outcome.timed_out = process.end == ProcessResult::End::kTimedOut;
    return outcome;
  }
  try {
    outcome.sample = reader.read(process);
    outcome.sample->wall_s = to_s(process.wall);
  } catch (const Error& error) {
    outcome.error = error.what();
  }
  return outcome;
}

TakeSample program_samples(const DuetPrograms& programs) {
  const auto runner = std::make_shared<const Programs>(programs);
  return [runner](Side side, const DuetCell& cell, SampleKind kind, Nanos most) {
    return runner->take(side, cell, kind, most);
  };
}

namespace {

std::string hash_or_stamp(const std::filesystem::path& file) {
  const auto bytes = std::filesystem::file_size(file);
  if (bytes > kMostHashedBytes) {
    return fmt::format("{} bytes of {}", bytes,
                       std::filesystem::last_write_time(file).time_since_epoch().count());
  }
  return fmt::format("{:016x}", Hash64().add(read_file(file, kAnySize)).value());
}

}  // namespace

std::string content_key(const std::filesystem::path& file) {
  struct stat now {};
  if (::stat(file.c_str(), &now) != 0) return hash_or_stamp(file);  // which says why
  // The ledger and the first processes ask for the same programs and libraries. Whatever writes to
  // a file changes its ctime.
  const std::tuple stamp(now.st_dev, now.st_ino, now.st_size, now.st_ctim.tv_sec,
                         now.st_ctim.tv_nsec);
  static std::mutex mutex;
  static std::map<std::decay_t<decltype(stamp)>, std::string> known;
  {
    const std::lock_guard lock(mutex);
    const auto found = known.find(stamp);
    if (found != known.end()) return found->second;
  }
  const std::string key = hash_or_stamp(file);
  // Within a tick of the file system's clock it may be written again and look the same.
  if (std::time(nullptr) - now.st_ctim.tv_sec > 1) {
    const std::lock_guard lock(mutex);
    known.emplace(stamp, key);
  }
  return key;
}

std::string machine_key() {
  const Environment facts = host_environment();
  const auto fact = [&facts](const char* key) {
    const auto found = facts.find(key);
    return found == facts.end() ? std::string("unknown") : found->second;
  };
  return fmt::format("{}, cores {}, kernel {}", fact("cpu_model"), fmt::join(usable_cores(), ","),
                     fact("kernel"));
}

Ledger::Event built_key(const std::filesystem::path& program) {
  std::map<std::string, std::string> contents;
  const auto file = std::filesystem::canonical(program);
  for (const auto& folder : module_folders(file)) {
    const bool is_beside = folder == file.parent_path();
    if (!is_beside && file.filename() != "pirt")
      continue;               // of other programs they are the system's
    std::error_code ignored;  // Who may only run what is there does not see it.
    for (const auto& entry : std::filesystem::directory_iterator(folder, ignored)) {
      const std::string name = entry.path().filename();
      const bool is_code =
          name.ends_with(".so") || name.ends_with(".elf") || name.find(".so.") != std::string::npos;
      const bool is_pirts = name.starts_with("libpirt") || name.starts_with("pirt_");
      if (is_code && (is_beside || is_pirts) && !contents.contains(name) &&
          entry.is_regular_file()) {
        contents[name] = content_key(entry.path());
      }
    }
  }
  contents["program"] = content_key(program);
  return contents;
}

Ledger::Event ledger_key(const DuetPrograms& programs, const std::vector<DuetCell>& cells) {
  Ledger::Event names = Ledger::Event::array();
  for (const DuetCell& cell : cells) names.push_back(to_string(cell));
  return {{"baseline", built_key(programs.baseline)},
          {"candidate", built_key(programs.candidate)},
          {"platform", programs.platform_argument},
          {"platform_text", platform_hash(programs.platform)},
          {"machine", machine_key()},
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
