#include "scheduler/services/scenario.h"

#include <utility>

namespace pirt {

Scenario make_scenario(const Platform& platform, const Profile* profile, const Mix& mix,
                       ServiceOptions options, CloudUse cloud_use) {
  options.given = given_services(platform, mix);
  const bool slices = options.slices;
  ServiceTable services = resolve_services(platform, profile, workloads_of(mix), options);
  admit_by_memory(platform, mix, services);
  check_every_workload_served(platform, profile, mix, services, cloud_use);
  std::vector<std::string> warnings;
  auto classes = task_classes(platform, mix, services, options.only, warnings);
  services.warnings.insert(services.warnings.end(), warnings.begin(), warnings.end());
  return {.platform = platform,
          .mix = mix,
          .services = std::move(services),
          .classes = std::move(classes),
          .slices = slices};
}

}  // namespace pirt
