#include "reports/export/profile_export.h"

#include <fmt/core.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <charconv>

#include "characterize/profile/profile.h"
#include "characterize/profile/store/database_format.h"
#include "characterize/profile/store/reader.h"
#include "reports/profile/profile_report.h"
#include "reports/profile/roofline_report.h"
#include "workloads/base/error.h"
#include "workloads/base/text/json.h"
#include "workloads/base/text/name_filter.h"
#include "workloads/base/text/text.h"

namespace pirt {

NameFilter workload_filter(const Profile& profile, const std::string& filter) {
  NameFilter wanted(filter);
  const auto names = profile.workloads();
  if (std::ranges::none_of(names, [&](const auto& name) { return wanted.picks(name); })) {
    throw_bad_input(fmt::format("--filter '{}' matches no workload of '{}'{}", filter, profile.path,
                                suggestion(filter, names)));
  }
  return wanted;
}

void keep_workloads(Profile& profile, const std::string& filter) {
  const NameFilter wanted = workload_filter(profile, filter);
  const auto other = [&wanted](const auto& row) { return !wanted.picks(row.workload); };
  std::erase_if(profile.phases, other);
  std::erase_if(profile.conditions, other);
  std::erase_if(profile.energies, other);
}

Profile load_with_samples(const std::filesystem::path& path, std::string_view platform,
                          const std::string& filter) {
  const ProfileReader reader(path);
  Profile profile = reader.read(platform);
  if (!filter.empty()) keep_workloads(profile, filter);
  reader.read_samples(profile);
  return profile;
}

Json export_json(const Profile& profile) {
  auto json = profile_json(profile, {});
  json.erase("preferable");
  const auto add_samples = [&json](const char* view, const std::vector<PhaseRow>& rows) {
    for (std::size_t i = 0; i < rows.size(); ++i) {
      auto& row = json[view][i];
      row["samples_ns"] = Json::array();
      row["processes_of_samples"] = Json::array();
      for (const Nanos sample : rows[i].values) row["samples_ns"].push_back(sample.count());
      for (const auto process : rows[i].value_processes) {
        row["processes_of_samples"].push_back(process);
      }
    }
  };
  add_samples("profile_summary", profile.phases);
  add_samples("condition_summary", profile.conditions);
  for (std::size_t i = 0; i < profile.unit_times.size(); ++i) {
    auto& samples = json["unit_time_summary"][i]["samples_ns"] = Json::array();
    for (const Nanos sample : profile.unit_times[i].values) samples.push_back(sample.count());
  }
  for (std::size_t i = 0; i < profile.runs.size(); ++i) {
    json["runs"][i]["identity"] = profile.runs[i].identity;
  }
  json["peaks"] = Json::array();
  for (const PeakRow& peak : profile.peaks) json["peaks"].push_back(peak_json(peak));
  return json;
}

namespace {

class Csv {
 public:
  explicit Csv(std::string_view header) : text_(header) { text_ += '\n'; }

  Csv& add(std::string_view value) {
    if (!first_) text_ += ',';
    first_ = false;
    if (value.find_first_of(",\"\r\n") == std::string_view::npos) {
      text_ += value;
      return *this;
    }
    text_ += '"';
    for (const char c : value) text_ += c == '"' ? std::string("\"\"") : std::string(1, c);
    text_ += '"';
    return *this;
  }
  Csv& add(std::int64_t value) { return add(std::string_view(std::to_string(value))); }
  Csv& add(bool value) { return add(std::int64_t{value}); }
  Csv& add(double value) { return add(std::string_view(fmt::format("{}", value))); }
  Csv& add(Nanos value) { return add(value.count()); }
  Csv& add(const std::vector<std::string>& words) {
    return add(std::string_view(join_words(words)));
  }
  template <typename T>
  Csv& add(const std::optional<T>& value) {
    return value ? add(*value) : add(std::string_view());
  }
  void end_line() {
    text_ += '\n';
    first_ = true;
  }
  [[nodiscard]] const std::string& text() const { return text_; }

