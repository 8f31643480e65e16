// What a runtime is made of, and what it refuses: workloads, profiles, states, units.
#include <semaphore>

#include "scheduler/runtime/runtime.h"
#include "tests/scheduler/runtime/runtime_support.h"
#include "tests/support/paths.h"
#include "tests/workloads/catalog/workload_support.h"
#include "tests/workloads/inputs/sequence_support.h"
#include "workloads/catalog/catalog.h"
#include "workloads/model/host_function.h"
#include "workloads/vision/vision.h"

namespace pirt::test {
namespace {

using namespace std::chrono_literals;
using testing::AllOf;
using testing::HasSubstr;

/// Like bundle_adjust, it has a function for a kernel; doubles a number, and keeps all it was
/// given.
Workload doubling(std::shared_ptr<std::vector<double>> given) {
  Workload workload;
  workload.name = "double";
  workload.kernel = "bundle_adjust";
  workload.inputs = workload.outputs = {kNumber};
  auto function = std::make_shared<HostFunction>();
  function->prepare = [given = std::move(given)](std::span<const Tensor>) -> KernelFunction {
    return [given](std::span<const Tensor> inputs, std::span<Tensor> outputs) {
      given->push_back(value_of(inputs));
      outputs[0].as<double>()[0] = 2 * value_of(inputs);
    };
  };
  workload.operation = std::move(function);
  workload.make_data = [](const DataRequest&) {
    Data data;
    data.inputs.push_back(number(1));
    return data;
  };
  return workload;
}

TEST(Runtime, PreparesWithInputsLikeThoseToCome) {
  const auto given = std::make_shared<std::vector<double>>();
  const auto options_for = [&](const char* name, std::vector<Tensor> inputs) {
    RuntimeOptions options = options_with({adding()}, kOneUnit);
    options.workloads.emplace_back(doubling(given));
    options.first_inputs[name] = std::make_shared<const std::vector<Tensor>>(std::move(inputs));
    return options;
  };
  const auto seven = [] {
    std::vector<Tensor> inputs;
    inputs.push_back(number(7));
    return inputs;
  };
  {
    Runtime runtime(options_for("double", seven()));
    EXPECT_EQ(*given, std::vector{7.0});
    const auto sixteen = runtime.submit("double", {number(8)});
    EXPECT_EQ(value_of(sixteen.get()), 16);
    EXPECT_EQ(*given, (std::vector{7.0, 8.0}));
  }
  EXPECT_THAT(refusal(options_for("dubble", seven())), HasSubstr("did you mean double"));
  EXPECT_THAT(refusal(options_for("double", {})), HasSubstr("1 inputs, not 0"));
  EXPECT_THAT(refusal(options_for("add", seven())), HasSubstr("of your own"));
  RuntimeOptions lazy = options_for("double", seven());
  lazy.prepare_first = false;
  given->clear();
  Runtime runtime(std::move(lazy));
  EXPECT_EQ(*given, std::vector<double>());
}

// Its one kernel is prepared until somebody asks whether to go on.
TEST(Runtime, ItsStartEndsOnceNobodyWantsIt) {
  static std::counting_semaphore<> asked(0);  // Static: its thread may outlive the test.
  Workload slow = doubling(std::make_shared<std::vector<double>>());
  auto function = std::make_shared<HostFunction>();
  function->prepare = [](std::span<const Tensor>) -> KernelFunction {
    static_cast<void>(asked.try_acquire_for(5s));
    return [](auto, auto) {};
  };
  slow.operation = std::move(function);
  RuntimeOptions options = options_with({slow}, kOneUnit);
  options.stop = [] {
    asked.release();
    return true;
  };
  try {
    const Runtime runtime(std::move(options));
    ADD_FAILURE() << "it has started";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kEnvironment);
    EXPECT_THAT(error.what(), HasSubstr("interrupted while unit cpu was being prepared"));
  }
}

TEST(Runtime, MakesNoInputsThatItDoesNotUse) {
  Workload doubles = doubling(std::make_shared<std::vector<double>>());
  doubles.frames = 1000;
  doubles.make_data = [make = doubles.make_data](const DataRequest& request) {
    if (request.frame > 0) throw_bad_input("nobody plays its sequence");
    return make(request);
  };
  const Runtime runtime(options_with({doubles}, kOneUnit));
}

/// A background model of its own size and name.
Workload background(const std::string& name, int width, int height) {
  Workload workload = vision::make_background_model(width, height);
  workload.name = name;
  return workload;
}

/// Of sobel, on both units.
Profile profile_of_sobel(bool cpu_valid, bool gpu_valid) {
  Profile profile;
  profile.path = "p.db";
  profile.runs.emplace_back().platform = "two";
  for (const bool gpu : {false, true}) {
    for (const Phase phase : {Phase::kUpload, Phase::kExecute, Phase::kDownload}) {
      PhaseRow& row = profile.phases.emplace_back();
      row.platform = "two";
      row.workload = "sobel";
      row.unit = gpu ? "gpu" : "cpu";
      row.backend = "cpu";
      row.phase = phase;
      row.median = 1ms;
      if (!(gpu ? gpu_valid : cpu_valid)) row.reasons = {"wrong_output"};
    }
  }
  return profile;
}

TEST(Runtime, WithAProfileUnitsServeWhatTheyHaveValidRowsOf) {
  const auto options_for = [](Profile profile, std::vector<Workload> made = {}) {
    RuntimeOptions options = options_with({adding()});
    options.profile = std::move(profile);
    options.workloads.emplace_back("sobel");
    std::ranges::move(made, std::back_inserter(options.workloads));
    return options;
  };
  {
    std::vector<std::string> said;
    RuntimeOptions one = options_for(profile_of_sobel(false, true));
    one.progress = [&said](const std::string& line) { said.push_back(line); };
    Runtime runtime(std::move(one));
    EXPECT_THAT(said, testing::Contains(HasSubstr("sobel on cpu is not used")));
    const Data data = data_of_seed_1(find_workload("sobel"));
    for (int i = 0; i < 10; ++i) {
      const auto edges = runtime.submit("sobel", {data.inputs[0]});
      EXPECT_EQ(edges.wait(), TaskEnd::kCompleted);
      EXPECT_EQ(edges.unit(), "gpu");
    }
    // Functions of one's own need no rows.
    const auto three = runtime.submit("add", {number(1), number(2)});
    EXPECT_EQ(value_of(three.get()), 3);
  }
  EXPECT_THAT(refusal(options_for(profile_of_sobel(false, false))),
              AllOf(HasSubstr("sobel"), HasSubstr("wrong_output")));
  auto made = std::vector{background("small", 40, 30)};
  EXPECT_THAT(refusal(options_for(profile_of_sobel(true, true), std::move(made))),
              HasSubstr("'small' is none of the catalogue's"));
}

TEST(Runtime, NeverTakesTheRowsOfAnotherSize) {
  const auto options_for = [](Profile profile) {
    RuntimeOptions options = options_with({});
    options.profile = std::move(profile);
    options.workloads = {vision::make_sobel(64, 48)};
    return options;
  };
  EXPECT_THAT(refusal(options_for(profile_of_sobel(true, true))),
              AllOf(HasSubstr("no rows of sobel in this size"),
                    HasSubstr("pirt characterize --platform two --filter '^(sobel@64x48)$' --db")));
  Profile measured = profile_of_sobel(true, true);
  for (PhaseRow& row : measured.phases) row.workload = "sobel@64x48";
  Runtime runtime(options_for(measured));
  const Data data = data_of_seed_1(vision::make_sobel(64, 48));
  EXPECT_EQ(runtime.submit("sobel", {data.inputs[0]}).wait(), TaskEnd::kCompleted);
}

TEST(Runtime, ServesWorkloadsOfFiles) {
  RuntimeOptions options = options_with({});
  options.workloads = {"sobel@64x48", "mine.sobel@32x24",
                       WorkloadFile{test::kExampleModule, {"mine.sobel@64x48"}}};
  Runtime runtime(std::move(options));
  EXPECT_NO_THROW(static_cast<void>(runtime.workload("mine.sobel@32x24")));
  EXPECT_THAT(bad_input([&] { static_cast<void>(runtime.workload("mine.sobel")); }),
              HasSubstr("mine.sobel"));
  const Data data = data_of_seed_1(vision::make_sobel(64, 48));
  const auto mine = runtime.submit("mine.sobel@64x48", {data.inputs[0]});
  const auto theirs = runtime.submit("sobel@64x48", {data.inputs[0]});
  EXPECT_TRUE(verify_exact(mine.get(), theirs.get()).ok);
  Runtime all(options_with({WorkloadFile{test::kExampleModule}}));
  EXPECT_NO_THROW(static_cast<void>(all.workload("mine.sobel")));
  RuntimeOptions absent = options_with({});
  absent.workloads = {"sobel", WorkloadFile{"/no/such/libmine.so"}};
  EXPECT_THAT(refusal(std::move(absent)), HasSubstr("libmine.so"));
  EXPECT_THAT(refusal(options_with({WorkloadFile{test::kExampleModule, {"sobel"}}})),
              AllOf(HasSubstr("has no workload 'sobel'"), HasSubstr("mine.sobel")));
}

/// Each frame goes to the next of @p names: what they make of them is what the one model does.
void expect_one_state(Runtime& runtime, const Workload& model,
                      const std::vector<std::string>& names) {
  const std::vector<Data> frames = sequence_of(model);
  std::vector<TaskFuture> futures;
  for (std::size_t i = 0; i < frames.size(); ++i) {
    futures.push_back(runtime.submit(names[i % names.size()], {frames[i].inputs[0]}));
  }
  const auto expected = reference_of(model, frames);
  for (std::size_t i = 0; i < frames.size(); ++i) {
    const Verdict verdict = model.verify(futures[i].get(), expected[i]);
    EXPECT_TRUE(verdict.ok) << i << ": " << verdict.detail;
  }
}

TEST(Runtime, TasksOfAStateHoldItOneAtATimeInOrder) {
  RuntimeOptions options = options_with({});
  options.workloads = {"background_model"};
  Runtime runtime(std::move(options));
  expect_one_state(runtime, find_workload("background_model"), {"background_model"});
}

TEST(Runtime, WorkloadsOfOwnSizesShareAStateByItsName) {
  RuntimeOptions options = options_with({});
  options.workloads = {background("even", 40, 30), background("odd", 40, 30)};
  Runtime runtime(std::move(options));
  expect_one_state(runtime, background("both", 40, 30), {"even", "odd"});
  // It counts its frames, up to 4.
  EXPECT_EQ(runtime.state("background")[1].as<std::int32_t>()[0], 4);
  EXPECT_THAT(bad_input([&] { static_cast<void>(runtime.state("foreground")); }),
              HasSubstr("foreground"));
  EXPECT_THAT(bad_input([&] {
                auto other = options_with({});
                other.workloads = {background("small", 40, 30), background("large", 80, 60)};
                const Runtime refused(std::move(other));
              }),
              HasSubstr("small and large"));
}

// Where real-time priorities are permitted, units have them; elsewhere it is said.
TEST(Runtime, ComputesAtAPriorityOrSaysThatItIsNotPermitted) {
  auto options = options_with({adding()});
  options.priority = 10;
  Runtime runtime(std::move(options));
  TaskFuture sum = runtime.submit("add", {number(0), number(1)});
  for (int i = 2; i <= 1000; ++i) sum = runtime.submit("add", {sum.output(0), number(i)});
  EXPECT_EQ(value_of(sum.get()), 500500);
  for (const std::string& problem : runtime.statistics().problems) {
    EXPECT_THAT(problem, HasSubstr("no real-time priority 10"));
  }
}

TEST(Runtime, RefusesOptionsThatMakeNoSense) {
  EXPECT_THAT(refusal(options_with({})), HasSubstr("needs workloads"));
  auto options = options_with({adding()});
  options.mode = "heft";
  EXPECT_THAT(refusal(options), HasSubstr("plans a whole mix ahead"));
  options.mode = "etc";
  EXPECT_THAT(refusal(options), HasSubstr("did you mean"));
  options.mode = "ect";
  options.workloads = {"gausian_blur"};
  EXPECT_THAT(refusal(options), HasSubstr("gaussian_blur"));
  options.workloads = {"sobel", "sobel"};
  EXPECT_THAT(refusal(options), HasSubstr("twice"));
  options.workloads = {adding()};
  options.most_tasks = 0;
  EXPECT_THAT(refusal(options), HasSubstr("most_tasks"));
  options.most_tasks = 1;
  std::get<OwnWorkload>(options.workloads[0]).kernels = {
      {"npu", [](std::span<const Tensor>, std::span<Tensor>) {}}};
  EXPECT_THAT(refusal(options),
              HasSubstr("two can run add (cpu: no kernel was given for it; gpu: "));
}

TEST(Runtime, RefusesTasksThatDoNotFit) {
  Runtime runtime(options_with({adding()}));
  const auto refused = [&](std::string_view name, std::vector<TaskInput> inputs,
                           TaskOptions options = {}) {
    return bad_input([&] { runtime.submit(name, std::move(inputs), std::move(options)); });
  };
  EXPECT_THAT(refused("ad", {number(1), number(2)}), HasSubstr("did you mean add"));
  EXPECT_THAT(refused("add", {number(1)}), HasSubstr("2 inputs"));
  const Tensor other({.name = "x", .element = Element::kF32, .shape = {1}});
  EXPECT_THAT(refused("add", {number(1), other}), HasSubstr("f32[1]"));
  const auto sum = runtime.submit("add", {number(1), number(2)});
  EXPECT_THAT(refused("add", {number(1), sum.output(1)}), HasSubstr("not there"));
  Runtime second(options_with({adding()}));
  EXPECT_THAT(bad_input([&] {
                second.submit("add", {number(1), sum.output(0)});
              }),
              HasSubstr("another runtime"));
  EXPECT_THAT(refused("add", {number(1), number(2)}, {.eligible = {"dsp"}}), HasSubstr("dsp"));
  EXPECT_EQ(runtime.statistics().submitted, 1);
}

TEST(Runtime, RefusesUnitsThatAreNotWhatAThreadIs) {
  EXPECT_THAT(refusal(options_with({adding()}, R"(
platform: wide
units:
  cpu: {backend: cpu, cores: all, servers: 4, active_w: 1}
)")),
              AllOf(HasSubstr("4 servers"), HasSubstr("one call after the other")));
}

}  // namespace
}  // namespace pirt::test
