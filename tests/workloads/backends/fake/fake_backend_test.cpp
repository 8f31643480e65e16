#include "workloads/backends/fake/fake_backend.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "workloads/backends/fake/fake_script.h"
#include "workloads/base/error.h"
#include "workloads/catalog/catalog.h"
#include "workloads/inputs/pictures/images.h"
#include "workloads/model/tensor_file.h"

namespace pirt {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

UnitRequest unit(const std::string& script) { return {"gpu", {}, "", script}; }

/// A device with one workload prepared and bound.
struct Prepared {
  explicit Prepared(const std::string& script, const std::string& workload = "pool5")
      : spec(find_workload(workload)),
        images(generated_images(1)),
        data(spec.make_data({1, images.get()})),
        outputs(make_tensors(spec.outputs)),
        backend(make_fake_backend()),
        device(backend->open(unit(script))),
        kernel(device->prepare(spec, data.parameters)) {
    kernel->bind(data.inputs, outputs);
  }
  [[nodiscard]] Nanos now() const { return device->own_clock()->now(); }
  void call() {
    kernel->upload();
    launched = kernel->execute(1);
    kernel->download();
  }
  [[nodiscard]] bool is_right() const { return spec.verify(outputs, spec.reference(data)).ok; }

  const Workload& spec;
  std::unique_ptr<ImageSource> images;
  Data data;
  std::vector<Tensor> outputs;
  std::unique_ptr<const Backend> backend;
  std::unique_ptr<Device> device;
  std::unique_ptr<Kernel> kernel;
  std::optional<Nanos> launched;
};

std::string error_of(ErrorCode code, const std::function<void()>& action) {
  try {
    action();
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), code);
    return error.what();
  }
  ADD_FAILURE() << "no error was thrown";
  return "";
}

TEST(FakeBackend, TakesTheScriptedTimesOnItsOwnClock) {
  Prepared fake(R"(
device_init_ms: 3
prepare_ms: {cold: 20, warm: 4}
stages: {pool5: [{name: upload, ms: 1}, {name: launch, ms: 0.5}, {ms: 2}, {name: download, ms: 0.25}]}
)");
  EXPECT_EQ(fake.now(), from_ms(23));  // opened and prepared, without a cache: cold
  fake.kernel->upload();
  EXPECT_EQ(fake.now(), from_ms(24));
  EXPECT_EQ(fake.kernel->execute(1), from_ms(0.5));  // what launching took
  EXPECT_EQ(fake.now(), from_ms(26.5));
  fake.kernel->download();
  EXPECT_EQ(fake.now(), from_ms(26.75));
  EXPECT_EQ(fake.kernel->execute(3), from_ms(1.5));
  EXPECT_EQ(fake.now(), from_ms(34.25));
  EXPECT_EQ(fake.device->provenance(), Provenance::kModelled);
}

// At least: how much longer a sleep takes is the machine's.
TEST(FakeBackend, HoldsItsUnitInRealTimeIfTheScriptSaysSo) {
  const MachineClock clock;
  const Nanos start = clock.now();
  Prepared fake(R"(
clock: wall
device_init_ms: 2
prepare_ms: 3
stages: {pool5: [{name: upload, ms: 1}, {name: launch, ms: 1}, {ms: 2}, {name: download, ms: 1}]}
)");
  EXPECT_GE(clock.now() - start, from_ms(5));
  EXPECT_EQ(fake.device->own_clock(), nullptr);
  EXPECT_EQ(fake.device->provenance(), Provenance::kModelled) << "nothing computes for so long";
  const Nanos before = clock.now();
  fake.call();
  EXPECT_GE(clock.now() - before, from_ms(5));
  EXPECT_GE(fake.launched, from_ms(1));
  EXPECT_TRUE(fake.is_right());
}

// What lies in the host's tensors counts when it is uploaded, not when they are bound.
TEST(FakeBackend, TakesItsInputsWhenTheyAreUploaded) {
  Prepared fake("device: x", "gaussian_blur");
  fake.call();
  std::ranges::fill(fake.data.inputs[0].as<std::uint8_t>(), std::uint8_t{7});
  fake.kernel->execute(1);
  fake.kernel->download();
  EXPECT_FALSE(fake.is_right());
  fake.call();
  EXPECT_TRUE(fake.is_right());
}

