// Programs as they compute.
#include "workloads/own/program.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <numeric>

#include "tests/workloads/own/files.h"
#include "workloads/inputs/pictures/images.h"
#include "workloads/model/own_operation.h"
#include "workloads/model/player.h"
#include "workloads/own/own.h"

namespace pirt::own {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::AnyOf;
using testing::ElementsAre;
using testing::HasSubstr;

/// A program of sh that adds 1 to nothing: its only output is a list of as many rows as its input
/// has.
constexpr const char* kProgram = R"(import json, mmap, os, sys
def answer(line):
    print(json.dumps(line), flush=True)
hello = json.loads(sys.stdin.readline())
memory = mmap.mmap(os.open(hello["memory"], os.O_RDWR), hello["bytes"])
at = {t["name"]: t for t in hello["tensors"]}
MODE
answer({"ready": True})
for line in sys.stdin:
    asked = json.loads(line)
    if "null" in asked:
        answer({"done": asked["null"]})
        continue
    rows = asked["rows"]["in"]
    for i in range(rows):
        memory[at["out"]["offset"] + i] = memory[at["in"]["offset"] + i] + 1
    CALL
    answer({"done": asked["call"], "rows": {"out": rows}})
)";

class OwnProgramRun : public Files {
 protected:
  Program program(std::string mode, std::string call) {
    std::string text = kProgram;
    text.replace(text.find("MODE"), 4, mode);
    text.replace(text.find("CALL"), 4, call);
    write("p.py", text);
    const TensorSpec list{.name = "in", .element = Element::kU8, .shape = {8}, .varies = true};
    TensorSpec out = list;
    out.name = "out";
    return {.workload = "my.p",
            .command = {"python3", "p.py"},
            .folder = folder_,
            .start_limit = std::chrono::seconds(30),
            .call_limit = std::chrono::milliseconds(700),
            .inputs = {list},
            .outputs = {out}};
  }
  /// @return  What it made of 1, 2, 3.
  std::vector<int> call(Kernel& kernel) {
    kernel.bind(inputs_, outputs_);
    static_cast<void>(kernel.execute(1));
    std::vector<int> made;
    for (const std::uint8_t each : outputs_[0].used<std::uint8_t>()) made.push_back(each);
    return made;
  }
  void bind(const Program& program) {
    inputs_ = make_tensors(program.inputs);
    outputs_ = make_tensors(program.outputs);
    const auto values = inputs_[0].as<std::uint8_t>();
    std::iota(values.begin(), values.end(), std::uint8_t{1});
    inputs_[0].set_rows(3);
  }
  std::string failure(Kernel& kernel) {
    try {
      static_cast<void>(call(kernel));
    } catch (const Error& error) {
      return error.what();
    }
    return "";
  }
  std::vector<Tensor> inputs_, outputs_;
};

TEST_F(OwnProgramRun, ComputesAndIsCounted) {
  const Program good = program("", "pass");
  bind(good);
  const auto kernel = make_program_kernel(good, {}, 1);
  EXPECT_THAT(call(*kernel), ElementsAre(2, 3, 4));
  EXPECT_THAT(call(*kernel), ElementsAre(2, 3, 4));
  ASSERT_EQ(kernel->remarks().size(), 1U);
  EXPECT_THAT(kernel->remarks().front(),
              AllOf(HasSubstr("null call"), HasSubstr("processor time"), HasSubstr("MiB")));
}

TEST_F(OwnProgramRun, MayHaveNoTensors) {
  write("p.py",
        "import json, sys\n"
        "sys.stdin.readline()\n"
        "print(json.dumps({'ready': True}), flush=True)\n"
        "for line in sys.stdin:\n"
        "    asked = json.loads(line)\n"
        "    print(json.dumps({'done': asked.get('call', asked.get('null'))}), flush=True)\n");
  const auto file = write("w.yaml", "workloads:\n  - {name: my.slam, command: [python3, p.py]}\n");
  const Workload slam = to_workload(load(file).front());
  const auto images = generated_images(1);
  const auto frames = make_sequence(slam, {1, images.get()});
  Player player(own_operation(slam)->cpu({}, 1), slam, frames);
  EXPECT_NO_THROW(player.complete());
}

// They are counted where they are made.
TEST_F(OwnProgramRun, ItsMemoryIsWithoutItsTensors) {
  constexpr std::int64_t kMuch = std::int64_t{32} << 20;
  Program reads = program("", "for page in range(0, len(memory), 4096): memory[page]");
  reads.parameters = {{.name = "much", .element = Element::kU8, .shape = {kMuch}}};
  bind(reads);
  const auto kernel = make_program_kernel(reads, make_tensors(reads.parameters), 1);
  static_cast<void>(call(*kernel));
  const auto peak = dynamic_cast<const OtherProcess&>(*kernel).peak_bytes();
  ASSERT_TRUE(peak);
  EXPECT_GT(*peak, 0);
  EXPECT_LT(*peak, kMuch);
}

