// Modules and workload files as they are loaded.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <limits>
#include <map>
#include <stop_token>

#include "tests/support/errors.h"
#include "tests/support/paths.h"
#include "tests/workloads/own/files.h"
#include "workloads/base/text/printable.h"
#include "workloads/base/text/text.h"
#include "workloads/inputs/pictures/images.h"
#include "workloads/model/player.h"
#include "workloads/model/slices.h"
#include "workloads/own/own.h"
#include "workloads/vision/vision.h"

namespace pirt::own {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::HasSubstr;

using OwnModule = Files;
using WorkloadFile = Files;

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

}  // namespace
}  // namespace pirt::own
