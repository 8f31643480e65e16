// In place of cloud_service.cpp in a build without the backend.
#include "workloads/backends/nats/cloud_service.h"
#include "workloads/base/error.h"

namespace pirt::cloud {
namespace {

[[noreturn]] void unavailable() {
  throw_environment("backend nats is unavailable: " PIRT_NATS_MISSING);
}

}  // namespace

void serve(const WorkerOptions&, std::span<const Workload* const>, const ServiceEvents&) {
  unavailable();
}
std::unique_ptr<Computer> computer_on(const Backend&, const UnitRequest&, std::uint64_t) {
  unavailable();
}
std::unique_ptr<Computer> computer_in(std::string, std::vector<std::string>) { unavailable(); }
bool serve_slot(Computer&, std::span<const Workload* const>, std::uint64_t) { unavailable(); }
std::vector<std::string> administer(const ConnectionOptions&, const Setup&) { unavailable(); }
std::string permissions_of(std::span<const std::string>) { unavailable(); }

}  // namespace pirt::cloud
