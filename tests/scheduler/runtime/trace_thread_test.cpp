// A trace that another thread writes is the one that is written on the spot, however far that
// thread is behind; and one can be read wherever it ends.
#include "scheduler/runtime/trace_thread.h"

#include <filesystem>
#include <nlohmann/json.hpp>

#include "scheduler/policies/setup.h"
#include "scheduler/trace/replay.h"
#include "scheduler/trace/trace_document.h"
#include "scheduler/trace/trace_file.h"
#include "scheduler/virtual/virtual_time.h"
#include "tests/scheduler/support.h"
#include "workloads/base/text/text.h"

namespace pirt::test {
namespace {

/// Data along ports and from earlier firings, a state, expiry, contexts, calls that are given back.
constexpr const char* kBoard = R"(
platform: board
units:
  gpu: {slots: 2, active_w: 1}
  fpga: {contexts: {prepare_ms: 1}, active_w: 1}
  dsp: {servers: 2, discipline: processor_sharing, active_w: 1, link: bus}
links: {bus: {mbit_s: 1000, latency_ms: 0.1, active_w: 1}}
workloads:
  undistort: {gpu: [{on: gpu, ms: 0.5}], fpga: [{on: fpga, ms: 1}], dsp: [{on: dsp, ms: 2}]}
  gaussian_blur: {gpu: [{on: gpu, ms: 0.5}], fpga: [{on: fpga, ms: 1}], dsp: [{on: dsp, ms: 2}]}
  background_model: {gpu: [{on: gpu, ms: 0.5}], dsp: [{on: dsp, ms: 2}]}
)";
constexpr const char* kMix = R"(
mix: m
image_buffers: 6
pipelines:
  p:
    closed_loop: {frames: 3000}
    tasks:
      - {name: undistort, workload: undistort, image_input: true}
      - {name: late, workload: gaussian_blur, inputs: {image: undistort.image@-1}}
      - {name: model, workload: background_model, inputs: {image: undistort.image}}
)";

std::string trace_of(bool thread, int frames = 3000) {
  const auto path = std::filesystem::path(testing::TempDir()) / "pirt_trace_thread.json";
  const Platform platform = platform_of(kBoard);
  Mix mix = mix_of(kMix);
  mix.pipelines[0].frames = frames;
  ScheduleOptions options;
  options.mode = "ect";
  options.in_flight = 5;
  options.faults = Faults{.seed = 5};
  ModeSetup setup = set_up_mode(platform, nullptr, mix, options);
  Dispatcher dispatcher(setup.slots, std::move(setup.policy));
  TraceWriter writer(path, setup.scenario,
                     {&setup.mode.policy, platform.unit_names(), setup.slots, setup.policy_setup});
  if (thread) {
    TraceThread aside(writer);
    dispatcher.observe(&aside);
    writer.finish([&] {
      const Tally tally = VirtualTime(setup.scenario, dispatcher, {&aside}).run();
      aside.finish();
      return tally;
    }());
  } else {
    dispatcher.observe(&writer);
    writer.finish(VirtualTime(setup.scenario, dispatcher, {&writer}).run());
  }
  EXPECT_FALSE(replay_file(path).result.difference);
  std::string text = read_file(path.string(), kAnySize);
  std::filesystem::remove(path);
  return text;
}

TEST(TraceThread, WritesWhatIsWrittenOnTheSpot) {
  const std::string here = trace_of(false);
  EXPECT_GT(here.size(), 4'000'000U);  // More events than are ever kept.
  EXPECT_EQ(here == trace_of(true), true);
}

class TraceLines : public testing::Test {
 protected:
  /// What a reader makes of a file with that text: entry by entry, and the whole document.
  [[nodiscard]] FileReplay read(const std::string& text) const {
    write_file(path_, text);
    const Json part = parse_trace(text).at("pirt");
    const FileReplay result = replay_file(path_);
    EXPECT_EQ(part.at("inputs").is_null(), !result.complete);
    EXPECT_EQ(part.at("log").size(), result.size);
    EXPECT_FALSE(result.result.difference);
    return result;
  }
  ~TraceLines() override { std::filesystem::remove(path_); }

  const std::string path_ =
      (std::filesystem::path(testing::TempDir()) / "pirt_lines.json").string();
};

