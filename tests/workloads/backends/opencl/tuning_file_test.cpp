// The file of tuned parameters: found, round trip, and what is refused.
#include "workloads/backends/opencl/tuning/tuning_file.h"

#include <gmock/gmock.h>

#include <cstdlib>
#include <functional>

#include "tests/support/as_nobody.h"
#include "tests/workloads/backends/opencl/tuning_support.h"
#include "workloads/base/error.h"
#include "workloads/base/text/text.h"

namespace pirt::opencl {
namespace {

using testing::AllOf;
using testing::HasSubstr;

const DeviceInfo kDevice{"a device", "a platform", "1.2, driver 3", 2, true};

/// The message of the Error{kBadInput} that @p body throws; fails the test if it throws none.
std::string refusal(const std::function<void()>& body) {
  try {
    body();
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kBadInput);
    return error.what();
  }
  ADD_FAILURE() << "no error";
  return {};
}

std::string refusal_of(const std::string& text) {
  return refusal([&] { static_cast<void>(parse_tuning("the/file.json", text)); });
}

/// A file with one entry, in which @p from was replaced.
std::string changed(const std::string& from, const std::string& to) {
  TunedDevice entry = test::entry_for(kDevice);
  entry.tuning.set(Parameter::kFcRows, 2);
  std::string text = tuning_text({.devices = {entry}});
  const auto at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from << " in " << text;
  return text.replace(at, from.size(), to);
}

TEST(TuningFile, ReadsWhatItWrote) {
  TuningFile file;
  TunedDevice cpu = test::entry_for(kDevice);
  cpu.tuning.set(Parameter::kFlowRunX, 64);
  cpu.tuning.set(Parameter::kLocalX, 32);
  TunedDevice gpu = test::entry_for({"a \"GPU\"", "p", "v", 80, false});
  gpu.tuning.set(Parameter::kLocalX, 256);
  file.put(cpu);
  file.put(gpu);
  EXPECT_EQ(parse_tuning("f", tuning_text(file)).devices, file.devices);
}

TEST(TuningFile, HasOneEntryADevice) {
  TuningFile file;
  file.put(test::entry_for(kDevice));
  TunedDevice later = test::entry_for(kDevice);
  later.tuning.set(Parameter::kFcRows, 1);
  file.put(later);
  ASSERT_EQ(file.devices.size(), 1U);
  ASSERT_NE(file.find(kDevice), nullptr);
  EXPECT_EQ(file.find(kDevice)->tuning, later.tuning);
  DeviceInfo updated = kDevice;
  updated.version = "1.2, driver 4";
  EXPECT_EQ(file.find(updated), nullptr);
}

TEST(TuningFile, RefusesWhatItDoesNotKnowAndSaysWhereAndWhatToDo) {
  const auto names_the_file = AllOf(HasSubstr("the/file.json"), HasSubstr("pirt tune"));
  EXPECT_THAT(refusal_of(""), names_the_file);
  EXPECT_THAT(refusal_of("{\"schema_version\": 1, \"devi"), names_the_file);
  EXPECT_THAT(refusal_of("[]"), names_the_file);
  EXPECT_THAT(refusal_of("{\"schema_version\": 1, \"devices\": null}"), names_the_file);
  EXPECT_THAT(refusal_of("{\"schema_version\": 1, \"devices\": [3]}"), names_the_file);
  for (const char* version : {"2", "1.5", "1e+300", "-1", "true", "null"}) {
    EXPECT_THAT(
        refusal_of(changed("\"schema_version\": 1", std::string("\"schema_version\": ") + version)),
        AllOf(names_the_file, HasSubstr(std::string("schema version ") + version)));
  }
  EXPECT_THAT(refusal_of(changed("fc_rows", "fc_row")),
              AllOf(names_the_file, HasSubstr("\"fc_row\""), HasSubstr("fc_rows")));
  for (const char* value : {"3", "-1", "8.5", "\"8\"", "null", "99999999999999", "[8]"}) {
    EXPECT_THAT(refusal_of(changed("\"fc_rows\": 2", std::string("\"fc_rows\": ") + value)),
                AllOf(names_the_file, HasSubstr(value), HasSubstr("1, 2, 4, 8")));
  }
  EXPECT_THAT(refusal_of(changed("\"device\"", "\"devise\"")), names_the_file);
  EXPECT_THAT(refusal_of(changed("\"is_cpu\": true", "\"is_cpu\": 1")), names_the_file);
  const TuningFile twice{.devices = {test::entry_for(kDevice), test::entry_for(kDevice)}};
  EXPECT_THAT(refusal_of(tuning_text(twice)), AllOf(names_the_file, HasSubstr("twice")));
}

TEST(TuningFile, OfAnotherKindOfDeviceIsRefusedWhenTheDeviceIsOpened) {
  TunedDevice entry = test::entry_for(kDevice);
  entry.tuning = Tuning(false);
  const test::TuningInUse file({entry});
  EXPECT_THAT(refusal([] { static_cast<void>(tuning_for(kDevice)); }),
              AllOf(HasSubstr(file.path().string()), HasSubstr("is_cpu")));
}

TEST(TuningFile, ThatMayNotBeReadIsSaidWithTheRemedy) {
  std::string folder = (std::filesystem::temp_directory_path() / "pirt-test-XXXXXX").string();
  ASSERT_NE(::mkdtemp(folder.data()), nullptr);
  std::filesystem::permissions(folder, std::filesystem::perms(0755));
  const auto file = std::filesystem::path(folder) / "tuning.json";
  write_file(file, tuning_text({.devices = {test::entry_for(kDevice)}}));
  const test::TuningVariable variable(file.string());
  for (const std::filesystem::path& closed : {file, std::filesystem::path(folder)}) {
    const auto before = std::filesystem::status(closed).permissions();
    std::filesystem::permissions(closed, std::filesystem::perms::none);
    test::as_nobody([&] {
      EXPECT_THAT(refusal([] { static_cast<void>(tuning_for(kDevice)); }),
                  AllOf(HasSubstr(file.string()), HasSubstr("Permission denied"),
                        HasSubstr("PIRT_TUNING")));
    });
    std::filesystem::permissions(closed, before);
  }
  std::filesystem::remove_all(folder);
}

TEST(TuningFile, ThatPirtTuningNamesMustBeThere) {
  const test::TuningVariable variable("/no/such/file.json");
  EXPECT_THAT(refusal([] { static_cast<void>(tuning_for(kDevice)); }),
              AllOf(HasSubstr("/no/such/file.json"), HasSubstr("pirt tune --output")));
}

TEST(TuningFile, LiesWhereTheVariablesSay) {
  const char* config = std::getenv("XDG_CONFIG_HOME");
  const std::string config_before = config == nullptr ? "" : config;
  {
    const test::TuningVariable variable("/a/file.json");
    EXPECT_EQ(tuning_path(), std::filesystem::path("/a/file.json"));
  }
  {
    const test::TuningVariable variable("none");
    EXPECT_EQ(tuning_path(), std::nullopt);
    EXPECT_EQ(tuning_for(kDevice), Tuning(true));
  }
  const test::TuningVariable variable("");
  ::setenv("XDG_CONFIG_HOME", "/config", 1);
  EXPECT_EQ(tuning_path(), std::filesystem::path("/config/pirt/opencl-tuning.json"));
  EXPECT_EQ(tuning_for(kDevice), Tuning(true)) << "no file is no tuning";
  ::setenv("XDG_CONFIG_HOME", "relative", 1);  // Ignored, as its specification says.
  if (const char* home = std::getenv("HOME"); home != nullptr && home[0] == '/') {
    EXPECT_EQ(tuning_path(),
              std::filesystem::path(home) / ".config" / "pirt" / "opencl-tuning.json");
  }
  ::setenv("XDG_CONFIG_HOME", config_before.c_str(), 1);
}

TEST(TuningFileDeathTest, IsForTestsTheOneThatTheirVariableNames) {
  GTEST_FLAG_SET(death_test_style, "threadsafe");
  const auto ends_with = [](const char* tuning) {  // In a program that starts anew.
    EXPECT_EXIT(std::exit(std::getenv("PIRT_TUNING") == std::string(tuning) ? 0 : 1),
                testing::ExitedWithCode(0), "")
        << tuning;
  };
  ::setenv("PIRT_TEST_TUNING", "/the/board.json", 1);
  ends_with("/the/board.json");
  ::unsetenv("PIRT_TEST_TUNING");
  ends_with("none");
}

}  // namespace
}  // namespace pirt::opencl