TEST(FakeBackend, HasNoLaunchTimeWithoutALaunchStage) {
  Prepared fake("stages: {pool5: [{name: execute, ms: 2}]}");
  EXPECT_EQ(fake.kernel->execute(1), std::nullopt);
}

TEST(FakeBackend, PlaysScriptedSamplesOverAgain) {
  Prepared fake("samples_ms: {pool5: [1, 2.5]}\nstages: {pool5: [{name: execute, ms: 9}]}");
  std::vector<Nanos> taken;
  for (int i = 0; i < 3; ++i) {
    const Nanos before = fake.now();
    fake.kernel->execute(1);
    taken.push_back(fake.now() - before);
  }
  EXPECT_EQ(taken, (std::vector<Nanos>{from_ms(1), from_ms(2.5), from_ms(1)}));
}

TEST(FakeBackend, DrawsWithinBoundsAndFromTheSeed) {
  const auto draws = [](const std::string& seed) {
    Prepared fake("stages: {pool5: [{name: execute, ms: {uniform: [1, 3]}}]}\nseed: " + seed);
    std::vector<Nanos> times;
    for (int i = 0; i < 200; ++i) {
      const Nanos before = fake.now();
      fake.kernel->execute(1);
      times.push_back(fake.now() - before);
    }
    return times;
  };
  const auto times = draws("1");
  EXPECT_GE(*std::ranges::min_element(times), from_ms(1));
  EXPECT_LE(*std::ranges::max_element(times), from_ms(3));
  EXPECT_LT(*std::ranges::min_element(times), from_ms(1.2));
  EXPECT_GT(*std::ranges::max_element(times), from_ms(2.8));
  EXPECT_EQ(times, draws("1"));
  EXPECT_NE(times, draws("2"));
}

TEST(FakeBackend, GivesTheReferenceForIntegersAndFloats) {
  for (const char* name : {"gaussian_blur", "fc8"}) {
    Prepared fake("", name);
    fake.call();
    EXPECT_TRUE(fake.is_right()) << name;
  }
}

TEST(FakeBackend, FollowsNewInputs) {
  Prepared fake("");
  fake.call();
  fake.data.inputs[0].as<float>()[0] += 100.0F;
  EXPECT_FALSE(fake.is_right());  // the reference has moved on
  fake.kernel->bind(fake.data.inputs, fake.outputs);
  fake.call();
  EXPECT_TRUE(fake.is_right());
}

TEST(FakeBackend, IsWrongWhereScripted) {
  Prepared wrong("wrong_output: [gaussian_blur]", "gaussian_blur");
  wrong.call();
  EXPECT_FALSE(wrong.is_right());
  Prepared nan("nan_output: [pool5]");
  nan.call();
  EXPECT_TRUE(std::isnan(nan.outputs[0].as<float>()[0]));
  EXPECT_FALSE(nan.is_right());
  Prepared later("wrong_output_after: {pool5: 2}");
  later.call();
  later.call();
  EXPECT_TRUE(later.is_right());
  later.call();
  EXPECT_FALSE(later.is_right());
}

TEST(FakeBackend, FailsWhereScripted) {
  EXPECT_EQ(error_of(ErrorCode::kEnvironment, [] { Prepared fake("fail_open: not plugged in"); }),
            "not plugged in");
  EXPECT_THAT(error_of(ErrorCode::kEnvironment, [] { Prepared fake("fail_prepare: [pool5]"); }),
              HasSubstr("pool5: preparation fails"));
  EXPECT_THAT(error_of(ErrorCode::kEnvironment, [] { Prepared("fail_execute: [pool5]").call(); }),
              HasSubstr("pool5: execution fails"));
}

TEST(FakeBackend, CrashesWhereScripted) {
  EXPECT_EXIT(Prepared("crash: [pool5]").call(), ::testing::KilledBySignal(SIGABRT), "");
}

TEST(FakeBackend, HangsWhereScripted) {
  EXPECT_EXIT(
      {
        ::alarm(1);  // only the signal ends it
        Prepared("hang: [pool5]").call();
        ::_exit(0);
      },
      ::testing::KilledBySignal(SIGALRM), "");
}

