#include "scheduler/services/redraw.h"

#include <algorithm>
#include <cmath>
#include <memory>

#include "workloads/base/math/gaussian.h"
#include "workloads/base/math/random.h"

namespace pirt {
namespace {

constexpr double kAt95 = 1.959964;   // standard deviations
constexpr double kLeastPart = 1e-3;  // of what is measured, whatever its interval begins at

/// From a standard normal number: its 2.5 and 97.5 % are the ends of the interval, its median is 1.
double factor(const Service::Spread& spread, double normal) {
  const double end = normal < 0 ? std::max(spread.low, kLeastPart) : spread.high;
  return std::exp(std::abs(normal) / kAt95 * std::log(end));
}

Distribution times(const Distribution& time, double by) {
  Distribution result = time;
  result.low = scaled(time.low, by);
  result.high = scaled(time.high, by);
  if (time.samples) {
    std::vector<Nanos> samples = *time.samples;
    for (Nanos& each : samples) each = scaled(each, by);
    result.samples = std::make_shared<const std::vector<Nanos>>(std::move(samples));
  }
  return result;
}

void lengthen(double by, Service& service) {
  for (ServiceStage& stage : service.stages) stage.time = times(stage.time, by);
  if (!service.conditions) return;
  for (auto* cold : {&service.conditions->cold_cache, &service.conditions->cold_memory}) {
    if (*cold) *cold = times(**cold, by);
  }
}

/// That of the rows of a unit beside which others took its cores: the one in the middle.
Service::Spread contended_spread(const ServiceTable& services, UnitId unit) {
  std::vector<Service::Spread> spreads;
  for (const auto& row : services.entries) {
    if (row[unit].service && row[unit].service->taken > 0) {
      spreads.push_back(row[unit].service->spread);
    }
  }
  if (spreads.empty()) return {};
  std::ranges::sort(spreads, {}, [](const Service::Spread& s) { return s.high / s.low; });
  return spreads[spreads.size() / 2];
}

}  // namespace

void redraw(const Platform& platform, const Redraw& how, ServiceTable& services) {
  const bool ends = how.kind != Redraw::Kind::kDrawn;
  const auto drawn = [&](const std::string& name) {
    if (ends) return how.kind == Redraw::Kind::kShortest ? -kAt95 : kAt95;
    return Gaussian(derive_seed(static_cast<std::uint64_t>(how.number), name)).next();
  };
  for (UnitId unit = 0; unit < platform.units.size(); ++unit) {
    const std::string& name = platform.units[unit].name;
    const double common = factor(contended_spread(services, unit), drawn(name));
    for (WorkloadId workload = 0; workload < services.entries.size(); ++workload) {
      auto& service = services.entries[workload][unit].service;
      if (!service || !service->of_rows) continue;
      const std::string cell = services.workloads[workload] + " on " + name;
      const double own = factor(service->spread, drawn(cell));
      lengthen(own * (service->taken > 0 && !ends ? common : 1), *service);
      if (service->metered_j) *service->metered_j *= factor(service->joules, drawn("J of " + cell));
    }
  }
}

bool is_uncertain(const ServiceTable& services) {
  constexpr double kAlike = 1e-3;
  const auto wide = [](const Service::Spread& spread) { return spread.high - spread.low > kAlike; };
  return std::ranges::any_of(services.entries, [&](const std::vector<ServiceEntry>& row) {
    return std::ranges::any_of(row, [&](const ServiceEntry& entry) {
      return entry.service && entry.service->of_rows &&
             (wide(entry.service->spread) || wide(entry.service->joules));
    });
  });
}

}  // namespace pirt
