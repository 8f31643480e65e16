// What `pirt report setup` says of scalar code on the DSP, counted again.
#include <gtest/gtest.h>

#include "reports/paper/offloaded_call.h"
#include "tests/workloads/backends/dsp/dsp_support.h"
#include "tests/workloads/catalog/workload_support.h"
#include "workloads/backends/dsp/kernels.h"
#include "workloads/catalog/catalog.h"

namespace pirt {
namespace {

TEST(DspScalarTwin, TakesThePacketsThatReportsSay) {
  if (const auto why = test::why_no_dsp(); !why.empty()) GTEST_SKIP() << why;
  const Workload& workload = find_workload("convolution");
  const Data data = test::data_of_seed_1(workload);
  auto options = test::dsp_session_options();
  options.program.replace_filename("pirt_dsp_scalar.elf");
  dsp::ProgramSession session(options);
  const auto call = dsp::find_kernel(workload.kernel)->make(session, workload, data.parameters);
  dsp::copy_in(session, call.inputs[0], data.inputs[0].bytes());
  const auto packets = static_cast<double>(dsp::run(session, call).packets);
  EXPECT_NEAR(packets / kScalarConvolutionPackets, 1, 0.01);  // another compiler's patch level
}

}  // namespace
}  // namespace pirt
