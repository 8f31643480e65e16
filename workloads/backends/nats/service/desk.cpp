#include "workloads/backends/nats/service/desk.h"

#include <fmt/core.h>

#include <algorithm>
#include <string_view>
#include <tuple>
#include <utility>

namespace pirt::cloud {

/// One that was not there, or idle, has used as much as the least of the others: nobody saves up.
Desk::Robot& Desk::robot_of(const std::string& name, Nanos now) {
  if (!robots_.contains(name) && robots_.size() >= limits_.most_robots) {
    const auto idle = std::ranges::min_element(robots_, {}, [](const auto& each) {
      return std::tuple(each.second.slots, each.second.heard);
    });
    if (idle->second.slots == 0) robots_.erase(idle);
  }
  const auto [at, is_new] = robots_.try_emplace(name);
  Robot& robot = at->second;
  if (is_new || (robot.slots == 0 && robot.heard + limits_.active < now)) {
    Nanos least = Nanos::max();
    for (const auto& [other, each] : robots_) {
      if (other != name && each.heard + limits_.active >= now) least = std::min(least, each.used);
    }
    if (least != Nanos::max()) robot.used = std::max(robot.used, least);
  }
  robot.heard = now;
  return robot;
}

void Desk::hear(const std::string& name, std::uint64_t run, std::uint32_t waiting, Nanos now) {
  Robot& robot = robot_of(name, now);
  if (!robot.runs.contains(run) && robot.runs.size() >= limits_.most_runs) {
    robot.runs.erase(std::ranges::min_element(robot.runs, {},
                                              [](const auto& each) { return each.second.heard; }));
  }
  Run& state = robot.runs[run];
  state.waiting = waiting;
  state.heard = now;
}

/// Nothing waits: so a run answers a claim that it has no task for.
void Desk::offered(const std::string& name, std::uint64_t run, std::uint32_t waiting, Nanos now) {
  hear(name, run, waiting, now);
  if (const auto asked = find_claim(name, run); waiting == 0 && asked != asked_.end()) {
    answered(asked, now);
  }
}

std::optional<Desk::Claim> Desk::claim(Nanos now) {
  forget(now);
  if (computing_ + std::ssize(asked_) >= limits_.slots) return std::nullopt;
  const auto active = std::max<std::ptrdiff_t>(
      1, std::ranges::count_if(
             robots_, [&](const auto& each) { return each.second.heard + limits_.active >= now; }));
  const auto share = (limits_.slots + active - 1) / active;
  std::pair<const std::string, Robot>* robot = nullptr;
  std::pair<const std::uint64_t, Run>* run = nullptr;
  // Of a robot's runs, the one that was asked longest ago.
  const auto order = [](const auto& of, const auto& its) {
    return std::tuple(of.second.slots, of.second.used, std::string_view(of.first),
                      its.second.asked);
  };
  for (auto& of : robots_) {
    if (of.second.slots >= share) continue;
    for (auto& its : of.second.runs) {
      if (its.second.waiting == 0 || its.second.heard + limits_.offer < now) continue;
      if (run == nullptr || order(of, its) < order(*robot, *run)) robot = &of, run = &its;
    }
  }
  if (run == nullptr) return std::nullopt;
  --run->second.waiting;
  run->second.asked = now;
  ++robot->second.slots;
  asked_.push_back({{robot->first, run->first}, now});
  return asked_.back().claim;
}

std::vector<Desk::Asked>::iterator Desk::find_claim(const std::string& robot, std::uint64_t run) {
  return std::ranges::find_if(asked_, [&](const Asked& each) {
    return each.claim.robot == robot && each.claim.run == run;
  });
}

/// The slot was its robot's since it was asked: who has many tasks that take no time has no more
/// of it than others.
void Desk::answered(std::vector<Asked>::iterator asked, Nanos now) {
  Robot& robot = robots_.at(asked->claim.robot);
  --robot.slots;
  robot.used += now - asked->since;
  asked_.erase(asked);
}

bool Desk::expects(const std::string& robot) const {
  const auto at = robots_.find(robot);
  return std::ranges::any_of(asked_,
                             [&](const Asked& each) { return each.claim.robot == robot; }) ||
         (at != robots_.end() &&
          std::ranges::any_of(at->second.runs, [](const auto& each) { return each.second.late; }));
}

bool Desk::take(const std::string& name, std::uint64_t run, std::uint32_t waiting, Nanos now) {
  if (const auto asked = find_claim(name, run); asked != asked_.end()) {
    answered(asked, now);
  } else {
    Robot& robot = robot_of(name, now);
    const auto at = robot.runs.find(run);
    const bool is_free = computing_ + std::ssize(asked_) < limits_.slots;
    if (at == robot.runs.end() || !is_free || !std::exchange(at->second.late, false)) return false;
  }
  hear(name, run, waiting, now);
  ++robots_.at(name).slots;
  ++computing_;
  return true;
}

void Desk::finished(const std::string& name, Nanos used, bool failed, Nanos now) {
  --computing_;
  Robot& robot = robots_.at(name);
  --robot.slots;
  robot.used += failed ? limits_.failure_costs * used : used;
  if (failed) robot.failures.push_back(now);
}

std::string Desk::why_refused(const std::string& name, Nanos now) {
  auto& failures = robot_of(name, now).failures;
  while (!failures.empty() && failures.front() + limits_.failure_window <= now) {
    failures.pop_front();
  }
  if (failures.size() < limits_.most_failures) return "";
  return fmt::format(
      "robot {}: {} of its calls ended a process of this worker within {:.0f} s; it is refused "
      "until they are older",
      name, failures.size(), to_s(limits_.failure_window));
}

void Desk::forget(Nanos now) {
  for (; next_wake() <= now; answered(asked_.begin(), now)) {
    const Claim& claim = asked_.front().claim;
    auto& runs = robots_.at(claim.robot).runs;
    if (const auto run = runs.find(claim.run); run != runs.end()) {
      run->second.waiting = 0;
      run->second.late = true;
    }
  }
}

Nanos Desk::next_wake() const {
  return asked_.empty() ? Nanos::max() : asked_.front().since + limits_.claim;
}

}  // namespace pirt::cloud
