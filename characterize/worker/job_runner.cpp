#include "characterize/worker/job_runner.h"

#include <fmt/core.h>

#include "characterize/machine/inherited.h"
#include "characterize/platform/unit_request.h"
#include "characterize/worker/process.h"
#include "characterize/worker/scratch.h"
#include "workloads/base/error.h"
#include "workloads/base/text/json.h"
#include "workloads/catalog/catalog.h"
#include "workloads/catalog/own_list.h"
#include "workloads/model/own_operation.h"
#include "workloads/own/definition.h"

namespace pirt {
namespace {

constexpr std::size_t kLastWords = 400;  // characters of standard error that a reason quotes

std::string failure(const Job& job, const ProcessResult& process, const JobResult& result,
                    Nanos limit) {
  const std::string step = result.step.empty() ? "starting" : result.step;
  if (process.end == ProcessResult::End::kExited && !result.error.empty()) {
    std::string text = fmt::format("{} (while {})", result.error, step);
    // What a program or library of somebody else's had to say.
    const std::string words = job.own.empty() ? "" : one_line(process.diagnostics, kLastWords);
    if (!words.empty()) text += ": " + words;
    return one_line(std::move(text), 3 * kLastWords);
  }
  // Asking a file what it has takes no workload, and has another limit.
  const bool may_take_longer =
      process.end == ProcessResult::End::kTimedOut && !job.own.empty() && !job.workload.empty();
  const std::string text =
      fmt::format("worker {} while {}{}", how_it_ended(process, limit), step,
                  may_take_longer ? "; limit_s in a workload file is what it may take" : "");
  const std::string words = one_line(process.diagnostics, kLastWords);
  return words.empty() ? text : text + ": " + words;
}

/// Of a job that failed: what it may have failed of, if nothing here lets drivers make code.
std::string with_cause(std::string text) {
  const std::string cause = no_new_code(scratch_base());
  return cause.empty() ? text : text + "; " + cause;
}

/// References of batches are computed image by image; others say what theirs may take.
Nanos limit_of(const Job& job, Nanos limit) {
  const Workload* const workload = try_find_workload(job.workload);
  if (workload == nullptr) return limit;
  if (const OwnOperation* const own = own_operation(*workload)) return own->limit;
  return job.kind == JobKind::kReference ? limit * workload->batch : limit;
}

/// With the file that its workload comes from.
Job with_file(Job job) {
  if (const Workload* const workload = try_find_workload(job.workload)) {
    if (const OwnOperation* const own = own_operation(*workload)) {
      job.own = own->source;
      job.own_digest = own->digest;
    }
  }
  return job;
}

}  // namespace

std::optional<JobResult> JobRunner::run(
    const Job& job, const std::vector<std::pair<std::string, std::string>>& environment,
    const std::function<void(std::string_view)>& on_progress) const {
  ProcessRequest request;
  request.program = program_;
  request.arguments = {"worker"};
  request.input = to_json(with_file(job));
  request.environment = environment;
  request.limit = limit_of(job, limit_);
  request.stop = stop_;
  request.on_output = [&on_progress](std::string_view text) {
    const std::string progress = last_progress(text);
    if (!progress.empty() && on_progress) on_progress(progress);
    return !progress.empty();
  };
  if (stop_ != nullptr && stop_->load()) return std::nullopt;
  if (over_ && over_()) return std::nullopt;
  const ProcessResult process = run_process(request);
  if (process.end == ProcessResult::End::kStopped) return std::nullopt;
  JobResult result = last_record(process.output);
  result.error =
      result.done ? "" : with_cause(failure(with_file(job), process, result, request.limit));
  return result;
}

void learn_workloads(const JobRunner& runner, const std::filesystem::path& file) {
  Job job;
  job.kind = JobKind::kDescribe;
  job.backend = "cpu";
  job.own = std::filesystem::absolute(file).lexically_normal().string();
  const auto result = runner.run(job);
  if (!result) throw_environment("interrupted while reading " + file.string());
  if (!result->error.empty()) {
    const bool placed = result->error.starts_with(job.own);
    throw_bad_input((placed ? "" : file.string() + ": ") + result->error);
  }
  std::vector<Workload> workloads;
  try {
    for (const Json& each : parse_json(result->definitions)) {
      workloads.push_back(own::to_workload(own::definition_from(each)));
    }
  } catch (const JsonError& error) {
    throw_bad_input(file.string() + ": " + error.what());
  }
  make_known(std::move(workloads));
}

Probe probe_backend(const std::filesystem::path& program, const Backend& backend) {
  Job job;
  job.kind = JobKind::kDevices;
  job.backend = backend.name();
  const auto result = JobRunner(program, std::chrono::seconds(60), nullptr).run(job);
  return result->found.value_or(Probe{false, result->error, {}});  // Nothing stops it.
}

JobResult probe_unit(const JobRunner& runner, const Platform& platform, const UnitModel& unit,
                     const std::vector<std::pair<std::string, std::string>>& environment) {
  Job job;
  job.kind = JobKind::kProbe;
  job.backend = unit.backend;
  job.unit = make_unit_request(platform, unit);
  const auto result = runner.run(job, environment);
  if (!result) throw_environment("interrupted while probing the units; nothing was stored");
  return *result;
}

}  // namespace pirt
