// One that has options adds its entry.
#include "workloads/backends/backend_list.h"

#include "workloads/backends/dsp/dsp_options.h"
#include "workloads/backends/fake/fake_options.h"
#include "workloads/backends/fpga/fpga_options.h"
#include "workloads/backends/nats/nats_backend.h"

namespace pirt {

std::vector<std::string> backend_names() {
#define PIRT_BACKEND(name) #name,
  return {
#include "workloads/backends/backends.inc"
  };
#undef PIRT_BACKEND
}

std::vector<OptionSpec> options_of(std::string_view backend) {
  if (backend == "dsp") return dsp_options();
  if (backend == "fake") return fake_options();
  if (backend == "fpga") return fpga_options();
  if (backend == "nats") return nats_options();
  return {};
}

bool leaves_calls_of(std::string_view backend) { return backend == "cpu"; }

std::vector<std::string> settings_of(std::string_view backend) {
  if (backend == "nats") return nats_settings();
  return {};
}

std::string gone_setting(std::string_view key) { return nats_gone(key); }

}  // namespace pirt
