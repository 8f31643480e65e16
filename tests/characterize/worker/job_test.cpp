#include "characterize/worker/job.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sstream>

#include "characterize/platform/platform.h"
#include "characterize/worker/job_runner.h"
#include "characterize/worker/neighbour.h"
#include "characterize/worker/worker.h"
#include "tests/characterize/support.h"
#include "tests/support/paths.h"
#include "workloads/base/system/affinity.h"
#include "workloads/base/text/json.h"

namespace pirt {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

TEST(Job, RoundTrips) {
  Job job;
  job.kind = JobKind::kSample;
  job.backend = "opencl";
  job.unit = {"gpu", {2, 3}, "Mali", "device: \"quoted\"\n# and lines\n"};
  job.workload = "sobel";
  job.seed = 18'446'744'073'709'551'615U;
  job.images = "/pictures of mine";
  job.reference = "/tmp/x.reference";
  job.sampling = {Nanos(1), Nanos(2), Nanos(3), 4, 5};
  job.neighbours = {{0, 1}, {4}};
  const Job read = job_from_json(to_json(job));
  EXPECT_EQ(read.kind, JobKind::kSample);
  EXPECT_EQ(read.backend, job.backend);
  EXPECT_EQ(read.unit.unit, "gpu");
  EXPECT_THAT(read.unit.cores, ElementsAre(2, 3));
  EXPECT_EQ(read.unit.device, "Mali");
  EXPECT_EQ(read.unit.script, job.unit.script);
  EXPECT_EQ(read.workload, job.workload);
  EXPECT_EQ(read.seed, job.seed);
  EXPECT_EQ(read.images, job.images);
  EXPECT_EQ(read.reference, job.reference);
  EXPECT_EQ(read.neighbours, job.neighbours);
  EXPECT_EQ(to_json(read), to_json(job));
}

TEST(Job, RefusesWhatIsNone) {
  for (const char* text : {"", "hello", "{}", "[1]", R"({"protocol": 1})", R"({"protocol": 2})"}) {
    EXPECT_THAT(test::error_of(ErrorCode::kBadInput, [&] { return job_from_json(text); }),
                ::testing::AnyOf(HasSubstr("started by characterize"), HasSubstr("protocol")))
        << text;
  }
}

JobResult a_result() {
  JobResult result;
  result.done = true;
  result.step = "sampling";
  result.device = DeviceInfo{"name", "platform", "1.2", 4, true};
  result.provenance = Provenance::kModelled;
  result.clock = {28.5, Nanos(20)};
  result.device_init = Nanos(7);
  result.verification = "after timing: equal";
  result.during_setup = {.contended = true, .crowded = false, .throttled = true};
  result.during_calls = {.contended = true, .crowded = true, .throttled = false, .others = 1.5};
  result.notes = {"input_resized"};
  result.ops = 12;
  result.bytes = 34;
  result.phases = {{Phase::kCall, test::ramp(5, 3), 10}};
  result.conditions = {{Condition::kBesideMemory, {Phase::kExecute, test::ramp(8, 2), 1}}};
  return result;
}

TEST(Job, ReadsBackTheRecordOfAResult) {
  const JobResult read = last_record(to_record(a_result()) + "\n");
  EXPECT_EQ(to_record(read), to_record(a_result()));
  EXPECT_EQ(read.prepare, std::nullopt);
  EXPECT_EQ(read.ops, 12);
  EXPECT_EQ(last_record(to_record({})).ops, std::nullopt);
  ASSERT_EQ(read.phases.size(), 1U);
  EXPECT_EQ(read.phases[0].samples, test::ramp(5, 3));
  EXPECT_EQ(read.phases[0].batch, 10);
  ASSERT_EQ(read.conditions.size(), 1U);
  EXPECT_EQ(read.conditions[0].condition, Condition::kBesideMemory);
  EXPECT_EQ(read.conditions[0].samples.samples, test::ramp(8, 2));
  EXPECT_EQ(read.during_setup, a_result().during_setup);
  EXPECT_EQ(read.during_calls, a_result().during_calls);
}

TEST(Job, TakesTheLastCompleteRecordAmongChatter) {
  JobResult first;
  first.step = "opening the device";
  const std::string a = to_record(first) + "\n";
  const std::string b = to_record(a_result()) + "\n";
  EXPECT_EQ(last_record(a + b).step, "sampling");
  EXPECT_EQ(last_record("chatter\n" + a + "more chatter\n").step, "opening the device");
  EXPECT_EQ(last_record("no end of line " + a).step, "opening the device");
  // Killed in the middle of a line: the one before counts.
  EXPECT_EQ(last_record(a + b.substr(0, b.size() / 2)).step, "opening the device");
  EXPECT_EQ(last_record(a + b.substr(0, b.size() - 1)).step, "opening the device");
  EXPECT_FALSE(last_record("").done);
  EXPECT_FALSE(last_record("pirt-record {broken\n").done);
}

TEST(Job, SurvivesTextThatIsNotUtf8) {
  JobResult result;
  result.error = "driver says \xff\xfe";
  EXPECT_THAT(last_record(to_record(result) + "\n").error, HasSubstr("driver says"));
}

TEST(Worker, ReportsAJobThatIsNone) {
  std::istringstream job("nonsense");
  std::ostringstream records;
  EXPECT_EQ(run_worker(job, records), kExitBadInput);
  EXPECT_THAT(last_record(records.str()).error, HasSubstr("this is no worker's job"));
}

TEST(Worker, ReportsAnUnknownBackend) {
  Job job;
  job.backend = "abacus";
  std::istringstream in(to_json(job));
  std::ostringstream records;
  EXPECT_EQ(run_worker(in, records), kExitBadInput);
  EXPECT_THAT(last_record(records.str()).error, HasSubstr("abacus"));
}

// One core is the program's whenever it computes; a part of it may be another test's.
TEST(Worker, TakesTheTimeOfItsProgramForItsOwn) {
  const test::TemporaryFolder folder;
  test::write_bytes(folder / "busy.py", R"(import hashlib, json, sys
sys.stdin.readline()
print('{"ready": true}', flush=True)
for line in sys.stdin:
    asked = json.loads(line)
    if "call" in asked:
        hashlib.sha256(bytes(8_000_000)).digest()
    print(json.dumps({"done": asked.get("call", asked.get("null"))}), flush=True)
)");
  test::write_bytes(folder / "own.yaml", R"(workloads:
  - name: my.busy
    inputs: {in: "u8[8]"}
    outputs: {out: "u8[8]"}
    command: [python3, busy.py]
)");
  Job job;
  job.kind = JobKind::kSample;
  job.backend = "cpu";
  job.unit = {"cpu", {current_cores().front()}, "", ""};
  job.own = (folder / "own.yaml").string();
  job.workload = "my.busy";
  job.sampling.slice = std::chrono::milliseconds(300);
  const auto result = JobRunner(test::kTestWorker, std::chrono::seconds(60), nullptr).run(job);
  ASSERT_EQ(result.value().error, "");
  EXPECT_LT(result->during_calls.others.value(), 0.9);
  const auto call = std::ranges::find(result->phases, Phase::kCall, &PhaseSamples::phase);
  ASSERT_NE(call, result->phases.end());
  EXPECT_THAT(call->cpu, IsEmpty()) << "what this process computed of it says nothing";
}

// Of two busy cores it may use one, of which others cannot take more than there is.
TEST(Worker, OfAUnitWithoutCoresLooksAtThoseThatItMayUse) {
  const auto cores = usable_cores();
  if (cores.size() < 2) GTEST_SKIP() << "there is one core";
  const CoresRestored restored;
  const Neighbour busy({cores[0], cores[1]}, Neighbour::Work::kComputes);
  bind_to_cores({cores.data(), 1}, "test");
  Job job;
  job.kind = JobKind::kSample;
  job.backend = "cpu";
  job.unit.unit = "cpu";
  job.workload = "pool5";
  job.sampling.slice = std::chrono::milliseconds(300);
  const auto result = JobRunner(test::kTestWorker, std::chrono::seconds(60), nullptr).run(job);
  ASSERT_EQ(result.value().error, "");
  EXPECT_LT(result->during_calls.others.value(), 1.2);
}

TEST(Worker, ProbesAFakeUnit) {
  Job job;
  job.backend = "fake";
  job.unit.script = "device: probed";
  std::istringstream in(to_json(job));
  std::ostringstream records;
  EXPECT_EQ(run_worker(in, records), 0);
  const JobResult result = last_record(records.str());
  EXPECT_TRUE(result.done);
  EXPECT_EQ(result.device->name, "probed");
  EXPECT_EQ(result.provenance, Provenance::kModelled);
}

}  // namespace
}  // namespace pirt
