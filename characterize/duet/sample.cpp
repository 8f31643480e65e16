#include "characterize/duet/sample.h"

#include <fmt/core.h>

#include <cmath>

#include "characterize/machine/build_info.h"
#include "characterize/platform/unit_request.h"
#include "characterize/statistics/statistics.h"
#include "characterize/worker/scratch.h"
#include "characterize/worker/worker.h"
#include "workloads/backends/registry.h"
#include "workloads/base/error.h"
#include "workloads/base/hash.h"
#include "workloads/catalog/catalog.h"
#include "workloads/inputs/pictures/images.h"
#include "workloads/model/player.h"

namespace pirt {
namespace {

constexpr int kSampleFormat = 1;

Job job_for(const Platform& platform, const SampleRequest& request) {
  const UnitModel& unit = platform.unit(request.cell.unit);
  if (!unit.measured()) {
    throw_bad_input(fmt::format("unit '{}' of platform '{}' has no backend to run anything on",
                                unit.name, platform.name));
  }
  Job job;
  job.kind = request.kind == SampleKind::kSetup ? JobKind::kSetup : JobKind::kSample;
  job.backend = unit.backend;
  job.unit = make_unit_request(platform, unit);
  job.workload = find_workload(request.cell.workload).name;
  job.seed = request.seed;
  job.sampling.warm_up = std::chrono::milliseconds(20);
  job.sampling.slice = request.work;
  job.sampling.min_samples = 3;
  return job;
}

/// Of all inputs, and of some of the parameters, which may be hundreds of megabytes.
std::string input_hash(const Workload& workload, std::uint64_t seed) {
  const auto images = generated_images(seed);
  const auto frames = make_sequence(workload, {seed, images.get()});
  Hash64 hash;
  for (const Data& data : frames) {
    for (const Tensor& tensor : data.inputs) {
      hash.add(tensor.spec().describe()).add(tensor.used_bytes());
    }
  }
  for (const Tensor& tensor : frames.front().parameters) {
    constexpr std::size_t kStride = 4'099;
    hash.add(tensor.spec().describe());
    const auto bytes = tensor.bytes();
    for (std::size_t i = 0; i < bytes.size(); i += kStride) hash.add(bytes.subspan(i, 1));
  }
  return fmt::format("{:016x}", hash.value());
}

}  // namespace

std::string to_string(const DuetCell& cell) {
  return cell.unit.empty() ? cell.workload : cell.workload + " on " + cell.unit;
}

Sample take_sample(const Platform& platform, const SampleRequest& request) {
  Job job = job_for(platform, request);
  Sample sample;
  sample.version = build_info().version;
  std::optional<ScratchFolder> scratch;
  const bool verify = request.kind == SampleKind::kVerified;
  if (verify) {
    scratch.emplace();
    job.kind = JobKind::kReference;
    job.reference = scratch->path() / "reference";
    static_cast<void>(do_job(job));
    job.kind = JobKind::kSample;
    sample.inputs = input_hash(find_workload(job.workload), job.seed);
  }
  const JobResult result = do_job(job, request.injection);
  if (result.device) {
    sample.device = result.device->name;
    sample.driver = result.device->version;
  }
  if (verify) {
    sample.right = !result.wrong_output;
    sample.detail = result.verification;
  }
  sample.contended = result.during_calls.contended;
  if (result.device_init) sample.seconds["device_init"] = to_s(*result.device_init);
  if (result.prepare) sample.seconds["prepare"] = to_s(*result.prepare);
  for (const PhaseSamples& phase : result.phases) {
    if (phase.samples.empty()) continue;
    sample.seconds[std::string(to_string(phase.phase))] = to_s(median(phase.samples));
  }
  return sample;
}

Json to_json(const Sample& sample) {
  Json json = {{"pirt_sample", kSampleFormat},
               {"version", sample.version},
               {"device", sample.device},
               {"driver", sample.driver}};
  if (sample.right) {
    json["inputs"] = sample.inputs;
    json["right"] = *sample.right;
    json["detail"] = sample.detail;
  }
  json["contended"] = sample.contended;
  json["seconds"] = sample.seconds;
  for (const auto& [name, measure] : sample.measures) {
    json["measures"][name] = {{"unit", measure.unit}, {"higher", measure.higher_is_better}};
  }
  if (!sample.files.empty()) json["files"] = sample.files;
  if (sample.wall_s > 0) json["wall_s"] = sample.wall_s;
  return json;
}

Sample sample_from_json(const std::string& text) {
  try {
    // Libraries of older versions may write to stdout before and behind it.
    const auto begin = text.starts_with('{') ? 0 : text.rfind("\n{") + 1;
    const auto end = text.find("\n}", begin);
    const auto json =
        parse_json(text.substr(begin, end == std::string::npos ? end : end + 2 - begin));
    if (json.at("pirt_sample").get<int>() < kSampleFormat) throw_bad_input("an unknown format");
    Sample sample;
    sample.device = json.at("device");
    if (json.contains("right")) {
      sample.inputs = json.at("inputs");
      sample.right = json.at("right");
      sample.detail = json.at("detail");
    }
    sample.seconds = json.at("seconds").get<std::map<std::string, double>>();
    sample.wall_s = json.value("wall_s", 0.0);
    if (json.contains("files")) {
      sample.files = json.at("files").get<std::map<std::string, std::string>>();
    }
    if (json.contains("measures")) {
      for (const auto& [name, measure] : json.at("measures").items()) {
        sample.measures[name] = {measure.at("unit"), measure.at("higher")};
      }
    }
    for (const auto& [phase, value] : sample.seconds) {
      if (!std::isfinite(value)) throw_bad_input(phase + " is no finite figure");
    }
    return sample;
  } catch (const std::exception& error) {
    throw_bad_input(fmt::format("no answer of 'pirt sample': {}", error.what()));
  }
}

}  // namespace pirt
