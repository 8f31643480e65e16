#include "characterize/duet/duet.h"

#include <fmt/format.h>

#include <memory>

#include "characterize/measure.h"
#include "characterize/process.h"
#include "characterize/scratch.h"
#include "workloads/base/error.h"
#include "workloads/base/hash.h"
#include "workloads/base/text.h"
#include "workloads/registry.h"

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

}  // namespace

TakeSample program_samples(const DuetPrograms& programs) {
  const auto runner = std::make_shared<const Programs>(programs);
  return [runner](Side side, const DuetCell& cell, SampleKind kind) {
    return runner->take(side, cell, kind);
  };
}

Ledger::Event ledger_key(const DuetPrograms& programs, const std::vector<DuetCell>& cells) {
  const auto content = [](const std::filesystem::path& program) {
    return fmt::format("{:016x}", Hash64().add(read_file(program)).value());
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
                 const DuetLimits& limits, const std::function<void(const DuetStep&)>& on_step) {
  const MachineClock clock;
  const Nanos begin = clock.now();
  while (const auto step = comparison.next()) {
    if (is_set(limits.stop)) return DuetEnd::kStopped;
    if (limits.time && clock.now() - begin >= *limits.time) return DuetEnd::kOutOfTime;
    if (on_step) on_step(*step);
    std::vector<Sample> samples;
    std::optional<DuetComparison::Event> event;
    for (const Side side : step->order) {
      SampleOutcome outcome = take(side, comparison.cells()[step->cell].cell, step->sample);
      if (outcome.stopped) return DuetEnd::kStopped;
      if (!outcome.sample) {
        event = comparison.failure_of(*step, side, outcome.error);
        break;
      }
      samples.push_back(std::move(*outcome.sample));
    }
    if (!event) event = comparison.event_of(*step, samples);
    ledger.append(*event);
    comparison.apply(*event);
  }
  return DuetEnd::kDecided;
}

}  // namespace pirt
