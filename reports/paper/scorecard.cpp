#include "reports/paper/scorecard.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>

#include "reports/document/figures.h"
#include "reports/paper/paper_figures.h"
#include "workloads/base/text/json.h"
#include "workloads/catalog/catalog.h"

namespace pirt {
namespace {

struct Contradiction {
  const char* where;
  const char* says;
  const char* but;
};

/// Found by reading; each is arithmetic on the paper's own words.
constexpr std::array kContradictions = {
    Contradiction{"Table I", "CONV2 takes 895.5 M operations",
                  "its shape gives 895.795 M, which rounds to 895.8; the other layers agree"},
    Contradiction{"Section V", "localization improves by 60 %",
                  "15 to 25 frames a second are 67 %"},
    Contradiction{"Section V", "object recognition improves 3-fold",
                  "1.5 s a frame to 3 a second are 4.5-fold"},
    Contradiction{"Observation 3, Table V",
                  "the DSP is preferable for convolution, set-up included",
                  "Table V, where the runtime has set everything up, has it slowest: 18.61 ms and "
                  "19.62 ms against 6.84 and 7.45"},
    Contradiction{"Table III, Fig. 4",
                  "the DSP is more energy-efficient for most workloads except convolution",
                  "Table III gives it two of six: Sobel and feature detection"},
    Contradiction{"Table IV, text", "the GPU is around 10 times faster than the CPU",
                  "0.400 s to 0.033 s are 12 times"},
    Contradiction{"Table IV, Section V", "the CPU recognizes an image in 0.400 s",
                  "Section V says 1.5 s a frame: another board (TX1, Snapdragon), and other work "
                  "beside it"},
    Contradiction{"Algorithms 2 and 3, Table V", "a full queue is overflowed into by the `else`",
                  "with 1000 frames waiting, 996 would go to the CPU, or 998 to the DSP, and "
                  "Table V's latencies could not be: work in flight was bounded"},
    Contradiction{"Table V, energy mode", "0.307 frames a ms at 8.24 ms (GPU) and 18.61 ms (DSP)",
                  "by Little's law that needs 1.2 frames on the DSP, beside 2 on the GPU; no whole "
                  "number does"},
    Contradiction{"Section IV, Section V", "throughput mode fills the GPU first, then the CPU",
                  "Section V, in that mode, places by kind: vision on the DSP, networks on the "
                  "GPU, the rest on the CPU"}};

/// With a sign, so that the eye finds it in a long table.
std::string_view short_word(Finding finding) {
  switch (finding) {
    case Finding::kConfirmed:
      return "✓ confirmed";
    case Finding::kRefuted:
      return "✗ refuted";
    case Finding::kNotTestable:
      return "– not testable";
    case Finding::kFitted:
      return "= fitted";
    case Finding::kByConstruction:
      return "= by construction";
  }
  return "";
}

/// What is in no count behind the others.
std::vector<Claim> apart_last(std::vector<Claim> claims) {
  // Not std::ranges: clang 14 does not compile the subrange of this libstdc++.
  std::stable_partition(claims.begin(), claims.end(), [](const Claim& claim) {
    return claim.finding != Finding::kFitted && claim.finding != Finding::kByConstruction;
  });
  return claims;
}

}  // namespace

std::string_view to_string(Finding finding) {
  switch (finding) {
    case Finding::kConfirmed:
      return "confirmed";
    case Finding::kRefuted:
      return "refuted";
    case Finding::kNotTestable:
      return "not testable here";
    case Finding::kFitted:
      return "fitted";
    case Finding::kByConstruction:
      return "by construction";
  }
  return "";
}

void append(std::vector<Claim>& to, std::vector<Claim> more) {
  to.insert(to.end(), std::make_move_iterator(more.begin()), std::make_move_iterator(more.end()));
}

Claim decided(Claim claim, bool holds, const std::string& here, std::string_view from,
              const std::string& why) {
  claim.finding = holds ? Finding::kConfirmed : Finding::kRefuted;
  claim.here = here;
  claim.from = from;
  claim.why = why;
  return claim;
}

Claim not_testable(Claim claim, const std::string& why) {
  claim.finding = Finding::kNotTestable;
  claim.why = why;
  return claim;
}

Claim fitted_to(Claim claim, bool within, const std::string& here, const std::string& why) {
  claim.finding = Finding::kFitted;
  claim.here = here;
  claim.from = "fitted";
  claim.why = (within ? "" : "MISSED: ") + why;
  return claim;
}

std::optional<Role> real_role(const Evidence& evidence, const std::string& unit) {
  const UnitModel* model =
      evidence.platform == nullptr ? nullptr : evidence.platform->find_unit(unit);
  const auto role = model == nullptr ? role_from_string(unit) : std::optional(model->role);
  const UnitRecord* record = evidence.profile->find_unit(unit);
  const bool on_host = record != nullptr && record->device_is_cpu;
  return on_host && role != Role::kCpu ? std::nullopt : role;
}

std::vector<std::string> real_units(const Evidence& evidence) {
  std::vector<std::string> units = evidence.profile->units();
  std::erase_if(units, [&](const auto& unit) { return !real_role(evidence, unit); });
  return units;
}

bool watts_are_known(const Evidence& evidence, const RunRecord& run) {
  return std::ranges::all_of(run.units, [&](const UnitResult& result) {
    const UnitModel* unit =
        evidence.platform == nullptr ? nullptr : evidence.platform->find_unit(result.unit);
    const bool is_cited = unit != nullptr && !unit->energy_source.empty();
    const bool is_modelled =
        result.energy_provenance.empty() ||
        std::ranges::find(result.energy_provenance, to_string(Provenance::kModelled)) !=
            result.energy_provenance.end();
    return result.completed == 0 || is_cited || !is_modelled;
  });
}

const RunRecord* find_mode(const std::vector<RunRecord>& runs, const std::string& mode) {
  const auto found = std::ranges::find(runs, mode, &RunRecord::mode);
  return found == runs.end() ? nullptr : &*found;
}

std::vector<Claim> operation_claims() {
  std::vector<Claim> claims;
  for (const paper::Ops& printed : paper::kTable1) {
    const Workload& workload = find_workload(printed.workload);
    if (!workload.ops) continue;
    const double ours = static_cast<double>(*workload.ops) / 1e6;
    // Of the last digit that is printed: a tenth, of FC8 a whole million.
    const double digit = printed.workload == "fc8" ? 1 : 0.1;
    const bool agrees = std::abs(ours - printed.millions) < digit;
    claims.push_back({"Table I", fmt::format("operations of {}", printed.workload),
                      marked(fmt::format("{} M", printed.millions), Provenance::kPublished),
                      fmt::format("{:.3f} M", ours), "its shape, 2 a multiply-add",
                      agrees ? Finding::kByConstruction : Finding::kRefuted,
                      agrees ? "" : "more than the last digit off"});
  }
  return claims;
}

std::vector<Claim> scorecard(const Evidence& evidence) {
  std::vector<Claim> claims = operation_claims();
  append(claims, observation_claims(evidence));
  append(claims, scheduling_claims(evidence));
  append(claims, section5_claims(evidence));
  return claims;
}

Table scorecard_table(const std::vector<Claim>& claims) {
  const auto count = [&](Finding finding) {
    return std::ranges::count(claims, finding, &Claim::finding);
  };
  Table table{
      .title = fmt::format("The paper's claims: {} confirmed, {} refuted, {} not testable "
                           "here",
                           count(Finding::kConfirmed), count(Finding::kRefuted),
                           count(Finding::kNotTestable)),
      .columns = {{"found", Align::kLeft},
                  {"claim", Align::kLeft},
                  {"paper", Align::kLeft},
                  {"here", Align::kLeft},
                  {"ours is", Align::kLeft},
                  {"because", Align::kLeft},
                  {"where", Align::kLeft}},
      .footnotes = {fmt::format("= stands apart and is in no count: {} figures that the model was "
                                "fitted to, which show nothing, and {} that hold by construction.",
                                count(Finding::kFitted), count(Finding::kByConstruction)),
                    "refuted: on this machine, or on the paper's own board as it is modelled; "
                    "not what the paper measured.",
                    std::string(provenance_legend())}};
  for (const Claim& claim : apart_last(claims)) {
    table.rows.push_back({std::string(short_word(claim.finding)), claim.claim, claim.paper,
                          claim.here, claim.from, claim.why, claim.where});
  }
  return table;
}

Table contradictions_table() {
  Table table{
      .title = "Where the paper contradicts itself",
      .columns = {{"where", Align::kLeft}, {"it says", Align::kLeft}, {"but", Align::kLeft}}};
  for (const Contradiction& each : kContradictions) {
    table.rows.push_back({each.where, each.says, each.but});
  }
  return table;
}

Json scorecard_json(const std::vector<Claim>& claims) {
  auto json = Json::array();
  for (const Claim& claim : claims) {
    json.push_back({{"where", claim.where},
                    {"claim", claim.claim},
                    {"finding", to_string(claim.finding)},
                    {"paper", claim.paper},
                    {"here", claim.here},
                    {"from", claim.from},
                    {"because", claim.why}});
  }
  return json;
}

}  // namespace pirt
