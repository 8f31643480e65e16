// A GPU that runs out of memory or loses its context, as the layer gpu_stand_in makes PoCL's device
// one.
#include "characterize/worker/job_runner.h"
#include "tests/cli/program.h"

namespace pirt::test {
namespace {

using testing::AllOf;
using testing::AnyOf;
using testing::Contains;
using testing::HasSubstr;
using testing::Not;

class StandInGpu : public testing::Test {
 protected:
  StandInGpu() {
    scratch_.write("board.yaml", R"(
platform: board
units:
  cpu: {backend: cpu, cores: all, slots: 1, active_w: 1}
  gpu: {backend: opencl, device: own_memory, slots: 1}
workloads:
  sobel: {cpu: [{on: cpu, ms: 100}], gpu: [{on: gpu, ms: 2}]}
  gaussian_blur: {cpu: [{on: cpu, ms: 100}], gpu: [{on: gpu, ms: 2}]}
)");
    scratch_.write("mix.yaml", R"(
mix: m
pipelines:
  p: {rate_hz: 20, tasks: [{workload: gaussian_blur, name: a}, {workload: sobel, name: b, after: [a]}]}
)");
  }
  static Outcome with_gpu(const std::vector<std::string>& arguments, const std::string& how = "") {
    return pirt(arguments,
                "OPENCL_LAYERS=" + quoted(kGpuStandIn) + " PIRT_STAND_IN_GPU=" + quoted(how));
  }
  [[nodiscard]] Outcome live(const std::string& how, const std::string& duration = "2s") const {
    return with_gpu(
        {"schedule", "--live", "--mode", "ect", "--platform", scratch_.file("board.yaml"), "--mix",
         scratch_.file("mix.yaml"), "--duration", duration, "--json", scratch_.file("run.json")},
        how);
  }
  [[nodiscard]] nlohmann::json record() const {
    return nlohmann::json::parse(slurp(scratch_.file("run.json")));
  }
  [[nodiscard]] std::int64_t completed_on(const std::string& name) const {
    return record()["units"][name]["completed"];
  }
  const Scratch scratch_;
};

TEST_F(StandInGpu, IsAGpuToPirt) {
  const auto backends = with_gpu({"list", "backends"});
  EXPECT_THAT(backends.out, HasSubstr("Stand-in GPU")) << backends.err;
}

// As PoCL does where it finds no /sys.
TEST_F(StandInGpu, ADriverThatEndsWhoeverAsksIsNotThere) {
  const auto listed = with_gpu({"list", "backends"}, "dies=1");
  EXPECT_EQ(listed.exit_code, 0);
  EXPECT_THAT(listed.out, AllOf(HasSubstr("crashed (SIGABRT)"), HasSubstr("cpu")));
  EXPECT_EQ(
      with_gpu({"list", "units", "--platform", scratch_.file("board.yaml")}, "dies=1").exit_code,
      0);
  const auto doctor = with_gpu({"doctor", "--platform", "host-cpu", "--seconds", "0.1"}, "dies=1");
  EXPECT_THAT(doctor.exit_code, testing::AnyOf(0, 1)) << doctor.err;
}

TEST_F(StandInGpu, ALostContextIsOpenedAgainAndNoTaskIsLost) {
  const auto outcome = live("lose=8");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_THAT(outcome.err,
              AllOf(HasSubstr("CL_OUT_OF_RESOURCES"), HasSubstr("its device is lost"),
                    HasSubstr("gpu has lost its device"), HasSubstr("gpu has its device again")));
  EXPECT_THAT(outcome.err,
              Not(AnyOf(HasSubstr("out of service"), HasSubstr("beyond its buffers"))));
  const auto run = record();
  EXPECT_EQ(run["submitted"], 80);
  EXPECT_EQ(run["failed"].get<int>() + run["dropped"].get<int>(), 0);
  EXPECT_GT(completed_on("gpu"), 8) << "it serves again";
}

TEST_F(StandInGpu, OneThatStaysLostLeavesItsTasksToOthers) {
  const auto outcome = live("lose=8,reopens=no");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_THAT(outcome.err, HasSubstr("gpu has lost its device"));
  EXPECT_THAT(outcome.err, Not(HasSubstr("has its device again")));
  const auto run = record();
  EXPECT_EQ(run["failed"].get<int>() + run["dropped"].get<int>(), 0);
  EXPECT_LE(completed_on("gpu"), 8);
  EXPECT_GT(completed_on("cpu"), 0);
}

TEST_F(StandInGpu, ComputesWithoutPinnedMemory) {
  const auto outcome = live("pinned=no", "200ms");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_EQ(record()["failed"], 0);
  EXPECT_GT(completed_on("gpu"), 0);
}

TEST_F(StandInGpu, OutputsAreNotedAsPinnedWhereTheyAre) {
  const JobRunner runner(kProgram, std::chrono::minutes(1), nullptr);
  Job job;
  job.kind = JobKind::kSetup;
  job.backend = "opencl";
  job.unit.unit = "gpu";
  job.unit.device = "own_memory";
  job.workload = "sobel";
  const auto notes = [&](const std::string& how) {
    const auto result =
        runner.run(job, {{"OPENCL_LAYERS", kGpuStandIn}, {"PIRT_STAND_IN_GPU", how}});
    EXPECT_EQ(result->error, "");
    return result->notes;
  };
  EXPECT_THAT(notes(""), Contains("pinned_outputs"));
  EXPECT_THAT(notes("pinned=no"), Not(Contains("pinned_outputs")));
}

TEST_F(StandInGpu, WhatDoesNotFitIntoItsMemoryIsSaidBeforeAnythingRuns) {
  for (const char* how : {"memory_mb=1", "taken_mb=1023"}) {  // Seen before, and late.
    const auto outcome = live(how);
    EXPECT_EQ(outcome.exit_code, 4) << outcome.err;
    EXPECT_THAT(outcome.err,
                AllOf(HasSubstr("pirt: unit gpu: opencl: "), HasSubstr("sobel"),
                      HasSubstr("CL_MEM_OBJECT_ALLOCATION_FAILURE; free device memory")));
  }
}

}  // namespace
}  // namespace pirt::test