TEST(FakeBackend, FindsItsKernelsInTheCacheTheSecondTime) {
  const auto folder =
      std::filesystem::temp_directory_path() / ("pirt-fake-" + std::to_string(::getpid()));
  std::filesystem::create_directory(folder);
  const auto variables = make_fake_backend()->kernel_cache_environment(folder.string());
  ASSERT_EQ(variables.size(), 1U);
  ::setenv(variables[0].first.c_str(), variables[0].second.c_str(), 1);
  const std::string script = "device_init_ms: 0\nprepare_ms: {cold: 20, warm: 4}";
  EXPECT_EQ(Prepared(script).now(), from_ms(20));
  EXPECT_EQ(Prepared(script).now(), from_ms(4));
  EXPECT_EQ(Prepared(script, "fc8").now(), from_ms(20));  // a kernel of its own
  Prepared third("process_factors: [1, 1.1, 2.5]\nsamples_ms: {pool5: [10]}");
  const Nanos before = third.now();
  third.kernel->execute(1);
  EXPECT_EQ(third.now() - before, from_ms(2.5 * 10.01));  // a launch of 0.01 ms
  ::unsetenv(variables[0].first.c_str());
  EXPECT_EQ(Prepared(script).now(), from_ms(20));
  std::filesystem::remove_all(folder);
}

TEST(FakeBackend, SupportsWhatItsScriptDoesNotExclude) {
  const auto backend = make_fake_backend();
  for (const Workload& workload : catalog()) {
    EXPECT_TRUE(backend->supports(workload).ok);
    const Support support = backend->supports_on(unit("unsupported: [fc6]"), workload);
    EXPECT_EQ(support.ok, workload.name != "fc6");
    EXPECT_EQ(support.reason.empty(), support.ok);
  }
  EXPECT_TRUE(backend->probe().available);
}

TEST(FakeBackend, TakesAReferenceThatIsThere) {
  const auto folder =
      std::filesystem::temp_directory_path() / ("pirt-ref-" + std::to_string(::getpid()));
  std::filesystem::create_directory(folder);
  const Workload& pool = find_workload("pool5");
  auto sevens = make_tensors(reference_specs(pool));
  std::ranges::fill(sevens[0].as<double>(), 7.0);
  write_tensors(folder / "pool5.reference", sevens);
  Prepared fake("reference_folder: " + folder.string());
  fake.call();
  EXPECT_EQ(fake.outputs[0].as<float>()[0], 7.0F);
  std::filesystem::remove_all(folder);
}

TEST(TensorFile, RoundTripsAndNoticesDamage) {
  const auto path =
      std::filesystem::temp_directory_path() / ("pirt-tensors-" + std::to_string(::getpid()));
  const std::vector<TensorSpec> specs = {{"a", Element::kU8, {3}}, {"b", Element::kF64, {2, 2}}};
  auto tensors = make_tensors(specs);
  tensors[0].as<std::uint8_t>()[2] = 9;
  tensors[1].as<double>()[3] = 0.5;
  write_tensors(path, tensors);
  const auto read = read_tensors(path, specs);
  EXPECT_EQ(read[0].as<std::uint8_t>()[2], 9);
  EXPECT_EQ(read[1].as<double>()[3], 0.5);

  const std::vector<TensorSpec> other = {{"a", Element::kU8, {4}}};
  EXPECT_THAT(error_of(ErrorCode::kBadInput, [&] { static_cast<void>(read_tensors(path, other)); }),
              HasSubstr("other tensors"));
  {
    std::FILE* file = std::fopen(path.c_str(), "r+b");
    ASSERT_NE(file, nullptr);
    std::fseek(file, -1, SEEK_END);
    std::fputc(1, file);
    std::fclose(file);
  }
  EXPECT_THAT(error_of(ErrorCode::kBadInput, [&] { static_cast<void>(read_tensors(path, specs)); }),
              HasSubstr("damaged"));
  std::filesystem::remove(path);
  EXPECT_THAT(error_of(ErrorCode::kBadInput, [&] { static_cast<void>(read_tensors(path, specs)); }),
              HasSubstr("cannot read"));
}