 private:
  std::string text_;
  bool first_ = true;
};

/// Of view profile_summary or condition_summary.
std::string phases_csv(const std::vector<PhaseRow>& rows) {
  Csv csv(
      "run_id,platform,workload,unit,backend,phase,state,provenance,valid,reasons,notes,samples,"
      "median_ns,mad_ns,p95_ns,p99_ns,ci_low_ns,ci_high_ns,ops,bytes,processes,mixture,"
      "bound_ns,cpu_ns,taken,host_memory_bytes,device_memory_bytes,doubts");
  for (const PhaseRow& row : rows) {
    const bool steady = row.condition == Condition::kSteady;
    csv.add(row.run_id).add(row.platform).add(row.workload).add(row.unit).add(row.backend);
    csv.add(to_string(row.phase)).add(steady ? to_string(row.state) : to_string(row.condition));
    csv.add(to_string(row.provenance));
    csv.add(is_valid(row)).add(row.reasons).add(row.notes).add(row.samples).add(row.median);
    csv.add(row.mad).add(row.p95).add(row.p99).add(row.ci_low).add(row.ci_high).add(row.ops);
    csv.add(row.bytes).add(row.processes).add(row.provenance.mixture).add(row.bound).add(row.cpu);
    csv.add(row.taken).add(row.host_memory_bytes).add(row.device_memory_bytes).add(row.doubts);
    csv.end_line();
  }
  return csv.text();
}

std::string unit_times_csv(const Profile& profile) {
  Csv csv(
      "run_id,platform,unit,backend,phase,sleep_ns,provenance,valid,reasons,samples,median_ns,"
      "mad_ns,p95_ns,p99_ns,ci_low_ns,ci_high_ns,doubts");
  for (const UnitTimeRow& row : profile.unit_times) {
    csv.add(row.run_id).add(profile.platform()).add(row.unit).add(row.backend);
    csv.add(to_string(row.phase)).add(row.sleep);
    csv.add(to_string(Provenance::kMeasured)).add(is_valid(row)).add(row.reasons).add(row.samples);
    csv.add(row.median).add(row.mad).add(row.p95).add(row.p99).add(row.ci_low).add(row.ci_high);
    csv.add(row.doubts).end_line();
  }
  return csv.text();
}

std::string energy_csv(const Profile& profile) {
  Csv csv(
      "run_id,workload,unit,energy_j,provenance,source,valid,reasons,domain,idle_subtracted,"
      "mixture,ci_low_j,ci_high_j,doubts");
  for (const EnergyRow& row : profile.energies) {
    csv.add(row.run_id).add(row.workload).add(row.unit).add(row.energy_j);
    csv.add(to_string(row.provenance)).add(row.source).add(is_valid(row)).add(row.reasons);
    csv.add(row.domain).add(row.idle_subtracted).add(row.provenance.mixture).add(row.ci_low_j);
    csv.add(row.ci_high_j).add(row.doubts).end_line();
  }
  return csv.text();
}

std::string peaks_csv(const Profile& profile) {
  Csv csv("run_id,unit,kind,per_second,variant,provenance,valid,reasons,doubts");
  for (const PeakRow& row : profile.peaks) {
    csv.add(row.run_id).add(row.unit).add(to_string(row.kind)).add(row.per_second);
    csv.add(row.variant)
        .add(to_string(row.provenance))
        .add(is_valid(row))
        .add(row.reasons)
        .add(row.doubts);
    csv.end_line();
  }
  return csv.text();
}

std::string samples_csv(const Profile& profile) {
  Csv csv("run_id,workload,unit,phase,state,provenance,valid,position,process,ns");
  for (const PhaseRow& row : profile.phases) {
    for (std::size_t i = 0; i < row.values.size(); ++i) {
      csv.add(row.run_id).add(row.workload).add(row.unit).add(to_string(row.phase));
      csv.add(to_string(row.state)).add(to_string(row.provenance)).add(is_valid(row));
      csv.add(static_cast<std::int64_t>(i)).add(std::int64_t{row.value_processes[i]});
      csv.add(row.values[i]).end_line();
    }
  }
  return csv.text();
}

}  // namespace

std::string export_csv(const Profile& profile, CsvTable table) {
  switch (table) {
    case CsvTable::kProfile:
      return phases_csv(profile.phases);
    case CsvTable::kConditions:
      return phases_csv(profile.conditions);
    case CsvTable::kUnitTimes:
      return unit_times_csv(profile);
    case CsvTable::kEnergy:
      return energy_csv(profile);
    case CsvTable::kPeaks:
      return peaks_csv(profile);
    case CsvTable::kSamples:
      return samples_csv(profile);
  }
  return {};
}

}  // namespace pirt
