#include "characterize/duet/commands.h"

#include <fmt/core.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <span>

#include "workloads/base/error.h"
#include "workloads/base/text/text.h"

namespace pirt {
namespace {

bool can_run(const std::filesystem::path& path) {
  std::error_code ignored;
  return std::filesystem::is_regular_file(path, ignored) && ::access(path.c_str(), X_OK) == 0;
}

ProcessRequest request_of(const std::vector<std::string>& words, const DuetCommands& commands) {
  ProcessRequest request;
  request.program = find_program(words.front());
  request.arguments.assign(words.begin() + 1, words.end());
  request.limit = commands.limit;
  request.stop = commands.stop;
  return request;
}

Ledger::Event command_key(const std::vector<std::string>& words) {
  Ledger::Event contents = Ledger::Event::array();
  for (const std::string& word : std::span(words).subspan(1)) {
    // "x.yaml", "--config=x.yaml"
    for (const std::string& path : {word, word.substr(word.find('=') + 1)}) {
      std::error_code ignored;
      if (!std::filesystem::is_regular_file(path, ignored)) continue;
      contents.push_back(content_key(path));
      break;
    }
  }
  return {{"words", words}, {"program", built_key(find_program(words[0]))}, {"files", contents}};
}

/// "5 s", "1 min", "2 h".
std::string about(double seconds) {
  if (seconds < 55) return fmt::format("{:.0f} s", std::max(1.0, seconds));
  if (seconds < 5400) return fmt::format("{:.0f} min", std::max(1.0, std::round(seconds / 60)));
  return fmt::format("{:.0f} h", seconds / 3600);
}

}  // namespace

std::filesystem::path find_program(const std::string& word) {
  if (word.find('/') != std::string::npos) {
    if (can_run(word)) return std::filesystem::absolute(word);
  } else if (const char* folders = std::getenv("PATH"); folders != nullptr) {
    for (const std::string& folder : split(folders, ':')) {
      const auto path = std::filesystem::path(folder.empty() ? "." : folder) / word;
      if (can_run(path)) return std::filesystem::absolute(path);
    }
  }
  throw_bad_input(fmt::format("'{}' is no program that can be run; give its path", word));
}

void run_setup(const DuetCommands& commands) {
  if (commands.setup.empty()) return;
  const ProcessResult process = run_process(request_of(commands.setup, commands));
  if (process.end == ProcessResult::End::kExited && process.code == 0) return;
  throw_environment(fmt::format("the setup command '{}' {}: {}", join(commands.setup, " "),
                                how_it_ended(process, commands.limit),
                                one_line(process.diagnostics, kLastWords)));
}

TakeSample command_samples(const DuetCommands& commands, const DuetComparison& comparison) {
  return [commands, &comparison](Side side, const DuetCell&, SampleKind kind, Nanos most) {
    const MachineClock clock;
    const Nanos begin = clock.now();
    const bool baseline = side == Side::kBaseline;
    ProcessRequest request =
        request_of(baseline ? commands.baseline : commands.candidate, commands);
    const auto more = commands.reader->arguments(comparison.cells().front().undecided());
    request.arguments.insert(request.arguments.end(), more.begin(), more.end());
    SampleOutcome outcome;
    for (int left = kind == SampleKind::kVerified ? commands.warm_up : 1; left > 0; --left) {
      outcome =
          run_sample(request, *commands.reader, std::max(most - (clock.now() - begin), Nanos(0)));
      if (!outcome.sample) break;
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
