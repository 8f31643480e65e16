// Each candidate of each kernel parameter against the definition of the workloads that it concerns.
#include <gmock/gmock.h>

#include <algorithm>
#include <array>
#include <set>

#include "opencl_files.h"
#include "tests/workloads/backends/opencl/opencl_support.h"
#include "tests/workloads/backends/opencl/tuning_support.h"
#include "workloads/backends/opencl/kernels/product.h"
#include "workloads/backends/opencl/opencl_device.h"
#include "workloads/backends/opencl/tuning/tuning.h"
#include "workloads/base/embedded.h"
#include "workloads/catalog/catalog.h"
#include "workloads/dnn/dnn.h"
#include "workloads/vision/vision.h"

namespace pirt::opencl {
namespace {

using testing::Contains;
using testing::HasSubstr;
using testing::Not;

// -------------------------------------------------------------------------------------- the table

TEST(OpenClParameters, HaveDefaultsAmongTheirCandidates) {
  std::set<std::string_view> names;
  for (const ParameterInfo& info : parameter_table()) {
    EXPECT_TRUE(names.insert(info.name).second) << info.name << " is there twice";
    EXPECT_EQ(find_parameter(info.name), &info);
    EXPECT_EQ(&info_of(info.parameter), &info);
    EXPECT_EQ(info.definition.empty(), info.sources.empty()) << info.name;
    for (const bool is_cpu : {true, false}) {
      const ParameterRange& range = info.range(is_cpu);
      EXPECT_THAT(range.candidates, Contains(range.standard)) << info.name;
      EXPECT_GE(range.candidates.size(), 1U) << info.name;
      EXPECT_TRUE(std::ranges::is_sorted(range.candidates)) << info.name;
      EXPECT_EQ(Tuning(is_cpu)[info.parameter], range.standard) << info.name;
    }
    EXPECT_GE(std::max(info.cpu.candidates.size(), info.gpu.candidates.size()), 2U) << info.name;
  }
}

TEST(OpenClParameters, AreDefinitionsOfExactlyTheSourcesThatUseThem) {
  for (const auto& [source, text] : opencl_files::files()) {
    const std::string options = definitions_of(Tuning(true), source);
    for (const ParameterInfo& info : parameter_table()) {
      if (info.definition.empty()) continue;
      const bool used = text.find(info.definition) != std::string_view::npos;
      EXPECT_EQ(options.find("-D" + std::string(info.definition) + "=") != std::string::npos, used)
          << info.definition << " in " << source;
    }
  }
}

TEST(OpenClTuning, SaysWhatDiffersFromTheDefaults) {
  Tuning tuning(true);
  EXPECT_EQ(tuning.describe(), "default");
  tuning.set(Parameter::kFcRows, 2);
  tuning.set(Parameter::kLocalX, 16);
  EXPECT_EQ(tuning.describe(), "local_x=16, fc_rows=2");
  EXPECT_FALSE(tuning.is_default(Parameter::kFcRows));
  EXPECT_THAT(definitions_of(tuning, "dnn.cl"), HasSubstr(" -DFC_ROWS=2"));
  EXPECT_THAT(definitions_of(tuning, "sobel.cl"), Not(HasSubstr("FC_ROWS")));
  tuning.set(Parameter::kFcRows, Tuning(true)[Parameter::kFcRows]);
  tuning.set(Parameter::kLocalX, Tuning(true)[Parameter::kLocalX]);
  EXPECT_EQ(tuning, Tuning(true));
}

// --------------------------------------------------------------------------------- each candidate

/// Sizes below, at and beside all candidates, and the layers' corner cases.
std::vector<Workload> hard_workloads() {
  constexpr std::array<std::pair<int, int>, 6> kSizes = {
      {{1, 1}, {7, 5}, {17, 4}, {19, 33}, {129, 31}, {641, 479}}};
  std::vector<Workload> all;
  for (const auto& [width, height] : kSizes) {
    for (const auto make :
         {vision::make_gaussian_blur, vision::make_convolution, vision::make_sobel,
          vision::make_undistort, vision::make_feature_detect, vision::make_optical_flow,
          vision::make_track_features, vision::make_background_model}) {
      all.push_back(make(width, height));
    }
  }
  for (const dnn::ConvShape& shape :
       {dnn::ConvShape{.in_c = 3, .in_h = 7, .in_w = 5, .out_c = 5, .k_h = 3, .k_w = 3},
        dnn::ConvShape{.in_c = 5,
        .in_h = 13,
        .in_w = 11,
        .out_c = 17,
        .k_h = 5,
        .k_w = 3,
        .stride = 2,
        .pad = 2},
        dnn::ConvShape{.in_c = 1, .in_h = 2, .in_w = 3, .out_c = 33, .k_h = 2, .k_w = 1}}) {
    all.push_back(dnn::make_conv2d_relu("conv", shape));
  }
  all.push_back(dnn::make_max_pool("pool", 3, 7, 5, 3, 2));
  for (const auto& [in, out] : {std::pair{1, 1}, {9, 5}, {130, 67}, {1001, 9}}) {
    all.push_back(dnn::make_fully_connected("fc", in, out, dnn::Activation::kSoftmax));
  }
  return all;
}

std::string parameter_name(const testing::TestParamInfo<ParameterInfo>& info) {
  return std::string(info.param.name);
}

class OpenClCandidates : public testing::TestWithParam<ParameterInfo> {};

using test::gpu_session;

TEST(OpenClTiles, ComputeWhatTheReferenceComputes) {
  const auto first = test::open_first_device();
  if (!first) GTEST_SKIP() << "skipped: no OpenCL device";
  std::vector<Workload> workloads = hard_workloads();
  workloads.push_back(dnn::make_conv2d_relu("conv", {16, 9, 10, 70, 3, 3, 1, 1}));
  workloads.push_back(dnn::make_fully_connected("fc", 1023, 130, dnn::Activation::kDropout));
  for (const int local_x : {32, 64}) {
    const DeviceSession session = gpu_session(local_x);
    for (const Workload& workload : workloads) {
      const Verdict verdict = test::run_and_verify(session, workload);
      EXPECT_TRUE(verdict.ok) << local_x << " items, " << workload.description << ": "
                              << verdict.detail;
    }
  }
}

TEST(OpenClTiles, ComputeBatchesAndTheChain) {
  const auto first = test::open_first_device();
  if (!first) GTEST_SKIP() << "skipped: no OpenCL device";
  const DeviceSession session = gpu_session(64);
  const auto conv = dnn::make_conv2d_relu("conv", {5, 9, 10, 40, 3, 3, 2, 1});
  for (const Workload& workload : {dnn::batched(conv, 3), find_workload("alexnet")}) {
    const Verdict verdict = test::run_and_verify(session, workload);
    EXPECT_TRUE(verdict.ok) << workload.description << ": " << verdict.detail;
  }
}

// Each tile, with terms that are no multiple of it, in one piece and in several; columns that end
// within a tile, and few of them.
TEST(OpenClProduct, ComputesWithEachTileInOnePieceAndInSeveral) {
  const auto first = test::open_first_device();
  if (!first) GTEST_SKIP() << "skipped: no OpenCL device";
  std::vector<Workload> workloads;
  for (const int channels : {9, 40, 96, 130}) {
    const auto conv = dnn::make_conv2d_relu("conv", {11, 9, 10, channels, 3, 3, 1, 1});
    workloads.push_back(conv);
    workloads.push_back(dnn::batched(conv, 2));
  }
  const auto layer = dnn::make_fully_connected("fc", 203, 130, dnn::Activation::kSoftmax);
  for (const int images : {2, 17, 40}) workloads.push_back(dnn::batched(layer, images));
  for (const int groups : {1, 2, 8}) {
    DeviceSession session = gpu_session(64);
    session.tuning.set(Parameter::kProductGroups, groups);
    for (const Workload& workload : workloads) {
      const Verdict verdict = test::run_and_verify(session, workload);
      EXPECT_TRUE(verdict.ok) << groups << ", " << workload.description << ": " << verdict.detail;
    }
  }
}

TEST(OpenClProduct, TilesAreThoseOfLeastWasteAndPiecesFillTheDevice) {
  EXPECT_EQ(opencl::tile_for(384, 169).channels, 128);
  EXPECT_EQ(opencl::tile_for(96, 3025).channels, 96);
  EXPECT_EQ(opencl::tile_for(40, 169).channels, 64);
  EXPECT_EQ(opencl::tile_for(9, 169).channels, 32);
  EXPECT_EQ(opencl::tile_for(4096, 16).columns, 16);
  for (const int terms : {1, 9, 363, 3456}) {
    for (const int groups : {1, 6, 396}) {
      const opencl::ProductTile& tile = opencl::tile_for(384, 169);
      const int piece = opencl::terms_of_a_piece(tile, 384, 169, terms, groups);
      EXPECT_EQ(piece % tile.terms, 0) << terms << " terms, " << groups << " groups";
      // 9 tiles of 128 x 64.
      EXPECT_LE(9 * ((terms + piece - 1) / piece), std::max(9, groups));
    }
  }
  const opencl::ProductTile& tile = opencl::tile_for(384, 169);
  EXPECT_EQ(opencl::terms_of_a_piece(tile, 384, 169, 3456, 396), 80) << "44 pieces";
}

// Rows of a tile and of what is computed at once need not fit each other.
TEST(OpenClTiles, ComputeWithEachOfTheirParameters) {
  const auto first = test::open_first_device();
  if (!first) GTEST_SKIP() << "skipped: no OpenCL device";
  for (const Parameter parameter :
       {Parameter::kBlurStripRows, Parameter::kFilterRows, Parameter::kFilterStripRows,
        Parameter::kSobelStripRows, Parameter::kFcRows}) {
    const ParameterInfo& info = info_of(parameter);
    for (const int candidate : info.gpu.candidates) {
      DeviceSession session = gpu_session(64);
      session.tuning.set(parameter, candidate);
      for (const Workload& workload : hard_workloads()) {
        if (!info.concerns(workload.kernel) || workload.kernel == "feature_detect") continue;
        const Verdict verdict = test::run_and_verify(session, workload);
        EXPECT_TRUE(verdict.ok) << info.name << "=" << candidate << ", " << workload.description
                                << ": " << verdict.detail;
      }
    }
  }
}

// Also those of the other kind of device: a kernel must be right with any of them. Not so local
// sizes, for each of which a driver may build all kernels anew.
TEST_P(OpenClCandidates, ComputeWhatTheReferenceComputes) {
  const auto first = test::open_first_device();
  if (!first) GTEST_SKIP() << "skipped: no OpenCL device";
  const ParameterInfo& info = GetParam();
  std::set<int> candidates;
  for (const bool is_cpu : {true, false}) {
    if (info.parameter == Parameter::kLocalX && is_cpu != first->info().is_cpu) continue;
    const auto range = info.range(is_cpu).candidates;
    candidates.insert(range.begin(), range.end());
  }
  const auto workloads = hard_workloads();
  for (const int candidate : candidates) {
    DeviceSession session = open_session(test::unit_request());
    session.tuning.set(info.parameter, candidate);
    if (info.parameter == Parameter::kLocalX) {
      session.local_x = std::min(static_cast<std::size_t>(candidate),
                                 session.device.getInfo<CL_DEVICE_MAX_WORK_GROUP_SIZE>());
    }
    for (const Workload& workload : workloads) {
      if (!info.concerns(workload.kernel)) continue;
      const Verdict verdict = test::run_and_verify(session, workload);
      EXPECT_TRUE(verdict.ok) << info.name << "=" << candidate << ", " << workload.description
                              << ": " << verdict.detail;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Parameters, OpenClCandidates, testing::ValuesIn(parameter_table()),
                         parameter_name);

// -------------------------------------------------------------------------------------------
// opening

TEST(OpenClTuning, IsTakenFromTheFileForExactlyThisDevice) {
  const auto device = test::open_first_device();
  if (!device) GTEST_SKIP() << "skipped: no OpenCL device";
  const DeviceInfo info = device->info();
  EXPECT_EQ(info.tuning, "default");
  TunedDevice entry = test::entry_for(info);
  entry.tuning.set(Parameter::kFcRows, 2);
  entry.tuning.set(Parameter::kSobelStripRows, entry.tuning[Parameter::kSobelStripRows] / 2);
  const std::string tuned = entry.tuning.describe();
  {
    const test::TuningInUse file({entry});
    const auto opened = test::open_first_device();
    EXPECT_EQ(opened->info().tuning, tuned);
    const Verdict verdict = test::run_and_verify(
        *opened, dnn::make_fully_connected("fc", 130, 67, dnn::Activation::kDropout));
    EXPECT_TRUE(verdict.ok) << verdict.detail;
  }
  for (const auto change : {&TunedDevice::device, &TunedDevice::platform, &TunedDevice::version}) {
    TunedDevice other = entry;
    other.*change += " 2";
    const test::TuningInUse file({other});
    EXPECT_EQ(test::open_first_device()->info().tuning, "default");
  }
  EXPECT_EQ(test::open_first_device()->info().tuning, "default") << "PIRT_TUNING=none";
}

TEST(OpenClTuning, OfTheFileReachesTheKernels) {
  const auto device = test::open_first_device();
  if (!device) GTEST_SKIP() << "skipped: no OpenCL device";
  TunedDevice entry = test::entry_for(device->info());
  entry.tuning.set(Parameter::kFcRows, 1);
  entry.tuning.set(Parameter::kLocalX, entry.tuning[Parameter::kLocalX] / 2);
  const test::TuningInUse file({entry});
  const DeviceSession session = open_session(test::unit_request());
  EXPECT_EQ(session.tuning, entry.tuning);
  EXPECT_EQ(session.local_x, static_cast<std::size_t>(entry.tuning[Parameter::kLocalX]));
  EXPECT_NO_THROW(
      static_cast<void>(build_program(session, "dnn.cl",
                                      "#if FC_ROWS != 1\n#error wrong\n#endif\n__kernel void "
                                      "k(__global int* p) { p[0] = 1; }")));
}

}  // namespace
}  // namespace pirt::opencl
