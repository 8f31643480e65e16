#include "characterize/job_runner.h"

#include <fmt/format.h>
#include <string.h>

#include <algorithm>

#include "characterize/process.h"

namespace pirt {
namespace {

constexpr std::size_t kLastWords = 400;  // characters of standard error that a reason quotes

std::string one_line(std::string text, std::size_t longest) {
  std::ranges::replace_if(
      text, [](unsigned char c) { return c < ' '; }, ' ');
  while (!text.empty() && text.back() == ' ') text.pop_back();
  if (text.size() > longest) text = "..." + text.substr(text.size() - longest);
  return text;
}

std::string signal_name(int number) {
  const char* name = ::sigabbrev_np(number);
  return name != nullptr ? fmt::format("SIG{}", name) : fmt::format("signal {}", number);
}

std::string failure(const ProcessResult& process, const JobResult& result, Nanos limit) {
  const std::string step = result.step.empty() ? "starting" : result.step;
  std::string text;
  if (process.end == ProcessResult::End::kTimedOut) {
    text = fmt::format("worker timed out after {:.3g} s while {}", to_s(limit), step);
  } else if (process.end == ProcessResult::End::kSignalled) {
    text = fmt::format("worker crashed ({}) while {}", signal_name(process.code), step);
  } else if (!result.error.empty()) {
    return one_line(fmt::format("{} (while {})", result.error, step), 2 * kLastWords);
  } else {
    text = fmt::format("worker ended with code {} while {}", process.code, step);
  }
  const std::string words = one_line(process.diagnostics, kLastWords);
  return words.empty() ? text : text + ": " + words;
}

}  // namespace

std::optional<JobResult> JobRunner::run(
    const Job& job, const std::vector<std::pair<std::string, std::string>>& environment) const {
  ProcessRequest request;
  request.program = program_;
  request.arguments = {"worker"};
  request.input = to_json(job);
  request.environment = environment;
  request.limit = limit_;
  request.stop = stop_;
  if (stop_ != nullptr && stop_->load()) return std::nullopt;
  const ProcessResult process = run_process(request);
  if (process.end == ProcessResult::End::kStopped) return std::nullopt;
  JobResult result = last_record(process.output);
  result.error = result.done ? "" : failure(process, result, limit_);
  return result;
}

}  // namespace pirt
