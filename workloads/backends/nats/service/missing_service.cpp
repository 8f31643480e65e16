// In place of the sources in a build without the backend: commands ask for that, and call none.
#include "workloads/backends/nats/service/worker_link.h"

namespace pirt::cloud {

Admission::Admission(std::span<const Workload* const>, std::uint64_t) : call_bytes_(0) {}
bool serve_computer(Computer&, const Admission&) { return false; }
std::unique_ptr<Computer> make_device_computer(const Backend&, const UnitRequest&, std::uint64_t) {
  return nullptr;
}
std::unique_ptr<Computer> make_process_computer(SlotProgram) { return nullptr; }
void serve(const WorkerOptions&, std::span<const Workload* const>, const std::function<bool()>&,
           const std::function<void(const std::string&)>&) {}
std::vector<std::string> administer(const ConnectionOptions&, const Setup&) { return {}; }
std::string permissions(std::span<const std::string>) { return ""; }

}  // namespace pirt::cloud
