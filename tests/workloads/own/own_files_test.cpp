// Modules and workload files as they are loaded, and programs as they compute.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <limits>
#include <map>
#include <numeric>
#include <stop_token>

#include "tests/support/errors.h"
#include "tests/support/paths.h"
#include "workloads/base/text/printable.h"
#include "workloads/base/text/text.h"
#include "workloads/inputs/pictures/images.h"
#include "workloads/model/player.h"
#include "workloads/model/slices.h"
#include "workloads/own/own.h"
#include "workloads/own/program.h"
#include "workloads/vision/vision.h"

namespace pirt::own {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::AnyOf;
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

TEST_F(OwnModule, IsToldWhatItsCallHasNot) {
  const auto why = [all = load(test::kHostileModule)](const char* name) -> std::string {
    try {
      static_cast<void>(play(find(all, name)));
    } catch (const Error& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_THAT(why("bad.asks_parameter"), HasSubstr("the constructor of cpu_class<K>()"));
  EXPECT_THAT(why("bad.asks_state"), HasSubstr("has no state"));
}

TEST_F(OwnModule, WhatItIsLinkedWithIsAPartOfItsDigest) {
  // Its C library, as if it were its own: nothing of it is loaded.
  const fs::path module = folder_ / "libmine.so";
  fs::copy_file(test::kHostileModule, module);
  const std::string alone = digest_of(module);
  EXPECT_EQ(alone, digest_of(test::kHostileModule)) << "wherever it lies";
  write("libother.so", "not linked");
  EXPECT_EQ(digest_of(module), alone);
  write("libc.so.6", "one");
  const std::string before = digest_of(module);
  EXPECT_NE(before, alone);
  const auto file = write("w.yaml", "workloads:\n  - {module: libmine.so}\n");
  const std::string of_file = digest_of(file);
  write("libc.so.6", "another");
  EXPECT_NE(digest_of(module), before);
  EXPECT_NE(digest_of(file), of_file);
}

TEST_F(OwnModule, HearsByACopyOfItsCallThatItIsStopped) {
  const Workload waits = find(load(test::kHostileModule), "bad.waits_by_a_copy");
  const auto kernel = own_operation(waits)->cpu({}, 1);
  const auto inputs = make_tensors(waits.inputs);
  auto outputs = make_tensors(waits.outputs);
  std::stop_source stop;
  stop.request_stop();
  tell_stop_of_call(&stop);
  kernel->bind(inputs, outputs);
  EXPECT_NO_THROW(static_cast<void>(kernel->execute(1)));
  tell_stop_of_call(nullptr);
}

TEST_F(OwnModule, LeavesArithmeticAsItWas) {
  static_cast<void>(load(test::kHostileModule));
  const volatile double least = std::numeric_limits<double>::min();
  EXPECT_NE(least / 2, 0.0);
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

TEST_F(OwnModule, IsRefusedWhateverItsTableSays) {
  const auto says = [](const std::string& what) {
    ::setenv("PIRT_TEST_SPOIL", what.c_str(), 1);
    std::string why = "nothing";
    try {
      const auto all = load(test::kSpoiltModule);
      if (what == "LIST") return all.front().description;
      for (const Definition& each : all) static_cast<void>(to_workload(each));
    } catch (const Error& error) {
      why = error.code() == ErrorCode::kBadInput ? error.what() : "of the environment";
    }
    ::unsetenv("PIRT_TEST_SPOIL");
    return why;
  };
  EXPECT_NO_THROW(static_cast<void>(to_workload(load(test::kSpoiltModule).front())));
  // Where the message is to say more than whose table it is.
  const std::map<std::string, std::string> part = {{"argument unknown", "did you mean out"},
                                                   {"argument broken", "0.5 is no u8"},
                                                   {"frames many", "2147483647 frames"},
                                                   {"name blank", "letters, digits"},
                                                   {"range beyond", "0 to 256"},
                                                   {"sequence large", "10000 frames"},
                                                   {"size overflows", "bytes"},
                                                   {"workload huge", "4294967288 bytes"}};
  std::string list = says("LIST");
  ASSERT_NE(list, "nothing");
  std::size_t known = 0;
  for (std::size_t at = 0; (at = list.find("\\n", at)) != std::string::npos;) {
    list.replace(at, 2, "\n");
  }
  for (const std::string& what : split(list, '\n')) {
    if (what.empty()) continue;
    SCOPED_TRACE(what);
    const std::string why = says(what);
    EXPECT_THAT(why, HasSubstr("spoilt_module"));
    EXPECT_EQ(find_unprintable(why).has_value(), false);
    if (const auto more = part.find(what); more != part.end()) {
      ++known;
      EXPECT_THAT(why, HasSubstr(more->second));
    }
  }
  EXPECT_EQ(known, part.size());
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
  refused("workloads:\n  - {module: k.cl, modul: k.cl}", "did you mean module");
  const std::string args = "    opencl: {source: k.cl, kernel: k, global: [4], args: ";
  refused(head + args + "[{u8: 256}]}\n", "256 is no u8");
  refused(head + args + "[{i32: 0.5}]}\n", "0.5 is no i32");
  refused(head + args + "[{u8: 1}]}\n", "not given output 'a'");
  refused(head + "    state: {s: \"u8[4]\"}\n" + args + "[a, s]}\n", "'next s'");
  refused(head + args + "a}\n", "must be a list");
  refused(head + args + "[[a]]}\n", "args[0]");
  refused(head + "    opencl: {source: k.cl, kernel: k, global: [width], args: [a]}\n",
          "no size of its own");
  refused(head + "    opencl: {source: k.cl, kernel: k, global: [4], local: [width], args: [a]}\n",
          "no local size");
  refused(head + "    opencl: {source: ., kernel: k, global: [4], args: [a]}\n", "no file");
  refused(head + "    opencl: 5\n", "must be a map");
  refused(head + "    opencl: {source: k.cl}\n", "missing key 'kernel'");
  refused(head + "    command: python3 p.py\n", "must be a list");
  refused(head + "    command: [a]\n    config: net.cfg\n", "is of workloads with `network`");
  refused(head + "    network: n.onnx\n    call_limit_ms: 5\n", "is of workloads with `command`");
  refused(head + "    network: n.onnx\n    writes: [a]\n", "is of workloads with `command`");
  refused(head + "    command: [a]\n    writes: a.log\n", "must be a list");
  refused(head + "    command: [a]\n    call_limit_ms: 0\n", "call_limit_ms");
  refused(head + "    command: [a]\n    limit_s: 0.5\n", "limit_s");
  refused(head + "    command: [a]\n    frames: many\n", "frames");
  refused(head + "    command: [a]\n    tolerance: .nan\n", "tolerance");
  refused(head + "    command: [a]\n    inputs: {b: {tensor: \"u8[4]\", range: [0, 300]}}\n",
          "0 to 300");
  refused(head + "    command: [a]\n    inputs: {b: {tensor: \"u8[4]\", range: [0]}}\n",
          "two numbers");
  refused(head + "    command: [a]\n    inputs: {b: {tensr: \"u8[4]\"}}\n", "tensor");
  refused(head + "    command: [a]\n    inputs: [b]\n", "must be a map");
  refused(head + "    command: [a]\n    name: my.l\n", "given twice");
  refused(
      head + "    command: [a]\n  - name: my.k\n    outputs: {a: \"u8[4]\"}\n    command: [a]\n",
      "two workloads");
}

TEST_F(WorkloadFile, IsAFile) {
  for (const fs::path& none : {folder_, fs::path("/dev/zero")}) {
    EXPECT_THAT(test::bad_input([&] { static_cast<void>(load(none)); }), HasSubstr("no file"));
    EXPECT_THAT(test::bad_input([&] { static_cast<void>(digest_of(none)); }), HasSubstr("no file"));
  }
}

TEST_F(WorkloadFile, SaysWhatMeasuringMayTake) {
  const auto limit = [this](const std::string& more) {
    return load(write("w.yaml", "workloads:\n  - name: my.k\n    outputs: {a: \"u8[4]\"}\n" + more))
        .front()
        .limit;
  };
  EXPECT_EQ(limit("    command: [a]\n"), std::chrono::seconds(120 + 60 + 10));
  EXPECT_EQ(limit("    command: [a]\n    limit_s: 300\n    start_limit_ms: 500\n"),
            std::chrono::milliseconds(300'000 + 500 + 10'000));
  const auto module = load(write("m.yaml", std::string("workloads:\n  - {module: ") +
                                               test::kExampleModule + ", limit_s: 7}\n"));
  EXPECT_EQ(module.front().limit, std::chrono::seconds(7));
  EXPECT_EQ(own_operation(to_workload(definition_from(to_json(module.front()))))->limit,
            std::chrono::seconds(7));
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
              AllOf(HasSubstr("#define TEN 10"), testing::Not(HasSubstr("include"))));
  write("ten.h", "#define TEN 11\n");
  EXPECT_NE(digest_of(file), all.front().digest);
  write("ten.h", "#include \"ten.h\"\n");
  EXPECT_THAT(test::bad_input([&] { static_cast<void>(load(file)); }),
              HasSubstr("includes itself"));
}

TEST_F(WorkloadFile, TakesIncludesAsAPreprocessorDoes) {
  const auto file = write("w.yaml",
                          "workloads:\n  - name: my.k\n    outputs: {a: \"u8[4]\"}\n"
                          "    opencl: {source: k.cl, kernel: k, global: [4], args: [a]}\n");
  write("k.cl",
        "#include \"a.h\"\n#ifdef FAST\n  # include \"fast.h\"\n#endif\n#include \"b.h\"\n"
        "__kernel void k(__global uchar* a) { a[0] = 1; }\n");
  write("a.h", "#include \"c.h\"\n");
  write("b.h", "#include \"c.h\"\n");
  write("c.h", "#pragma once\ntypedef struct { int i; } Index;\n");
  write("fast.h", "#define FAST_ONE 1\n");
  const Workload made = find(load(file), "my.k");
  const std::string text = own_operation(made)->opencl->text;
  EXPECT_THAT(text, AllOf(HasSubstr("#line 1 \"fast.h\"\n#define FAST_ONE 1\n"),
                          HasSubstr("#line 4 \"k.cl\"\n#endif\n"),
                          HasSubstr("#line 6 \"k.cl\"\n__kernel void k"),
                          testing::Not(HasSubstr("include"))));
  // The third of the files, in both places.
  const std::string guard = "#ifndef PIRT_ONCE_2\n#define PIRT_ONCE_2\n#line 1 \"c.h\"\n";
  EXPECT_THAT(text, HasSubstr(guard));
  EXPECT_NE(text.find(guard), text.rfind(guard));
  const std::string before = digest_of(file);
  write("fast.h", "#define FAST_ONE 2\n");
  EXPECT_NE(digest_of(file), before);
}

TEST_F(WorkloadFile, MayNameManySources) {
  write("k.cl", "__kernel void k(__global uchar* a) { a[0] = 1; }\n");
  std::string text = "workloads:\n";
  for (int i = 0; i <= 100; ++i) {
    text += "  - name: my.k" + std::to_string(i) +
            "\n    outputs: {a: \"u8[4]\"}\n"
            "    opencl: {source: k.cl, kernel: k, global: [4], args: [a]}\n";
  }
  EXPECT_NO_THROW(static_cast<void>(digest_of(write("w.yaml", text))));
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
  // As a shell has it, and by its option.
  for (const char* command : {"[sh, -c, \"exec cat <p.py\"]", "[cat, --model=p.py]"}) {
    const auto other =
        write("v.yaml", std::string("workloads:\n  - name: my.k\n    outputs: {a: \"u8[4]\"}\n"
                                    "    command: ") +
                            command + "\n");
    write("p.py", "3");
    const std::string of_3 = digest_of(other);
    write("p.py", "4");
    EXPECT_NE(digest_of(other), of_3) << command;
  }
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