TEST_F(OwnProgramRun, ThatFailsIsStartedAnew) {
  // It does wrong where no file says that it has done so before.
  const std::string once = "if not os.path.exists('done'):\n        open('done', 'w')\n        ";
  for (const auto& [what, why] : std::vector<std::pair<std::string, std::string>>{
           {"os.abort()", "crashed (SIGABRT)"},
           {"sys.exit(3)", "ended with code 3"},
           {"import time; time.sleep(60)", "did not answer in 0.7 s"},
           {"print('hello', flush=True)", "no JSON object"},
           {"answer({'done': 1000})", "did not answer with"},
           {"answer({'error': 'no points'}); continue", "no points"},
           {"answer({'done': asked['call']}); continue", "did not say in `rows`"},
           {"answer({'done': asked['call'], 'rows': {'out': 9}}); continue", "`rows`"},
           {"os.close(1); import time; time.sleep(60)", "closed its standard output"},
           {"print('{\"do', end='', flush=True); import time; time.sleep(60)",
            "half a line: {\"do"},
           {"os.ftruncate(os.open(hello['memory'], os.O_RDWR), 0)", "ended with code 1"}}) {
    SCOPED_TRACE(what);
    fs::remove(folder_ / "done");
    const Program bad = program("", once + what);
    bind(bad);
    const auto kernel = make_program_kernel(bad, {}, 1);
    EXPECT_THAT(failure(*kernel), AllOf(HasSubstr("my.p"), HasSubstr(why)));
    EXPECT_THAT(call(*kernel), ElementsAre(2, 3, 4));
  }
}

TEST_F(OwnProgramRun, HasItsParametersAlsoWhenItIsStartedAnew) {
  Program spoils = program("",
                           "memory[at['out']['offset']] = memory[at['add']['offset']]\n"
                           "    memory[at['add']['offset']] = 99\n"
                           "    if not os.path.exists('done'):\n"
                           "        open('done', 'w')\n"
                           "        os.abort()");
  spoils.parameters = {{.name = "add", .element = Element::kU8, .shape = {1}}};
  bind(spoils);
  auto parameters = make_tensors(spoils.parameters);
  parameters[0].as<std::uint8_t>()[0] = 7;
  const auto kernel = make_program_kernel(spoils, parameters, 1);
  EXPECT_THAT(failure(*kernel), HasSubstr("crashed"));
  EXPECT_THAT(call(*kernel), ElementsAre(7, 3, 4));
}

/// What of the group is not its first process, in KiB; 0 if there is nothing.
std::int64_t resident_beside_kib(pid_t group) {
  for (const auto& entry : fs::directory_iterator("/proc")) {
    const pid_t other = std::atoi(entry.path().filename().c_str());
    if (other <= 0 || other == group || ::getpgid(other) != group) continue;
    std::ifstream status(entry.path() / "status");
    for (std::string word; status >> word;) {
      std::int64_t kib = 0;
      if (word == "VmRSS:" && status >> kib) return kib;
    }
  }
  return 0;
}

