// What the tests of the DSP backend share.
#pragma once

#include <memory>
#include <string>

#include "workloads/backends/dsp/dsp_backend.h"
#include "workloads/backends/dsp/session.h"
#include "workloads/backends/dsp/tools.h"
#include "workloads/model/backend.h"

namespace pirt::test {

/// Why there is no DSP here, for GTEST_SKIP; empty if there is one.
inline std::string why_no_dsp() {
  static const Probe probe = make_dsp_backend()->probe();
  return probe.available ? "" : "skipped: " + probe.reason;
}

inline std::unique_ptr<Device> open_dsp() {
  UnitRequest request;
  request.unit = "dsp";
  return make_dsp_backend()->open(request);
}

inline dsp::SessionOptions dsp_session_options() {
  const dsp::Tools tools = dsp::find_tools();
  return {.emulator = tools.emulator, .plugin = tools.plugin, .program = tools.program};
}

}  // namespace pirt::test