TEST_F(TraceLines, AreTheSameHoweverTheyAreLaidOut) {
  const std::string text = trace_of(true, 20);
  const auto lines = nlohmann::json::parse(text);
  std::size_t entries = 0;
  for (const auto& line : lines) {
    const auto name = line["name"].get<std::string>();
    entries += name == "pirt log" ? 1 : 0;
    if (!name.starts_with("pirt")) continue;
    EXPECT_TRUE(line["ph"] == "M") << "Perfetto ignores metadata that it does not know";
  }
  const FileReplay replayed = read(text);
  EXPECT_TRUE(replayed.complete);
  EXPECT_EQ(replayed.size, entries);
  // Laid out anew, as by a formatter, and as it was before it was lines.
  EXPECT_EQ(read(lines.dump(1)).size, entries);
  EXPECT_EQ(read(json_text(parse_trace(text))).size, entries);
}

TEST_F(TraceLines, ReplayUpToWhereTheyEnd) {
  const std::string text = trace_of(true, 12);
  const auto first = text.find("pirt log");
  std::size_t before = 0;
  for (std::size_t end = first; end < text.find("pirt end"); end += 101) {
    const FileReplay result = read(text.substr(0, end));
    EXPECT_FALSE(result.complete);
    EXPECT_GE(result.size.value(), before);
    before = *result.size;
  }
  EXPECT_EQ(before + 1 >= read(text).size.value(), true);
}

TEST_F(TraceLines, ThatAreDamagedAreRefused) {
  const std::string text = trace_of(true, 12);
  const auto refused = [&](const std::string& each) {
    write_file(path_, each);
    return bad_input([&] { static_cast<void>(replay_file(path_)); });
  };
  // An entry that is not there; what stops within the header; one that makes no sense.
  const auto entry = text.rfind("{\"name\":\"pirt log\"");
  auto less = text;
  less.erase(entry, less.find('\n', entry) + 1 - entry);
  EXPECT_THAT(refused(less), testing::AllOf(testing::HasSubstr(path_), testing::HasSubstr("log")));
  EXPECT_THAT(refused(text.substr(0, 100)), testing::HasSubstr("cut off"));
  auto word = text;
  word.replace(word.find("submit"), 6, "sumbit");
  EXPECT_THAT(refused(word), testing::HasSubstr("sumbit"));
  EXPECT_THAT(refused("[]"), testing::HasSubstr("--trace"));
}

TEST_F(TraceLines, AreUnderTheirNameOnceTheyAreFlushed) {
  write_file(path_, "what was there");
  TraceFile file(path_, Json::object({{"a", 1}}));
  file.event("{}");
  file.flush();  // Nothing that could be replayed.
  EXPECT_EQ(read_file(path_), "what was there");
  file.log("{}");
  file.event("{}");
  file.flush();
  const auto text = read_file(path_);
  EXPECT_EQ(std::ranges::count(text, '\n'), 4);
  file.finish();
  EXPECT_EQ(nlohmann::json::parse(read_file(path_)).back()["args"]["inputs"], 1);
}

TEST_F(TraceLines, LeaveNothingBehindIfARunInVirtualTimeDoesNotEnd) {
  const auto folder = std::filesystem::path(testing::TempDir()) / "pirt_trace_thread";
  std::filesystem::create_directories(folder);
  const Platform platform = platform_of(kBoard);
  const Mix mix = mix_of(kMix);
  ScheduleOptions options;
  options.mode = "ect";
  ModeSetup setup = set_up_mode(platform, nullptr, mix, options);
  Dispatcher dispatcher(setup.slots, std::move(setup.policy));
  {
    TraceWriter writer(
        folder / "t.json", setup.scenario,
        {&setup.mode.policy, platform.unit_names(), setup.slots, setup.policy_setup});
    dispatcher.observe(&writer);
    VirtualTime time(setup.scenario, dispatcher, {&writer});
    time.begin();
    for (int i = 0; i < 100; ++i) EXPECT_TRUE(time.advance());
  }
  EXPECT_TRUE(std::filesystem::is_empty(folder));
  std::filesystem::remove_all(folder);
}

}  // namespace
}  // namespace pirt::test
