#include "reports/profile/environment_report.h"

#include <map>

#include "characterize/machine/environment_keys.h"
#include "characterize/profile/identity.h"

namespace pirt {
namespace {

/// Facts that are not of the identity and known, or not known, by their plain keys.
struct Facts {
  std::map<std::string, std::string> information, unknown;
};

Facts facts_of(const RunInfo& run, const std::map<std::string, std::string>& identity) {
  Facts facts;
  for (const auto& [key, value] : run.environment) {
    if (identity.contains(key)) continue;
    const std::string plain(without_unknown(key));
    (plain == key ? facts.information : facts.unknown)[plain] = value;
  }
  return facts;
}

}  // namespace

Table environment_table(const Profile& profile) {
  const RunInfo& run = profile.runs.front();
  Table table{.title = "Environment of run " + std::to_string(run.run_id),
              .columns = {{"fact", Align::kLeft}, {"kind", Align::kLeft}, {"value", Align::kLeft}}};
  const auto identity = identity_of(run);
  const Facts facts = facts_of(run, identity);
  const auto kind_of = [&](const std::string& key) {
    return std::string(to_string(fact_kind(key)));
  };
  for (const auto& [key, value] : identity) table.rows.push_back({key, "identity", value});
  for (const auto& [key, value] : facts.information)
    table.rows.push_back({key, "information", value});
  for (const auto& [key, why] : facts.unknown) {
    table.rows.push_back({key, kind_of(key), "not known: " + why});
  }
  table.footnotes = {"identity: must match for the figures of two runs to be compared."};
  return table;
}

}  // namespace pirt
