// Modules and workload files as they are loaded, and programs as they compute.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <numeric>

#include "tests/support/errors.h"
#include "tests/support/paths.h"
#include "workloads/inputs/pictures/images.h"
#include "workloads/model/player.h"
#include "workloads/own/own.h"
#include "workloads/own/program.h"
#include "workloads/vision/vision.h"

namespace pirt::own {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;

class Files : public testing::Test {
 protected:
  Files() {
    std::string name = (fs::temp_directory_path() / "pirt-own-XXXXXX").string();
    folder_ = ::mkdtemp(name.data());
  }
  ~Files() override { fs::remove_all(folder_); }
  fs::path write(const std::string& name, const std::string& text) const {
    std::ofstream(folder_ / name) << text;
    return folder_ / name;
  }
  fs::path folder_;
};
using OwnModule = Files;
using WorkloadFile = Files;
using OwnProgram = Files;

Workload find(const std::vector<Definition>& all, const std::string& name) {
  const auto found = std::ranges::find(all, name, &Definition::name);
  EXPECT_NE(found, all.end()) << name;
  return to_workload(*found);
}

/// What its kernel of the host's cores makes of the frames of its sequence, held against its
/// reference.
Verdict play(const Workload& workload) {
  const auto images = generated_images(1);
  const auto frames = make_sequence(workload, {1, images.get()});
  Player player(own_operation(workload)->cpu(frames.front().parameters, 2), workload, frames);
  player.scribble();
  player.complete();
  return verify_sequence(workload, player.played(reference_of(workload, frames)));
}

TEST_F(OwnModule, ComputesWhatPirtsOwnDoes) {
  const auto all = load(test::kExampleModule);
  ASSERT_EQ(all.size(), 1U);
  Workload sobel = find(all, "mine.sobel").at_size(160, 120);
  EXPECT_FALSE(sobel.reference);
  sobel.reference = vision::make_sobel(160, 120).reference;
  EXPECT_TRUE(play(sobel).ok);
}

TEST_F(OwnModule, HasStatesListsAndSizes) {
  const auto all = load(test::kHostileModule);
  const Workload sum = find(all, "bad.sum");
  ASSERT_TRUE(sum.state);
  EXPECT_EQ(sum.frames, 4);
  EXPECT_TRUE(play(sum).ok);
  const Workload list = find(all, "bad.list");
  EXPECT_TRUE(list.outputs.front().varies);
  EXPECT_TRUE(play(list).ok);
  EXPECT_FALSE(play(find(all, "bad.wrong")).ok);
  for (const char* name : {"bad.throws", "bad.throws_5", "bad.too_many"}) {
    EXPECT_THROW(static_cast<void>(play(find(all, name))), Error) << name;
  }
}

TEST_F(OwnModule, OfVersion1IsLoadedForEver) {
#ifndef __x86_64__
  GTEST_SKIP() << "the binary that is kept is of x86-64";
#endif
  const auto file = fs::path(test::kSourceFolder) / "tests/workloads/own/module_v1_x86_64.so";
  EXPECT_TRUE(play(find(load(file), "v1.add")).ok);
}

TEST_F(OwnModule, IsRefusedByName) {
  EXPECT_THAT(test::bad_input([&] { static_cast<void>(load(folder_ / "none.so")); }),
              HasSubstr("none.so"));
  // A library that is none, and one that is cut off.
  const auto other = std::string(test::kNvmlStandIn);
  EXPECT_THROW(static_cast<void>(load(other)), Error);
  std::ifstream in(test::kExampleModule, std::ios::binary);
  std::string bytes(std::istreambuf_iterator<char>(in), {});
  bytes.resize(bytes.size() / 2);
  EXPECT_THROW(static_cast<void>(load(write("half.so", bytes))), Error);
}

TEST_F(WorkloadFile, NamesThePlaceOfWhatIsWrong) {
  const auto refused = [this](const std::string& text, const std::string& why) {
    const auto file = write("w.yaml", text);
    EXPECT_THAT(test::bad_input([&] { static_cast<void>(load(file)); }),
                AllOf(HasSubstr("w.yaml"), HasSubstr(why)));
  };
  write("k.cl", "__kernel void k(__global uchar* a) { a[0] = 1; }");
  const std::string head = "workloads:\n  - name: my.k\n    outputs: {a: \"u8[4]\"}\n";
  refused("workloads: []", "no workload");
  refused("kernels: []", "kernels");
  refused(head, "one of: opencl, network, command");
  refused(head + "    colour: red\n", "colour");
  refused(head + "    opencl: {source: none.cl, kernel: k, global: [4], args: [a]}\n", "none.cl");
  refused(head + "    opencl: {source: k.cl, kernel: k, global: [4], args: [b]}\n",
          "did you mean a");
  refused(head + "    opencl: {source: k.cl, kernel: k, global: [0], args: [a]}\n", "global");
  refused(head + "    opencl: {source: k.cl, kernel: k, global: [width], args: [{u7: 1}]}\n",
          "u8: 128");
  refused(head + "    command: []\n", "words of a command");
  refused("workloads:\n  - {name: k, outputs: {a: \"u8[4]\"}, command: [a]}", "needs a dot");
  refused("workloads:\n  - {name: my.k, outputs: {a: \"u9[4]\"}, command: [a]}", "no tensor");
  refused("workloads:\n  - {name: my.k, outputs: {a: \"u8[width]\"}, command: [a]}",
          "size of its own");
  refused("workloads:\n  - {name: my.k, network: none.onnx, inputs: {a: \"f32[1,3,8,8]\"}}",
          "none.onnx");
  refused("workloads:\n  - {module: k.cl}", "k.cl");
  refused(
      head + "    command: [a]\n  - name: my.k\n    outputs: {a: \"u8[4]\"}\n    command: [a]\n",
      "two workloads");
}

TEST_F(WorkloadFile, TakesWhatASourceIncludes) {
  const auto file = write("w.yaml",
                          "workloads:\n  - name: my.k\n    outputs: {a: \"u8[4]\"}\n"
                          "    opencl: {source: k.cl, kernel: k, global: [4], args: [a]}\n");
  write("k.cl", "#include \"ten.h\"\n__kernel void k(__global uchar* a) { a[0] = TEN; }\n");
  EXPECT_THAT(test::bad_input([&] { static_cast<void>(load(file)); }), HasSubstr("ten.h"));
  write("ten.h", "#define TEN 10\n");
  const auto all = load(file);
  const Workload made = find(all, "my.k");
  EXPECT_THAT(own_operation(made)->opencl->text,
              AllOf(HasSubstr("#define TEN 10"), testing::Not(HasSubstr("ten.h"))));
  write("ten.h", "#define TEN 11\n");
  EXPECT_NE(digest_of(file), all.front().digest);
  write("ten.h", "#include \"ten.h\"\n");
  EXPECT_THAT(test::bad_input([&] { static_cast<void>(load(file)); }),
              HasSubstr("includes itself"));
}

TEST_F(WorkloadFile, ItsDigestIsOfWhatItNamesToo) {
  const auto file = write("w.yaml",
                          "workloads:\n  - name: my.k\n    outputs: {a: \"u8[4]\"}\n"
                          "    command: [cat, p.py]\n");
  write("p.py", "1");
  const std::string before = digest_of(file);
  EXPECT_EQ(load(file).front().digest, before);
  write("p.py", "2");
  EXPECT_NE(digest_of(file), before);
}

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

TEST_F(OwnProgramRun, ThatFailsIsStartedAnew) {
  // It does wrong where no file says that it has done so before.
  const std::string once = "if not os.path.exists('done'):\n        open('done', 'w')\n        ";
  for (const auto& [what, why] : std::vector<std::pair<std::string, std::string>>{
           {"os.abort()", "crashed"},
           {"sys.exit(3)", "ended with code 3"},
           {"import time; time.sleep(60)", "did not answer in 0.7 s"},
           {"print('hello', flush=True)", "no JSON object"},
           {"answer({'done': 1000})", "did not answer with"},
           {"answer({'error': 'no points'}); continue", "no points"},
           {"answer({'done': asked['call']}); continue", "did not say in `rows`"},
           {"answer({'done': asked['call'], 'rows': {'out': 9}}); continue", "`rows`"},
           {"os.close(1); import time; time.sleep(60)", "closed its standard output"}}) {
    SCOPED_TRACE(what);
    fs::remove(folder_ / "done");
    const Program bad = program("", once + what);
    bind(bad);
    const auto kernel = make_program_kernel(bad, {}, 1);
    EXPECT_THAT(failure(*kernel), AllOf(HasSubstr("my.p"), HasSubstr(why)));
    EXPECT_THAT(call(*kernel), ElementsAre(2, 3, 4));
  }
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
