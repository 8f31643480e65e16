// Workload files in the runtime library: programs that are late or fail, and names that files
// share.
#include <cstdlib>
#include <filesystem>
#include <fstream>

#include "scheduler/runtime/time_limit.h"
#include "tests/scheduler/runtime/runtime_support.h"
#include "workloads/own/own.h"

namespace pirt::test {
namespace {

using namespace std::chrono_literals;
using testing::AllOf;
using testing::HasSubstr;
namespace fs = std::filesystem;

class RuntimeFiles : public testing::Test {
 protected:
  RuntimeFiles() {
    std::string name = (fs::temp_directory_path() / "pirt-files-XXXXXX").string();
    folder_ = ::mkdtemp(name.data());
  }
  ~RuntimeFiles() override { fs::remove_all(folder_); }
  [[nodiscard]] std::string write(const std::string& name, const std::string& text) const {
    std::ofstream(folder_ / name) << text;
    return (folder_ / name).string();
  }
  /// A workload file with a program for each name.
  [[nodiscard]] std::string programs(const std::string& file, const std::vector<std::string>& names,
                                     const std::string& more = "") const {
    std::string text = "workloads:\n";
    for (const std::string& name : names) {
      text += "  - {name: " + name + ", outputs: {a: \"u8[1]\"}, command: [python3, p.py]" + more +
              "}\n";
    }
    return write(file, text);
  }
  fs::path folder_;
};

// It kills the program then, and says which limit it was; the unit goes on.
TEST_F(RuntimeFiles, AProgramsOwnLimitsComeBeforeItsUnits) {
  const auto limit = [this](const std::string& more) {
    const auto all = own::load(programs("w.yaml", {"my.p"}, more));
    return time_limit(Service{}, false, own::to_workload(all.front()));
  };
  EXPECT_EQ(limit(""), 60s + 10s + kLeastTimeLimit);
  EXPECT_EQ(limit(", start_limit_ms: 500, call_limit_ms: 6000"), 500ms + 6s + kLeastTimeLimit);
}

// The first call is that which ends its preparation.
TEST_F(RuntimeFiles, AProgramThatAnswersAnErrorFailsItsTaskAndNoMore) {
  const std::string answers = R"(import json, sys
def answer(line):
    print(json.dumps(line), flush=True)
sys.stdin.readline()
answer({"ready": True})
calls = 0
for line in sys.stdin:
    asked = json.loads(line)
    if "null" in asked:
        answer({"done": asked["null"]})
        continue
    calls += 1
    answer({"error": "no points"} if 1 < calls < 5 else {"done": asked["call"]})
)";
  static_cast<void>(write("p.py", answers));
  Runtime runtime(options_with({WorkloadFile{programs("w.yaml", {"my.p"})}}, kOneUnit));
  for (int i = 0; i < 3; ++i) {
    const auto failed = runtime.submit("my.p", {});
    EXPECT_EQ(failed.wait(), TaskEnd::kFailed);
    EXPECT_THAT(failed.problem(), HasSubstr("no points"));
  }
  EXPECT_EQ(runtime.submit("my.p", {}).wait(), TaskEnd::kCompleted);
  EXPECT_EQ(runtime.statistics().returned, 0);
}

TEST_F(RuntimeFiles, AWorkloadOfTwoFilesIsRefusedWhicheverIsWanted) {
  const std::string a = programs("a.yaml", {"my.x"}), b = programs("b.yaml", {"my.x", "my.y"});
  EXPECT_THAT(refusal(options_with({WorkloadFile{a, {"my.x"}}, WorkloadFile{b, {"my.y"}}})),
              AllOf(HasSubstr("my.x"), HasSubstr(a), HasSubstr(b)));
}

}  // namespace
}  // namespace pirt::test