TEST_F(OwnProgramRun, IsWatchedByWhatIsSmall) {
  constexpr std::int64_t kSmallKib = 10 << 10;
  const Tensor much({"much", Element::kU8, {4 * kSmallKib << 10}});
  const Program good = program("open('pid', 'w').write(str(os.getpid()))", "pass");
  bind(good);
  const auto kernel = make_program_kernel(good, {}, 1);
  pid_t group = 0;
  std::ifstream(folder_ / "pid") >> group;
  ASSERT_GT(group, 0);
  // It is a copy of this process for a moment.
  const auto is_small = [group] {
    const std::int64_t kib = resident_beside_kib(group);
    return kib > 0 && kib < kSmallKib;
  };
  for (int i = 0; i < 100 && !is_small(); ++i) ::usleep(20'000);
  EXPECT_TRUE(is_small()) << resident_beside_kib(group) << " KiB beside " << much.count();
}

// Its end is seen all the same, and at once.
TEST_F(OwnProgramRun, ThatCrashesWhereNobodyHearsOfChildrenHasEnded) {
  struct Ignored {
    sighandler_t before = ::signal(SIGCHLD, SIG_IGN);
    Ignored() = default;
    Ignored(const Ignored&) = delete;
    Ignored& operator=(const Ignored&) = delete;
    ~Ignored() { ::signal(SIGCHLD, before); }
  };
  const Ignored ignored;
  const Program bad = program("", "os.abort()");
  bind(bad);
  const auto kernel = make_program_kernel(bad, {}, 1);
  EXPECT_THAT(failure(*kernel), AllOf(HasSubstr("my.p"), HasSubstr("has ended; how is not known")));
}

TEST_F(OwnProgramRun, ThatAnswersUnaskedIsFoundOut) {
  const Program talks = program("", "answer({'done': asked['call'], 'rows': {'out': rows}})");
  bind(talks);
  const auto kernel = make_program_kernel(talks, {}, 1);
  static_cast<void>(call(*kernel));
  // The second answer may come a moment later.
  std::string why;
  for (int i = 0; i < 20 && why.empty(); ++i) why = failure(*kernel);
  EXPECT_THAT(why, AnyOf(HasSubstr("not asked for"), HasSubstr("did not answer with")));
}

/// It was killed; that may take a moment, and whoever adopted it may not reap it.
bool is_gone_soon(pid_t child) {
  const auto is_there = [child] {
    char state = 'Z';
    std::string number, name;
    std::ifstream stat("/proc/" + std::to_string(child) + "/stat");
    return bool(stat >> number >> name >> state) && state != 'Z';
  };
  for (int i = 0; i < 200 && is_there(); ++i) ::usleep(50'000);
  return !is_there();
}

// A worker is killed with SIGKILL where its time is over: no destructor runs.
TEST_F(OwnProgramRun, TakesWhatItStartedWithItWhenThisProcessIsKilled) {
  const Program lives = program("",
                                "import subprocess\n"
                                "    child = subprocess.Popen(['sleep', '1000'])\n"
                                "    open('child', 'w').write(str(child.pid))");
  bind(lives);
  const pid_t worker = ::fork();
  if (worker == 0) {
    const auto kernel = make_program_kernel(lives, {}, 1);
    static_cast<void>(failure(*kernel));
    ::raise(SIGKILL);
  }
  ASSERT_EQ(::waitpid(worker, nullptr, 0), worker);
  pid_t child = 0;
  std::ifstream(folder_ / "child") >> child;
  ASSERT_GT(child, 0);
  EXPECT_TRUE(is_gone_soon(child));
}

TEST_F(OwnProgramRun, TakesWhatItStartedWithIt) {
  const Program leaves = program("",
                                 "import subprocess\n"
                                 "    child = subprocess.Popen(['sleep', '1000'])\n"
                                 "    open('child', 'w').write(str(child.pid))\n"
                                 "    sys.exit(3)");
  bind(leaves);
  {
    const auto kernel = make_program_kernel(leaves, {}, 1);
    EXPECT_THAT(failure(*kernel), HasSubstr("ended with code 3"));
  }
  pid_t child = 0;
  std::ifstream(folder_ / "child") >> child;
  ASSERT_GT(child, 0);
  EXPECT_TRUE(is_gone_soon(child));
}

TEST_F(OwnProgramRun, CountsTheProcessorTimeOfItsThreads) {
  const Program busy = program("",
                               "import threading, hashlib\n"
                               "    work = lambda: hashlib.sha256(bytes(50_000_000)).digest()\n"
                               "    thread = threading.Thread(target=work)\n"
                               "    thread.start()\n"
                               "    thread.join()");
  Program patient = busy;
  patient.call_limit = std::chrono::seconds(60);
  bind(patient);
  const auto kernel = make_program_kernel(patient, {}, 1);
  static_cast<void>(call(*kernel));
  const std::string text = kernel->remarks().front();
  const auto at = text.find("us, ");
  ASSERT_NE(at, std::string::npos);
  EXPECT_GT(std::stod(text.substr(at + 4)), 5) << text;  // 50 MB take tens of milliseconds.
}

TEST_F(OwnProgramRun, ThatDoesNotGetReadySaysWhy) {
  const auto why_not = [this](const Program& program) -> std::string {
    bind(program);
    try {
      static_cast<void>(make_program_kernel(program, {}, 1));
    } catch (const Error& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_THAT(why_not(program("answer({'error': 'no license'})", "pass")), HasSubstr("no license"));
  EXPECT_THAT(why_not(program("answer({'hello': 1})", "pass")), HasSubstr("`ready`"));
  EXPECT_THAT(why_not(program("sys.exit(1)", "pass")), HasSubstr("ended with code 1"));
  Program slow = program("import time; time.sleep(60)", "pass");
  slow.start_limit = std::chrono::milliseconds(300);
  EXPECT_THAT(why_not(slow), HasSubstr("did not answer in 0.3 s"));
  Program none = program("", "pass");
  none.command = {"no-such-program"};
  EXPECT_THAT(why_not(none), HasSubstr("cannot be started"));
}

}  // namespace
}  // namespace pirt::own
