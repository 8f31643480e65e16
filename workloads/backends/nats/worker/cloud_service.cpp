#include "workloads/backends/nats/worker/cloud_service.h"

#include <fmt/core.h>

#include <chrono>
#include <thread>
#include <utility>

#include "workloads/backends/nats/worker/device_computer.h"
#include "workloads/backends/nats/worker/process_computer.h"
#include "workloads/base/error.h"

namespace pirt::cloud {
namespace {

constexpr Nanos kLook = std::chrono::milliseconds(100);
constexpr Nanos kPatience = std::chrono::seconds(5);

std::string counted(const WorkerCounts& counts) {
  return fmt::format(
      "{} delivered, {} computed, {} replied, {} again, {} failed, {} refused, {} expired, {} "
      "withdrawn, {} malformed",
      counts.tasks.delivered, counts.tasks.run, counts.tasks.replied, counts.tasks.same_again,
      counts.failed, counts.refused, counts.expired, counts.withdrawn, counts.malformed);
}

}  // namespace

void serve(const WorkerOptions& options, std::span<const Workload* const> workloads,
           const ServiceEvents& events) {
  WorkerLink worker(options, workloads);
  Connection& connection = worker.connection();
  bool was_up = false, checked = false;
  std::string said;
  while (!events.stop()) {
    const bool up = connection.is_up();
    if (up != was_up) {
      events.say((up ? "connected to " : "lost ") + public_url(options.connection.server));
      was_up = up;
    }
    if (up && !checked) {
      checked = true;
      if (const std::string missing = what_is_missing(connection, ""); !missing.empty()) {
        for (const std::string& line : set_up(connection, {})) events.say(line);
      }
      events.say(fmt::format("worker {} with {} slot{}", options.name, options.limits.slots,
                             options.limits.slots == 1 ? "" : "s"));
    }
    if (const std::string problem = worker.problem(); problem != said) {
      said = problem;
      if (!problem.empty()) events.say(problem);
    }
    std::this_thread::sleep_for(kLook);
  }
  events.say(counted(worker.counts()));
}

std::unique_ptr<Computer> computer_on(const Backend& backend, const UnitRequest& request,
                                      std::uint64_t kept_bytes) {
  return make_device_computer(backend, request, kept_bytes);
}

std::unique_ptr<Computer> computer_in(std::string program, std::vector<std::string> arguments) {
  return make_process_computer(std::move(program), std::move(arguments));
}

bool serve_slot(Computer& computer, std::span<const Workload* const> workloads,
                std::uint64_t kept_bytes) {
  return serve_computer(computer, workloads, kept_bytes);
}

std::vector<std::string> administer(const ConnectionOptions& options, const Setup& setup) {
  Connection connection(options, {});
  if (!connection.wait_until_up(kPatience)) {
    throw_environment("no connection to server " + public_url(options.server) +
                      "; start one (nats-server -js), or name another (--server)");
  }
  return set_up(connection, setup);
}

std::string permissions_of(std::span<const std::string> robots) { return permissions(robots); }

}  // namespace pirt::cloud
