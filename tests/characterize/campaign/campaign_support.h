// A campaign over scripted units, into a database in a folder of its own.
#pragma once

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "characterize/campaign/campaign.h"
#include "characterize/profile/profile.h"
#include "characterize/profile/store/reader.h"
#include "tests/characterize/support.h"
#include "tests/support/paths.h"

namespace pirt::test {

/// Two cheap workloads on scripted units.
class Campaign : public ::testing::Test {
 protected:
  CampaignOptions options(const std::vector<std::pair<std::string, std::string>>& scripts,
                          const std::string& filter = "^pool[25]$") const {
    CampaignOptions result;
    result.database = folder / "p.db";
    result.platform = fake_platform(scripts);
    result.filter = filter;
    result.quick = true;
    result.program = kTestWorker;
    return result;
  }

  Profile measure(const CampaignOptions& o) {
    ProgressSink sink;
    sink.warning = [this](const std::string& text) { warnings.push_back(text); };
    summary = run_campaign(o, plan_campaign(o), sink);
    return load_profile(o.database);
  }

  TemporaryFolder folder;
  std::vector<std::string> warnings;
  CampaignSummary summary;
};

inline const PhaseRow& row(const Profile& profile, const std::string& workload, Phase phase,
                           State state = State::kSteady, const std::string& unit = "gpu") {
  const PhaseRow* found = profile.find(workload, unit, phase, state);
  if (found == nullptr) {
    throw std::runtime_error(
        fmt::format("no row {} {} {}", workload, to_string(phase), to_string(state)));
  }
  return *found;
}

}  // namespace pirt::test
