// The list of all backends; a new one adds its line here.
#include "workloads/registry.h"

#include <algorithm>
#include <string>
#include <vector>

#include "workloads/base/error.h"
#include "workloads/base/text.h"
#include "workloads/cpu/cpu_backend.h"
#include "workloads/dsp/dsp_backend.h"
#include "workloads/fake/fake_backend.h"
#include "workloads/opencl/opencl_backend.h"

namespace pirt {
namespace {

std::vector<std::unique_ptr<const Backend>> make_backends() {
  std::vector<std::unique_ptr<const Backend>> all;
  all.push_back(make_cpu_backend());
  all.push_back(make_opencl_backend());
  all.push_back(make_dsp_backend());
  all.push_back(make_fake_backend());
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
