#include "characterize/worker/job.h"

#include <fmt/core.h>

#include <algorithm>
#include <map>

#include "workloads/base/error.h"
#include "workloads/base/text/json.h"

namespace pirt {
namespace {

constexpr int kProtocol = 6;
constexpr std::string_view kRecordPrefix = "pirt-record ";
constexpr std::string_view kProgress = "pirt-progress ";

Json encode(const std::vector<Nanos>& times) {
  Json list = Json::array();
  for (const Nanos t : times) list.push_back(t.count());
  return list;
}

/// A word of an enumeration, by its own parser.
template <typename Parse>
auto decode_word(const Json& j, Parse parse) {
  const auto text = j.get<std::string>();
  const auto value = parse(text);
  if (!value) throw_bad_input(fmt::format("there is no '{}'", text));
  return *value;
}

std::vector<Nanos> decode_times(const Json& list) {
  std::vector<Nanos> times;
  times.reserve(list.size());
  for (const auto& value : list) times.emplace_back(value.get<std::int64_t>());
  return times;
}

Json encode(const SamplingOptions& o) {
  return {{"warm_up_ns", o.warm_up.count()},
          {"warm_up_calls", o.warm_up_calls},
          {"slice_ns", o.slice.count()},
          {"limit_ns", o.limit.count()},
          {"min_samples", o.min_samples},
          {"max_samples", o.max_samples},
          {"condition_samples", o.condition_samples},
          {"cold_memory", o.cold_memory}};
}

SamplingOptions decode_sampling(const Json& j) {
  SamplingOptions o;
  o.warm_up = Nanos(j.at("warm_up_ns").get<std::int64_t>());
  o.slice = Nanos(j.at("slice_ns").get<std::int64_t>());
  o.limit = Nanos(j.at("limit_ns").get<std::int64_t>());
  o.warm_up_calls = j.at("warm_up_calls");
  o.min_samples = j.at("min_samples");
  o.max_samples = j.at("max_samples");
  o.condition_samples = j.at("condition_samples");
  o.cold_memory = j.at("cold_memory");
  return o;
}

Json encode(const MeterRequest& m) {
  return {{"meters", m.meters},
          {"source", m.source},
          {"domain", m.domain},
          {"sysfs", m.sysfs},
          {"window_ns", m.window.count()}};
}

MeterRequest decode_metering(const Json& j) {
  return {j.at("meters"), j.at("source"), j.at("domain"), j.at("sysfs"),
          Nanos(j.at("window_ns").get<std::int64_t>())};
}

Json encode(const std::optional<double>& value) { return value ? Json(*value) : Json(); }

std::optional<double> decode_number(const Json& j) {
  if (j.is_null()) return std::nullopt;
  return j.get<double>();
}

Json encode(const std::optional<MeteredCalls>& m) {
  if (!m) return {};
  return {{"source", m->source},
          {"domain", m->domain},
          {"calls", m->calls},
          {"duration_ns", m->duration.count()},
          {"active_j", encode(m->active_j)},
          {"idle_before_w", encode(m->idle_before_w)},
          {"idle_after_w", encode(m->idle_after_w)},
          {"reasons", m->reasons},
          {"repeats_j", m->repeats_j}};
}

std::optional<MeteredCalls> decode_metered(const Json& j) {
  if (j.is_null()) return std::nullopt;
  return MeteredCalls{j.at("source"),
                      j.at("domain"),
                      j.at("calls"),
                      Nanos(j.at("duration_ns").get<std::int64_t>()),
                      decode_number(j.at("active_j")),
                      decode_number(j.at("idle_before_w")),
                      decode_number(j.at("idle_after_w")),
                      j.at("reasons").get<std::vector<std::string>>(),
                      j.value("repeats_j", std::vector<double>())};
}

Json encode(const DeviceInfo& device) {
  return {{"name", device.name},
          {"platform", device.platform},
          {"version", device.version},
          {"compute_units", device.compute_units},
          {"is_cpu", device.is_cpu},
          {"cache_bytes", device.cache_bytes ? Json(*device.cache_bytes) : Json()},
          {"tuning", device.tuning},
          {"remark", device.remark},
          {"pci", device.pci},
          {"own_memory", device.own_memory}};
}

DeviceInfo decode_device(const Json& j) {
  DeviceInfo device{j.at("name"), j.at("platform"), j.at("version"), j.at("compute_units"),
                    j.at("is_cpu")};
  if (!j.at("cache_bytes").is_null()) device.cache_bytes = j.at("cache_bytes").get<std::int64_t>();
  device.tuning = j.value("tuning", "");  // Records of interrupted runs of before have none,
  device.remark = j.value("remark", "");  // of this neither,
  device.pci = j.value("pci", "");        // nor these.
  device.own_memory = j.value("own_memory", false);
  return device;
}

Json encode(const Probe& probe) {
  Json devices = Json::array();
  for (const DeviceInfo& device : probe.devices) devices.push_back(encode(device));
  return {{"available", probe.available}, {"reason", probe.reason}, {"devices", devices}};
}

std::optional<Probe> decode_probe(const Json& j) {
  if (j.is_null()) return std::nullopt;
  Probe probe{j.at("available"), j.at("reason"), {}};
  for (const auto& device : j.at("devices")) probe.devices.push_back(decode_device(device));
  return probe;
}

Json encode(const PeakFigure& peak) {
  return {{"kind", to_string(peak.kind)},
          {"per_second", peak.per_second ? Json(*peak.per_second) : Json()},
          {"variant", peak.variant},
          {"reasons", peak.reasons}};
}

PeakFigure decode_peak(const Json& j) {
  PeakFigure peak;
  peak.kind = decode_word(j.at("kind"), peak_kind_from_string);
  if (!j.at("per_second").is_null()) peak.per_second = j.at("per_second").get<double>();
  peak.variant = j.at("variant");
  peak.reasons = j.at("reasons").get<std::vector<std::string>>();
  return peak;
}

Json encode(const std::optional<Nanos>& time) { return time ? Json(time->count()) : Json(); }

std::optional<Nanos> decode_time(const Json& j) {
  if (j.is_null()) return std::nullopt;
  return Nanos(j.get<std::int64_t>());
}

Json encode(std::optional<std::int64_t> count) { return count ? Json(*count) : Json(); }

std::optional<std::int64_t> decode_count(const Json& j) {
  if (j.is_null()) return std::nullopt;
  return j.get<std::int64_t>();
}

Json encode(const std::vector<PhaseAccount>& accounts) {
  Json list = Json::array();
  for (const auto& [phase, accounting] : accounts) {
    list.push_back({{"phase", to_string(phase)},
                    {"provenance", to_string(accounting.provenance)},
                    {"unknown", accounting.unknown}});
  }
  return list;
}

std::vector<PhaseAccount> decode_accounts(const Json& list) {
  std::vector<PhaseAccount> accounts;
  for (const auto& j : list) {
    accounts.push_back(
        {decode_word(j.at("phase"), phase_from_string),
         {decode_word(j.at("provenance"), provenance_from_string), j.at("unknown")}});
  }
  return accounts;
}

Json encode(const Interference& found) {
  return {{"contended", found.contended},
          {"crowded", found.crowded},
          {"throttled", found.throttled},
          {"others", encode(found.others)}};
}

Interference decode_interference(const Json& j) {
  return {j.at("contended"), j.at("crowded"), j.at("throttled"),
          decode_number(j.value("others", Json()))};
}

Json encode(const PhaseSamples& p) {
  return {{"phase", to_string(p.phase)},
          {"samples_ns", encode(p.samples)},
          {"batch", p.batch},
          {"bound_ns", encode(p.bound)},
          {"cpu_ns", encode(p.cpu)},
          {"odd_stamps", p.odd_stamps}};
}

PhaseSamples decode_phase(const Json& j) {
  return {decode_word(j.at("phase"), phase_from_string),
          decode_times(j.at("samples_ns")),
          j.at("batch"),
          decode_time(j.value("bound_ns", Json())),
          decode_times(j.value("cpu_ns", Json::array())),
          j.value("odd_stamps", std::int64_t{0})};
}

JobResult decode_result(const Json& j) {
  JobResult result;
  result.done = j.at("done");
  result.step = j.at("step");
  result.error = j.at("error");
  if (!j.at("device").is_null()) result.device = decode_device(j.at("device"));
  result.found = decode_probe(j.value("found", Json()));
  result.provenance = decode_word(j.at("provenance"), provenance_from_string);
  // Records of interrupted runs of before have none of these.
  result.accounts = decode_accounts(j.value("accounts", Json::array()));
  result.own_clock = j.value("own_clock", false);
  result.deterministic = j.value("deterministic", false);
  result.clock = {j.at("clock_cost_ns"), Nanos(j.at("clock_resolution_ns").get<std::int64_t>())};
  result.device_init = decode_time(j.at("device_init_ns"));
  result.prepare = decode_time(j.at("prepare_ns"));
  result.verification = j.at("verification");
  result.wrong_output = j.at("wrong_output");
  result.during_setup = decode_interference(j.at("during_setup"));
  result.during_calls = decode_interference(j.at("during_calls"));
  result.notes = j.at("notes").get<std::vector<std::string>>();
  result.ops = decode_count(j.at("ops"));
  result.bytes = decode_count(j.at("bytes"));
  result.host_memory_bytes = decode_count(j.value("host_memory_bytes", Json()));
  result.device_memory_bytes = decode_count(j.value("device_memory_bytes", Json()));
  for (const auto& phase : j.at("phases")) result.phases.push_back(decode_phase(phase));
  for (const auto& each : j.value("conditions", Json::array())) {
    result.conditions.push_back(
        {decode_word(each.at("condition"), condition_from_string), decode_phase(each)});
  }
  result.metered = decode_metered(j.value("metered", Json()));
  for (const auto& peak : j.at("peaks")) result.peaks.push_back(decode_peak(peak));
  result.definitions = j.value("definitions", "");
  return result;
}

JobResult result_from(const Json& j) {
  try {
    return decode_result(j);
  } catch (const JsonError& error) {
    throw_bad_input(fmt::format("this is no record of this version's worker ({})", error.what()));
  }
}

}  // namespace

Accounting JobResult::accounting(Phase phase) const {
  const auto account = std::ranges::find(accounts, phase, &PhaseAccount::phase);
  return account == accounts.end() ? Accounting{provenance} : account->accounting;
}

/// Preparing ends with a call.
Origin JobResult::origin(Phase phase) const {
  if (phase == Phase::kPrepare) {
    Origin sum = accounting(phase).provenance;
    if (sum == Origin(Provenance::kMeasured)) return sum;
    for (const auto& [part, each] : accounts) {
      if (!is_setup(part)) sum = sum_of(sum, each.provenance);
    }
    return sum;
  }
  if (phase != Phase::kCall) return accounting(phase).provenance;
  std::optional<Origin> sum;
  for (const PhaseSamples& part : phases) {
    if (part.phase == Phase::kCall || part.samples.empty()) continue;
    const Origin of_part = accounting(part.phase).provenance;
    sum = sum ? sum_of(*sum, of_part) : of_part;
  }
  return sum.value_or(provenance);
}

std::string JobResult::unknown(Phase phase) const {
  if (phase != Phase::kCall) return accounting(phase).unknown;
  for (const auto& [part, accounting] : accounts) {
    if (is_setup(part) || accounting.unknown.empty()) continue;
    return fmt::format("its {} is: {}", to_string(part), accounting.unknown);
  }
  return "";
}

bool JobResult::is_measured(Phase phase) const {
  if (!own_clock) return true;
  if (phase != Phase::kCall) return accounting(phase).provenance == Provenance::kMeasured;
  return std::ranges::any_of(phases, [this](const PhaseSamples& part) {
    return part.phase != Phase::kCall && is_measured(part.phase);
  });
}

bool JobResult::repeats(Phase phase) const {
  if (!deterministic) return false;
  const auto is_measured = [](const PhaseAccount& account) {
    return account.accounting.unknown.empty() && account.phase != Phase::kDeviceInit &&
           account.accounting.provenance == Provenance::kMeasured;
  };
  if (phase == Phase::kPrepare) return std::ranges::none_of(accounts, is_measured);
  if (phase != Phase::kCall) return accounting(phase).provenance != Provenance::kMeasured;
  return std::ranges::all_of(phases, [this](const PhaseSamples& part) {
    return part.phase == Phase::kCall || part.samples.empty() || repeats(part.phase);
  });
}

std::string to_json(const Job& job) {
  const Json unit = {{"unit", job.unit.unit},
                     {"cores", job.unit.cores},
                     {"device", job.unit.device},
                     {"script", job.unit.script},
                     {"options", job.unit.options}};
  const Json j = {{"protocol", kProtocol},
                  {"kind", static_cast<int>(job.kind)},
                  {"backend", job.backend},
                  {"unit", unit},
                  {"workload", job.workload},
                  {"own", job.own},
                  {"own_digest", job.own_digest},
                  {"seed", job.seed},
                  {"images", job.images},
                  {"images_topic", job.images_topic},
                  {"reference", job.reference},
                  {"inputs", job.inputs},
                  {"verifies_first", job.verifies_first},
                  {"sampling", encode(job.sampling)},
                  {"metering", encode(job.metering)},
                  {"neighbours", job.neighbours}};
  return json_text(j);
}

Job job_from_json(const std::string& text) {
  try {
    const Json j = parse_json(text);
    if (const int protocol = j.at("protocol"); protocol != kProtocol) {
      throw_bad_input(
          fmt::format("the job has protocol {}, and this worker knows {}; coordinator and "
                      "worker must be the same program",
                      protocol, kProtocol));
    }
    Job job;
    const int kind = j.at("kind");
    if (kind < 0 || kind > static_cast<int>(JobKind::kDevices)) {
      throw_bad_input(fmt::format("unknown kind of job {}", kind));
    }
    job.kind = static_cast<JobKind>(kind);
    job.backend = j.at("backend");
    const Json& unit = j.at("unit");
    job.unit = {unit.at("unit"), unit.at("cores").get<std::vector<int>>(), unit.at("device"),
                unit.at("script"), unit.at("options").get<std::map<std::string, double>>()};
    job.workload = j.at("workload");
    job.own = j.at("own");
    job.own_digest = j.at("own_digest");
    job.seed = j.at("seed");
    job.images = j.at("images");
    job.images_topic = j.at("images_topic");
    job.reference = j.at("reference");
    job.inputs = j.at("inputs");
    job.verifies_first = j.at("verifies_first");
    job.sampling = decode_sampling(j.at("sampling"));
    job.metering = decode_metering(j.at("metering"));
    job.neighbours = j.at("neighbours").get<std::vector<std::vector<int>>>();
    return job;
  } catch (const JsonError& error) {
    throw_bad_input(
        fmt::format("this is no worker's job ({}); `worker` is started by characterize "
                    "and not by hand",
                    error.what()));
  }
}

std::string to_record(const JobResult& r) {
  Json phases = Json::array();
  for (const PhaseSamples& p : r.phases) phases.push_back(encode(p));
  Json conditions = Json::array();
  for (const auto& [condition, samples] : r.conditions) {
    Json each = encode(samples);
    each["condition"] = to_string(condition);
    conditions.push_back(std::move(each));
  }
  Json peaks = Json::array();
  for (const PeakFigure& peak : r.peaks) peaks.push_back(encode(peak));
  const Json j = {{"done", r.done},
                  {"definitions", r.definitions},
                  {"step", r.step},
                  {"error", r.error},
                  {"device", r.device ? encode(*r.device) : Json()},
                  {"found", r.found ? encode(*r.found) : Json()},
                  {"provenance", to_string(r.provenance)},
                  {"accounts", encode(r.accounts)},
                  {"own_clock", r.own_clock},
                  {"deterministic", r.deterministic},
                  {"clock_cost_ns", r.clock.cost_ns},
                  {"clock_resolution_ns", r.clock.resolution.count()},
                  {"device_init_ns", encode(r.device_init)},
                  {"prepare_ns", encode(r.prepare)},
                  {"verification", r.verification},
                  {"wrong_output", r.wrong_output},
                  {"during_setup", encode(r.during_setup)},
                  {"during_calls", encode(r.during_calls)},
                  {"notes", r.notes},
                  {"ops", encode(r.ops)},
                  {"bytes", encode(r.bytes)},
                  {"host_memory_bytes", encode(r.host_memory_bytes)},
                  {"device_memory_bytes", encode(r.device_memory_bytes)},
                  {"phases", phases},
                  {"conditions", conditions},
                  {"metered", encode(r.metered)},
                  {"peaks", peaks}};
  // Drivers' texts need not be UTF-8.
  return std::string(kRecordPrefix) + json_text(j);
}

std::string progress_record(const std::string& what) { return std::string(kProgress) + what; }

std::string last_progress(std::string_view output) {
  const auto end = output.rfind('\n');
  const auto begin = output.substr(0, end).rfind(kProgress);
  if (end == std::string_view::npos || begin == std::string_view::npos) return "";
  const auto text = output.substr(begin + kProgress.size());
  return std::string(text.substr(0, text.find('\n')));
}

JobResult last_record(std::string_view output) {
  while (!output.empty()) {
    const auto line_end = output.rfind('\n');
    if (line_end == std::string_view::npos) break;                       // never completed
    const auto line_begin = output.substr(0, line_end).rfind('\n') + 1;  // npos + 1 == 0
    const auto line = output.substr(line_begin, line_end - line_begin);
    output = output.substr(0, line_begin);
    // A library that prints without an end of line may stand before the record.
    const auto prefix = line.find(kRecordPrefix);
    if (prefix == std::string_view::npos) continue;
    const auto json = try_parse_json(line.substr(prefix + kRecordPrefix.size()));
    if (json) return result_from(*json);
  }
  return {};
}

}  // namespace pirt
