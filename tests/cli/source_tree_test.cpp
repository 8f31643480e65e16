// The source tree keeps the rules that the compiler does not: includes go one way, backend headers
// stay in their folder.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <fstream>
#include <regex>
#include <string>
#include <string_view>
#include <vector>

#include "tests/support/paths.h"

namespace {

namespace fs = std::filesystem;
using pirt::test::kSourceFolder;

constexpr std::array<std::string_view, 5> kLayers = {"workloads", "characterize", "scheduler",
                                                     "reports", "cli"};

struct Include {
  std::string file;    ///< Relative to the source tree.
  std::string header;  ///< As written.
};

std::vector<Include> includes() {
  std::vector<Include> found;
  const fs::path root = kSourceFolder;
  for (const auto layer : kLayers) {
    for (const auto& entry : fs::recursive_directory_iterator(root / layer)) {
      const auto extension = entry.path().extension();
      if (extension != ".h" && extension != ".cpp") continue;
      std::ifstream in(entry.path());
      for (std::string line; std::getline(in, line);) {
        if (!line.starts_with("#include ") || line.size() < 12) continue;
        const auto end = line.find_first_of(">\"", 10);
        found.push_back({fs::relative(entry.path(), root).string(), line.substr(10, end - 10)});
      }
    }
  }
  return found;
}

std::size_t layer_of(std::string_view path) {
  const auto folder = path.substr(0, path.find('/'));
  return static_cast<std::size_t>(std::ranges::find(kLayers, folder) - kLayers.begin());
}

TEST(SourceTree, IncludesGoOneWay) {
  const auto all = includes();
  ASSERT_GT(all.size(), 100U) << "the scan found too little to mean anything";
  for (const auto& [file, header] : all) {
    const auto target = layer_of(header);
    if (target == kLayers.size()) continue;
    EXPECT_LE(target, layer_of(file)) << file << " includes " << header;
  }
}

// What each folder's README says of its rooms: one may include those before it. Programs for a
// device (dsp/program) include each other only.
TEST(SourceTree, RoomsIncludeThoseBeforeThem) {
  const std::vector<std::vector<std::string>> houses = {
      {"workloads/base",
       "workloads/base/math",
       "workloads/base/system",
       "workloads/base/text",
       "workloads/base/geometry",
       "workloads/model",
       "workloads/inputs/recording",
       "workloads/inputs/pictures",
       "workloads/vision",
       "workloads/dnn",
       "workloads/inputs/sequence",
       "workloads/inputs/scene",
       "workloads/slam/views",
       "workloads/slam/filter",
       "workloads/slam/run",
       "workloads/slam/workload",
       "workloads/planning",
       "workloads/mapping",
       "workloads/recognition",
       "workloads/own",
       "workloads/backends/cpu",
       "workloads/backends/opencl/tuning",
       "workloads/backends/opencl/device",
       "workloads/backends/opencl/plan",
       "workloads/backends/opencl/kernels",
       "workloads/backends/opencl",
       "workloads/backends/dsp",
       "workloads/backends/dsp/program",
       "workloads/backends/dsp/program/scalar",
       "workloads/backends/fpga",
       "workloads/backends/fake",
       "workloads/backends/nats/wire",
       "workloads/backends/nats/link",
       "workloads/backends/nats/robot",
       "workloads/backends/nats/service",
       "workloads/backends/nats",
       "workloads/backends",
       "workloads/catalog"},
      {"characterize/statistics", "characterize/machine", "characterize/platform",
       "characterize/profile", "characterize/profile/store", "characterize/energy",
       "characterize/worker", "characterize/campaign", "characterize/published",
       "characterize/doctor", "characterize/duet", "characterize/tune"},
      {"scheduler/mix", "scheduler/services", "scheduler/planner", "scheduler/policies",
       "scheduler/dispatcher", "scheduler/record", "scheduler/trace", "scheduler/virtual",
       "scheduler/runtime", "scheduler/unit_times", "scheduler/robot", "scheduler/bounds",
       "scheduler/budget", "scheduler"},
      {"reports/document", "reports/profile", "reports/run", "reports/paper", "reports/export",
       "reports/gate", "reports/history", "reports/tools", "reports"},
      {"cli/options", "cli/guide", "cli", "cli/commands/measure", "cli/commands/schedule",
       "cli/commands/robot", "cli/commands/show", "cli/commands/gate"}};
  const auto room_of = [](const std::vector<std::string>& house, const std::string& path) {
    const auto folder = fs::path(path).parent_path().string();
    return std::ranges::find(house, folder) - house.begin();
  };
  for (const auto& house : houses) {
    const auto top = house.front().substr(0, house.front().find('/')) + '/';
    const auto none = std::ssize(house);
    for (const auto& [file, header] : includes()) {
      if (!file.starts_with(top)) continue;
      EXPECT_LT(room_of(house, file), none) << file << " is in no room";
      if (!header.starts_with(top)) continue;
      EXPECT_LE(room_of(house, header), room_of(house, file)) << file << " includes " << header;
    }
  }
}

// A schedule is made from what is known of a platform, not from how it was found out.
TEST(SourceTree, TheSchedulerSeesPlatformsProfilesAndStatistics) {
  for (const auto& [file, header] : includes()) {
    if (!file.starts_with("scheduler/") || !header.starts_with("characterize/")) continue;
    const auto room = fs::path(header).parent_path().filename().string();
    EXPECT_TRUE(room == "platform" || room == "profile" || room == "statistics")
        << file << " includes " << header;
  }
}

// A device's own headers stay with its backend: others know the interfaces in workloads/model/.
TEST(SourceTree, BackendHeadersStayInTheirFolder) {
  struct Rule {
    std::string_view header_prefix;
    std::vector<std::string_view> allowed;
  };
  // inputs/ decodes files with OpenCV, recognition/ scales pictures for networks. backends/ itself
  // lists them and their options.
  const std::vector<Rule> rules = {
      {"opencv2/",
       {"workloads/backends/cpu/", "workloads/inputs/", "workloads/recognition/",
        "workloads/vision/features.cpp", "workloads/slam/"}},
      {"oneapi/", {"workloads/backends/cpu/"}},
      {"dnnl", {"workloads/backends/cpu/"}},
      {"omp.h", {"workloads/backends/cpu/"}},
      {"CL/", {"workloads/backends/opencl/"}},
      {"workloads/backends/cpu/",
       {"workloads/backends/cpu/", "workloads/backends/registry.cpp",
        "characterize/doctor/jitter"}},
      {"workloads/backends/dsp/",
       {"workloads/backends/dsp/", "workloads/backends/registry.cpp",
        "workloads/backends/backend_list.cpp"}},
      {"workloads/backends/fake/",
       {"workloads/backends/fake/", "workloads/backends/registry.cpp",
        "workloads/backends/backend_list.cpp", "characterize/platform/platform_file.cpp"}},
      {"workloads/backends/fpga/",
       {"workloads/backends/fpga/", "workloads/backends/registry.cpp",
        "workloads/backends/backend_list.cpp"}},
      {"workloads/backends/opencl/",
       {"workloads/backends/opencl/", "workloads/backends/registry.cpp", "characterize/tune/",
        "cli/commands/measure/tune.cpp", "cli/options/files.cpp"}},
      {"sqlite3.h",
       {"characterize/profile/store/", "characterize/machine/environment.cpp",
        "workloads/inputs/recording/db3.cpp"}},
      {"openssl/", {"workloads/backends/nats/wire/wire.cpp"}},
      {"nats/", {"workloads/backends/nats/link/connection.cpp"}},
      {"workloads/backends/nats/",
       {"workloads/backends/nats/", "workloads/backends/registry.cpp",
        "workloads/backends/backend_list.cpp", "cli/commands/robot/cloud"}},
      {"ceres/", {"characterize/energy/fit.cpp", "workloads/mapping/"}},
      {"glog/", {"workloads/mapping/"}},
      {"Eigen/",
       {"characterize/energy/fit.cpp", "workloads/base/geometry/", "workloads/inputs/",
        "workloads/vision/features", "workloads/vision/feature_parts.cpp",
        "workloads/vision/pyramid", "workloads/slam/"}},
      // For the time that they take to compile.
      {"nlohmann/", {"workloads/base/text/json.cpp"}},
      {"yaml-cpp/",
       {"workloads/base/text/yaml.cpp", "characterize/platform/platform_file.cpp",
        "characterize/platform/unit_request.cpp"}},
      {"CLI/", {"cli/options/command.cpp"}}};
  for (const auto& include : includes()) {
    for (const auto& rule : rules) {
      if (!include.header.starts_with(rule.header_prefix)) continue;
      EXPECT_TRUE(
          std::ranges::any_of(rule.allowed, [&](auto a) { return include.file.starts_with(a); }))
          << include.file << " includes " << include.header;
    }
  }
}

// Elsewhere, nobody would have looked whether it overwrites an input (cli/options/files.h). And a
// note that fmt::print cannot write is an exception.
TEST(SourceTree, CommandsWriteInOnePlace) {
  int lines = 0;
  for (const auto& entry : fs::recursive_directory_iterator(fs::path(kSourceFolder) / "cli")) {
    if (!entry.is_regular_file() || entry.path().filename() == "output.cpp") continue;
    std::ifstream in(entry.path());
    for (std::string line; std::getline(in, line); ++lines) {
      for (const auto* way : {"write_file(", "ofstream", "fopen(", "TraceFile", "fmt::print("}) {
        EXPECT_EQ(line.find(way), std::string::npos) << entry.path() << ": " << line;
      }
    }
  }
  EXPECT_GT(lines, 1000) << "the scan found too little to mean anything";
}

// fmt 11 has it in no other header.
TEST(SourceTree, WhoJoinsIncludesWhatHasItInEachVersionOfFmt) {
  int files = 0;
  for (const auto layer : kLayers) {
    for (const auto& entry : fs::recursive_directory_iterator(fs::path(kSourceFolder) / layer)) {
      if (entry.path().extension() != ".h" && entry.path().extension() != ".cpp") continue;
      std::ifstream in(entry.path());
      const std::string text(std::istreambuf_iterator<char>(in), {});
      if (text.find("fmt::join(") == std::string::npos) continue;
      EXPECT_NE(text.find("#include <fmt/ranges.h>"), std::string::npos) << entry.path();
      ++files;
    }
  }
  EXPECT_GT(files, 10) << "the scan found too little to mean anything";
}

// An exception out of a thread ends the program, unless the thread was started by start_thread.
TEST(SourceTree, ThreadsAreStartedInOnePlace) {
  // std::jthread name(...), std::thread{...}, threads.emplace_back([...
  const std::regex way(R"(std::j?thread\s*\w*\s*[({]|std::async|pthread_create|thrd_create|)"
                       R"(emplace_back\(\[|std::thread\b(?!::))");
  int lines = 0;
  for (const auto layer : kLayers) {
    for (const auto& entry : fs::recursive_directory_iterator(fs::path(kSourceFolder) / layer)) {
      const auto file = fs::relative(entry.path(), kSourceFolder).string();
      if (!entry.is_regular_file() || file == "workloads/base/system/thread.h") continue;
      if (entry.path().extension() != ".h" && entry.path().extension() != ".cpp") continue;
      std::ifstream in(entry.path());
      for (std::string line; std::getline(in, line); ++lines) {
        const std::string code = line.substr(0, line.find("//"));
        EXPECT_FALSE(std::regex_search(code, way)) << file << ": " << line;
      }
    }
  }
  EXPECT_GT(lines, 10'000) << "the scan found too little to mean anything";
}

// Elsewhere a simulated run (tests/scheduler/simulation) would not see it.
TEST(SourceTree, ThreadsOfLiveRunsMeetByOneHeader) {
  const std::regex way(
      R"(std::(recursive_|shared_|timed_)*mutex|std::atomic|std::condition_variable|)"
      R"(std::(counting_|binary_)*semaphore|std::latch|std::barrier|std::j?thread|)"
      R"(std::this_thread|_clock::now|MachineClock|SYS_futex)");
  int lines = 0;
  const auto room = fs::path(kSourceFolder) / "scheduler" / "runtime";
  for (const auto& entry : fs::directory_iterator(room)) {
    if (entry.path().filename() == "threads.h") continue;
    std::ifstream in(entry.path());
    for (std::string line; std::getline(in, line); ++lines) {
      const std::string code = line.substr(0, line.find("//"));
      EXPECT_FALSE(std::regex_search(code, way)) << entry.path() << ": " << line;
    }
  }
  EXPECT_GT(lines, 2'000) << "the scan found too little to mean anything";
}

TEST(SourceTree, WhoeverHasAGpuRunsEachSuiteThatNeedsOne) {
  std::ifstream script(fs::path(kSourceFolder) / "tests/bench/gpu");
  std::string filter;
  while (std::getline(script, filter) && !filter.starts_with("filter=")) {
  }
  // Those of no device, of certain drivers, and of how drivers end.
  const std::vector<std::string> left_out = {
      "OpenClBackend",          "OpenClErrors",          "OpenClParameters",
      "OpenClWithoutDriver",    "OpenClProgram",         "OpenClDeviceDeathTest",
      "OpenClDriversDeathTest", "OpenClLimitsDeathTest", "OpenClKernelCache"};
  const std::regex test(R"(^TEST(_F|_P)?\((OpenCl\w+),)");
  int suites = 0;
  const auto room = fs::path(kSourceFolder) / "tests/workloads/backends/opencl";
  for (const auto& entry : fs::directory_iterator(room)) {
    std::ifstream in(entry.path());
    std::smatch found;
    for (std::string line; std::getline(in, line);) {
      if (!std::regex_search(line, found, test)) continue;
      const std::string suite = found[2];
      ++suites;
      if (std::ranges::find(left_out, suite) != left_out.end()) continue;
      EXPECT_NE(filter.find("*" + suite + "."), std::string::npos) << suite;
    }
  }
  EXPECT_GT(suites, 50) << "the scan found too little to mean anything";
}

TEST(SourceTree, TopLevelHoldsOnlyWhatIsMandated) {
  const std::vector<std::string> allowed = {
      "CMakeLists.txt", "CMakePresets.json", "README.md", "cli",  "characterize",
      "scheduler",      "workloads",         "reports",   "tests"};
  for (const auto& entry : fs::directory_iterator(kSourceFolder)) {
    const auto name = entry.path().filename().string();
    if (name.starts_with(".") || name.starts_with("build")) continue;
    EXPECT_NE(std::ranges::find(allowed, name), allowed.end()) << name;
  }
}

}  // namespace