TEST(FakeScript, RefusesWhatItDoesNotUnderstand) {
  const std::vector<std::pair<std::string, std::string>> cases = {
      {"devise: x", "fake script:1: devise: unknown key (did you mean device"},
      {"device: x\nstages: {a: [{name: kernel, ms: 1}]}",
       "fake script:2: stages.a[0].name: 'kernel' is not one of upload"},
      {"stages: {a: [{name: execute}]}", "fake script:1: stages.a[0]: missing key 'ms'"},
      {"stages: {a: [{name: execute, s: 1}]}", "stages.a[0].s: unknown key"},
      {"stages: {a: []}", "at least one entry"},
      {"stages: {a: [{ms: {uniform: [2, 1]}}]}",
       "stages.a[0].ms.uniform: low must not be above high"},
      {"stages: {a: [{ms: {normal: [2, 1]}}]}", "stages.a[0].ms.normal: unknown key"},
      {"device_init_ms: -1", "device_init_ms: must be between 0 and"},
      {"device_init_ms: .nan", "device_init_ms: must be a finite number"},
      {"device_init_ms: 1e300", "device_init_ms: must be between 0 and"},
      {"device_init_ms: soon", "must be a finite number in decimal notation, got 'soon'"},
      {"device_init_ms: 1e-7", "must be 0 or at least"},
      {"device_init_ms: '1'", "must be a number without quotes"},
      {"device: x\nseed: 010", "fake script:2: seed: must be a whole number"},
      {"clock: real", "fake script:1: clock: 'real' is not one of simulated, wall"},
      {"seed: -1", "seed: must be between 0 and 9223372036854775807, got -1"},
      {"seed: 9223372036854775808", "seed: must be between 0 and 9223372036854775807"},
      {"cache_kb: 0", "cache_kb: must be between 1 and"},
      {"cache_kb: 9223372036854775807", "cache_kb: must be between 1 and"},
      {"cache_kb: 0x10", "cache_kb: must be a whole number"},
      {"process_factors: [1, 0]", "process_factors[1]: must be between 0.001 and 1000, got 0"},
      {"process_factors: [.inf]", "process_factors[0]: must be a finite number"},
      {"peaks_g_s: {f32: 1e-300}", "peaks_g_s.f32: must be between"},
      {"peaks_g_s: {f32: 0}", "peaks_g_s.f32: must be between"},
      {"peaks_g_s: {f3: 1}", "peaks_g_s.f3: unknown key"},
      {"wrong_output_after: {a: -1}", "wrong_output_after.a: must be between 0 and"},
      {"device: \"a\\nb\"", "device: must be one line of text"},
      {"crash: [\"a\\x1bb\"]", "the text has"},
      {"prepare_ms: {hot: 1}", "prepare_ms.hot: unknown key"},
      {"crash: sobel", "crash: must be a list"},
      {"- a", "must be a map"},
      {"seed: 1\nseed: 2", "fake script:2: seed: given twice"},
      {"samples_ms: {a: [1], a: [2]}", "samples_ms.a: given twice"},
      {"crash: [a", "fake script:"},
      {"wrong_output_after: {a: many}",
       "wrong_output_after.a: must be a whole number in plain digits, got 'many'"}};
  for (const auto& [text, expected] : cases) {
    const std::string& script = text;  // a lambda cannot capture a binding
    EXPECT_THAT(
        error_of(ErrorCode::kBadInput, [&] { static_cast<void>(fake::parse_script(script)); }),
        HasSubstr(expected))
        << script;
  }
  EXPECT_EQ(fake::parse_script("").device, "fake device");
}

TEST(FakeBackend, RefusesTimesThatDoNotAddUpInsteadOfWrappingRound) {
  Prepared fake("samples_ms: {pool5: [1e9]}\nprocess_factors: [1000]");
  EXPECT_THAT(error_of(ErrorCode::kBadInput,
                       [&] {
                         for (int i = 0; i < 10; ++i) fake.kernel->execute(1);
                       }),
              HasSubstr("add up to 292 years"));
}

}  // namespace
}  // namespace pirt
