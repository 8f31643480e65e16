#include "cli/commands/measure/unit_times.h"

#include <memory>

#include "characterize/platform/platform.h"
#include "characterize/worker/reread.h"
#include "scheduler/unit_times/handover.h"
#include "scheduler/unit_times/leave.h"
#include "workloads/base/system/caches.h"

namespace pirt::cli {
namespace {

constexpr int kLeaves = 200;
constexpr int kCold = 20;
/// Of samples that are taken at once.
constexpr Nanos kPortion = std::chrono::milliseconds(400);
/// What a sample takes beside its sleep; starting the threads that take them.
constexpr Nanos kSample = std::chrono::microseconds(500);
constexpr Nanos kStart = std::chrono::milliseconds(20);
constexpr double kBytesASecond = 4e9;  // that a core writes at least

Nanos expected(int samples, Nanos each) { return kStart + samples * each; }

int portion_of(const SleepPlan& plan) {
  if (plan.sleep == Nanos(0)) return plan.samples;
  return std::max(1, static_cast<int>(kPortion / plan.sleep));
}

UnitTimePart part_of(UnitPhase phase, const SleepPlan& plan,
                     std::function<std::vector<Nanos>(int)> measure) {
  return {.phase = phase,
          .sleep = plan.sleep,
          .samples = plan.samples,
          .portion = portion_of(plan),
          .expected = expected(plan.samples, plan.sleep + kSample),
          .measure = std::move(measure)};
}

void add_rereads(const std::vector<int>& cores, std::vector<UnitTimePart>& parts) {
  if (!Reread::possible(cores)) return;
  // Made where it is needed: it holds as much as the caches do.
  const auto made = std::make_shared<std::unique_ptr<Reread>>();
  const auto reread = [made, cores]() -> Reread& {
    if (!*made) *made = std::make_unique<Reread>(cores);
    return **made;
  };
  for (const SleepPlan& plan : Reread::plans()) {
    parts.push_back(part_of(UnitPhase::kReread, plan, [reread, sleep = plan.sleep](int samples) {
      return reread().after({sleep, samples});
    }));
  }
  const Nanos sweep =
      from_ms(1e3 * static_cast<double>(*reached_cache_bytes(cores)) / kBytesASecond);
  parts.push_back({.phase = UnitPhase::kRereadCold,
                   .sleep = Nanos(0),
                   .samples = kCold,
                   .portion = 4,
                   .expected = expected(kCold, sweep + kSample),
                   .measure = [reread](int samples) { return reread().cold(samples); }});
}

}  // namespace

std::vector<UnitTimePart> unit_time_parts(const UnitRecord& unit) {
  std::vector<UnitTimePart> parts;
  // A GPU is handed its calls by a thread as well; dsp, fpga and the cloud have clocks of their
  // own.
  if (!unit.device_is_cpu && unit.backend != "opencl") return parts;
  for (const SleepPlan& plan : handover_plans()) {
    parts.push_back(
        part_of(UnitPhase::kHandover, plan, [cores = unit.cores, sleep = plan.sleep](int samples) {
          return measure_handover(cores, {sleep, samples});
        }));
  }
  if (!unit.device_is_cpu) return parts;
  if (unit.backend == "cpu") {
    parts.push_back(
        {.phase = UnitPhase::kLeave,
         .sleep = Nanos(0),
         .samples = kLeaves,
         .portion = kLeaves / 10,
         .expected = expected(kLeaves, kSample),
         .measure = [cores = unit.cores](int samples) { return measure_leave(cores, samples); }});
  }
  add_rereads(cores_or_usable(unit.cores), parts);
  return parts;
}

}  // namespace pirt::cli
