// All backends; a new one adds its header here and its line in backends.inc.
#include "workloads/backends/registry.h"

#include <algorithm>
#include <string>
#include <vector>

#include "workloads/backends/cpu/cpu_backend.h"
#include "workloads/backends/dsp/dsp_backend.h"
#include "workloads/backends/fake/fake_backend.h"
#include "workloads/backends/fpga/fpga_backend.h"
#include "workloads/backends/nats/nats_backend.h"
#include "workloads/backends/opencl/opencl_backend.h"
#include "workloads/base/error.h"
#include "workloads/base/text/text.h"

namespace pirt {
namespace {

std::vector<std::unique_ptr<const Backend>> make_backends() {
  std::vector<std::unique_ptr<const Backend>> all;
#define PIRT_BACKEND(name) all.push_back(make_##name##_backend());
#include "workloads/backends/backends.inc"
#undef PIRT_BACKEND
  return all;
}

}  // namespace

std::span<const std::unique_ptr<const Backend>> backends() {
  static const auto all = make_backends();
  return all;
}

const Backend& find_backend(std::string_view name) {
  std::vector<std::string> names;
  for (const auto& backend : backends()) {
    if (backend->name() == name) return *backend;
    names.emplace_back(backend->name());
  }
  throw_bad_input("there is no backend '" + std::string(name) + "'" + suggestion(name, names) +
                  "; `pirt list backends` shows all");
}

}  // namespace pirt
