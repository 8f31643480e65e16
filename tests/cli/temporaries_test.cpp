// What commands write goes with them, whatever ends them; what a killed one left, the next removes.
#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include "tests/cli/program.h"

namespace pirt::test {
namespace {

using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;

class Temporaries : public testing::Test {
 protected:
  /// Runs the program in `out/`, sends it @p signal once a file that it has open there is like
  /// @p open, and waits.
  [[nodiscard]] Outcome with_signal(const std::string& arguments, const std::string& signal,
                                    const std::string& open) const {
    std::filesystem::create_directories(folder());
    // A shell's background ignores SIGINT.
    return run(
        "cd " + quoted(folder()) + "; env --default-signal " + quoted(kProgram) + " " + arguments +
        " & pid=$!; until ls -l /proc/$pid/fd | grep -q " + quoted(folder() + "/" + open) +
        "; do kill -0 $pid || exit 99; sleep 0.01; done; kill -" + signal + " $pid; wait $pid");
  }
  [[nodiscard]] std::string folder() const {
    return (std::filesystem::canonical(scratch_.file("")) / "out").string();
  }
  [[nodiscard]] std::vector<std::string> names() const {
    std::vector<std::string> found;
    for (const auto& entry : std::filesystem::directory_iterator(folder())) {
      found.push_back(entry.path().filename());
    }
    return found;
  }

  const std::string long_run_ =
      "schedule --mode ect --platform ../b.yaml --mix ../m.yaml --duration 300h --trace o.tr";
  const std::string short_scene_ = "generate --duration 2s --rate 5 --width 64 --height 64 seq";
  const std::string long_scene_ = "generate --duration 600s --threads 1 seq";
  const Scratch scratch_;
};

TEST_F(Temporaries, OfATraceGoWithASignal) {
  const int nameless = ::open(scratch_.file("").c_str(), O_TMPFILE | O_RDWR, 0600);
  if (nameless < 0) GTEST_SKIP() << "the file system has no files without a name";
  ::close(nameless);
  scratch_.write("b.yaml",
                 "platform: b\nunits: {cpu: {slots: 1, active_w: 1}}\nworkloads:\n"
                 "  sobel: {cpu: [{on: cpu, ms: 0.1}]}\n");
  scratch_.write("m.yaml", "mix: m\npipelines: {p: {rate_hz: 1000, tasks: [{workload: sobel}]}}\n");
  for (const auto* signal : {"TERM", "INT", "KILL"}) {
    const auto outcome = with_signal(long_run_, signal, "#.*(deleted)");
    EXPECT_GT(outcome.exit_code, 128) << signal << outcome.err;
    EXPECT_THAT(names(), IsEmpty()) << signal;
  }
}

TEST_F(Temporaries, OfAKilledGenerateGoWithTheNext) {
  EXPECT_GT(with_signal(long_scene_, "KILL", "seq.pirt-tmp-").exit_code, 128);
  EXPECT_THAT(names(), SizeIs(1));
  const auto next = run("cd " + quoted(folder()) + "; " + quoted(kProgram) + " " + short_scene_);
  EXPECT_EQ(next.exit_code, 0) << next.err;
  EXPECT_THAT(names(), ElementsAre("seq"));
}

TEST_F(Temporaries, GenerateEndsInGoodOrderWhenAsked) {
  for (const auto* signal : {"INT", "TERM", "HUP"}) {
    const auto outcome = with_signal(long_scene_, signal, "seq.pirt-tmp-");
    EXPECT_EQ(outcome.exit_code, 4) << signal;
    EXPECT_THAT(outcome.err, AllOf(HasSubstr("interrupted"), HasSubstr("seq"))) << signal;
    EXPECT_EQ(outcome.out, "") << signal;
    EXPECT_THAT(names(), IsEmpty()) << signal;
  }
}

TEST_F(Temporaries, OfFilesThatOthersNameSoStay) {
  std::filesystem::create_directories(folder());
  std::ofstream(folder() + "/o.json.tmp7") << "mine";
  EXPECT_EQ(pirt({"list", "mixes", "--json", folder() + "/o.json"}).exit_code, 0);
  EXPECT_THAT(names(), SizeIs(2));
}

}  // namespace
}  // namespace pirt::test
