#include "characterize/duet/commands.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <span>
#include <utility>

#include "workloads/base/error.h"
#include "workloads/base/system/program_path.h"
#include "workloads/base/text/json.h"
#include "workloads/base/text/printable.h"
#include "workloads/base/text/text.h"

namespace pirt {
namespace {

ProcessRequest request_of(const std::vector<std::string>& words, const DuetCommands& commands) {
  ProcessRequest request;
  request.program = find_program(words.front());
  request.arguments.assign(words.begin() + 1, words.end());
  request.limit = commands.limit;
  request.stop = commands.stop;
  return request;
}

/// Contents of the files that the words behind the program name; of programs among them also the
/// libraries beside them.
std::map<std::string, std::string> named_files(const std::vector<std::string>& words) {
  std::map<std::string, std::string> contents;
  for (const CommandFile& each : files_named_by(std::span(words).subspan(1))) {
    const std::string name = printable(each.name);
    if (contents.contains(name)) continue;
    contents[name] = each.is_program ? json_text(built_key(each.file)) : content_key(each.file);
  }
  return contents;
}

Ledger::Event command_key(const std::vector<std::string>& words) {
  return {{"words", words}, {"program", built_key(find_program(words[0]))}};
}

/// Whether @p file is in @p files with the same contents.
bool is_among(const std::map<std::string, std::string>& files,
              const std::pair<const std::string, std::string>& file) {
  const auto found = files.find(file.first);
  return found != files.end() && found->second == file.second;
}

/// "5 s", "1 min", "2 h".
std::string about(double seconds) {
  if (seconds < 55) return fmt::format("{:.0f} s", std::max(1.0, seconds));
  if (seconds < 5400) return fmt::format("{:.0f} min", std::max(1.0, std::round(seconds / 60)));
  return fmt::format("{:.0f} h", seconds / 3600);
}

}  // namespace

std::filesystem::path find_program(const std::string& word) {
  if (const auto found = try_find_program(word)) return *found;
  throw_bad_input(fmt::format("'{}' is no program that can be run; give its path", word));
}

void run_setup(const DuetCommands& commands) {
  if (commands.setup.empty()) return;
  ProcessRequest request = request_of(commands.setup, commands);
  request.limit = std::chrono::hours(24);  // It may build them; the limit is of what is measured.
  const ProcessResult process = run_process(request);
  if (process.end == ProcessResult::End::kExited && process.code == 0) return;
  throw_environment(fmt::format("the setup command '{}' {}: {}", join(commands.setup, " "),
                                how_it_ended(process, request.limit),
                                one_line(process.diagnostics, kLastWords)));
}

TakeSample command_samples(const DuetCommands& commands, const DuetComparison& comparison) {
  return [commands, &comparison](Side side, const DuetCell&, SampleKind kind, Nanos most) {
    const MachineClock clock;
    const Nanos begin = clock.now();
    const auto& words = side == Side::kBaseline ? commands.baseline : commands.candidate;
    const bool is_first = kind == SampleKind::kVerified;
    ProcessRequest request = request_of(words, commands);
    const auto more = commands.reader->arguments(comparison.cells().front().undecided());
    request.arguments.insert(request.arguments.end(), more.begin(), more.end());
    if (is_first && !commands.reader->first.empty()) {
      request.arguments.emplace_back(commands.reader->first);
    }
    const auto started = std::filesystem::file_time_type::clock::now();
    auto files = is_first ? named_files(words) : std::map<std::string, std::string>();
    SampleOutcome outcome;
    for (int left = is_first ? commands.warm_up : 1; left > 0; --left) {
      outcome =
          run_sample(request, *commands.reader, std::max(most - (clock.now() - begin), Nanos(0)));
      if (!outcome.sample) break;
    }
    if (is_first && outcome.sample) {  // What it writes is no part of what it is.
      std::erase_if(files, [started, now = named_files(words)](const auto& file) {
        std::error_code gone;
        const auto written = std::filesystem::last_write_time(file.first, gone);
        return !is_among(now, file) || (!gone && written >= started);
      });
      outcome.sample->files = std::move(files);
    }
    return outcome;
  };
}

Ledger::Event ledger_key(const DuetCommands& commands, std::uint64_t seed) {
  return {{"baseline", command_key(commands.baseline)},
          {"candidate", command_key(commands.candidate)},
          {"setup", commands.setup},
          {"reads", commands.reader->name},
          {"seed", seed},
          {"machine", machine_key()}};
}

void refuse_changed_files(const DuetCommands& commands, const DuetComparison& comparison,
                          const std::filesystem::path& ledger) {
  for (const Side side : {Side::kBaseline, Side::kCandidate}) {
    const auto& check = comparison.cells().front().checks[static_cast<std::size_t>(side)];
    if (!check) continue;
    const auto now = named_files(side == Side::kBaseline ? commands.baseline : commands.candidate);
    for (const auto& file : check->files) {
      if (is_among(now, file)) continue;
      throw_bad_input(
          fmt::format("ledger '{}' is of another comparison ({}: {} was another one); remove it, "
                      "or name another with --ledger",
                      ledger.string(), to_string(side), file.first));
    }
  }
}

std::string duration_text(double run_s) {
  const DuetThresholds rule;
  const auto of_blocks = [run_s](std::size_t blocks) {
    return 4 * run_s * static_cast<double>(blocks);
  };
  // With a canary for every second block.
  const std::size_t confirming = rule.confirmations.front() * 3 / 2;
  return fmt::format("{} blocks of 4 runs of {:.3g} s: about {}; confirming {} more",
                     rule.first_suspicion, run_s, about(of_blocks(rule.first_suspicion)),
                     about(of_blocks(confirming)));
}

}  // namespace pirt
