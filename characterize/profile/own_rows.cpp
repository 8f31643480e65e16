#include "characterize/profile/own_rows.h"

#include <fmt/core.h>

#include <algorithm>
#include <set>
#include <vector>

#include "workloads/base/error.h"
#include "workloads/base/text/json.h"
#include "workloads/base/text/text.h"
#include "workloads/catalog/own_list.h"
#include "workloads/own/definition.h"

namespace pirt {
namespace {

own::Definition definition_of(const RunInfo& run, const std::string& key, const std::string& text) {
  try {
    return own::definition_from(parse_json(text));
  } catch (const std::exception& error) {  // JsonError, Error
    throw_bad_input(fmt::format("run {}: '{}' says of no workload what it is: {}", run.run_id, key,
                                error.what()));
  }
}

/// Calls @p use(definition) for those that the run says.
template <typename Use>
void for_each_definition(const RunInfo& run, const Use& use) {
  for (auto fact = run.environment.lower_bound(std::string(kOwnFact));
       fact != run.environment.end() && fact->first.starts_with(kOwnFact); ++fact) {
    use(definition_of(run, fact->first, fact->second));
  }
}

}  // namespace

std::map<std::string, std::string> own_facts(const Workload& workload) {
  const OwnOperation* const own = own_operation(workload);
  if (own == nullptr) return {};
  return {{std::string(kOwnFact) + own::plain_name(workload.name), own->definition}};
}

void learn_workloads(const Profile& profile) {
  for (const RunInfo& run : profile.runs) {
    for_each_definition(run, [](const own::Definition& definition) {
      if (try_find_own(definition.name) != nullptr) return;
      std::vector<Workload> one;
      one.push_back(own::to_workload(definition));
      make_known(std::move(one));
    });
  }
}

std::set<std::string> measured_of(const Profile& profile, const std::string& file,
                                  const std::string& digest) {
  std::set<std::string> names, seen;
  for (const RunInfo& run : profile.runs) {
    for_each_definition(run, [&](const own::Definition& definition) {
      if (!seen.insert(definition.name).second) return;  // It is where the newest run has it.
      if (definition.source == file || definition.digest == digest) names.insert(definition.name);
    });
  }
  return names;
}

std::string doubt_changed(Profile& profile, const std::set<std::string>& workloads,
                          const std::string& digest) {
  std::set<std::string> names;
  for (const RunInfo& run : profile.runs) {
    std::set<std::string> changed;
    for_each_definition(run, [&](const own::Definition& definition) {
      const bool other = definition.digest != digest && workloads.contains(definition.name);
      if (other) changed.insert(definition.name);
    });
    const auto doubt = [&](auto& rows) {
      for (auto& row : rows) {
        if (row.run_id != run.run_id || !changed.contains(own::plain_name(row.workload))) continue;
        if (std::ranges::find(row.doubts, kChanged) == row.doubts.end()) {
          row.doubts.emplace_back(kChanged);
        }
        names.insert(row.workload);
      }
    };
    doubt(profile.phases);
    doubt(profile.conditions);
    doubt(profile.energies);
  }
  return join(std::vector(names.begin(), names.end()), ", ");
}

void doubt_older(Profile& profile) {
  std::map<std::string, std::string> newest;  // Digests; runs are the newest first.
  for (const RunInfo& run : profile.runs) {
    for_each_definition(run, [&newest](const own::Definition& definition) {
      newest.emplace(definition.name, definition.digest);
    });
  }
  for (const auto& [name, digest] : newest) doubt_changed(profile, {name}, digest);
}

}  // namespace pirt
