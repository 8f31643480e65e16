// Strict YAML: what is refused, where it says it is, and what it recommends.
#include "workloads/base/text/yaml.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <gmock/gmock.h>

#include "tests/support/errors.h"

namespace pirt::test {
namespace {

using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::StartsWith;

YamlNode parse(const std::string& text) { return parse_yaml("f.yaml", text); }
std::string refused_text(const std::string& text) {
  return bad_input([&] { static_cast<void>(parse(text)); });
}

TEST(Yaml, ReadsScalarsMapsAndLists) {
  const auto node = parse("a: {b: [1, -2.5e3, true, text, \"7\"]}\nc: x\n");
  EXPECT_THAT(node.keys(), ElementsAre("a", "c"));
  EXPECT_TRUE(node.has("c"));
  EXPECT_FALSE(node.has("d"));
  const auto items = node.at("a").at("b").items();
  ASSERT_EQ(items.size(), 5U);
  EXPECT_EQ(items[0].integer(0, 1), 1);
  EXPECT_EQ(items[1].number(-1e4, 0), -2500);
  EXPECT_TRUE(items[2].boolean());
  EXPECT_EQ(items[3].text(), "text");
  EXPECT_EQ(items[4].text(), "7");
  EXPECT_EQ(items[4].path(), "a.b[4]");
}

TEST(Yaml, SaysFileAndLineOfBrokenSyntax) {
  EXPECT_THAT(refused_text("a: 1\nb: [1, }\n"), StartsWith("f.yaml:2: not valid YAML"));
  EXPECT_THAT(refused_text("a:\n  b: 1\n c: 2\n"), StartsWith("f.yaml:3: not valid YAML"));
  EXPECT_THAT(refused_text("a: *nothing\n"), StartsWith("f.yaml:1: not valid YAML"));
}

TEST(Yaml, RefusesDocumentsThatAreNotOne) {
  EXPECT_THAT(refused_text(""), StartsWith("f.yaml:1: the document is empty"));
  EXPECT_THAT(refused_text("# only a comment\n"), HasSubstr("empty"));
  EXPECT_THAT(refused_text("---\n"), HasSubstr("empty"));
  EXPECT_THAT(refused_text("a: 1\n---\nb: 2\n"),
              AllOf(HasSubstr(":3:"), HasSubstr("more than one document"),
                    HasSubstr("files of their own")));
  EXPECT_THAT(refused_text(std::string("a: \0b", 5)), HasSubstr("f.yaml:1: not a text file"));
}

TEST(Yaml, NamesTheNearestKey) {
  const auto node = parse("one: 1\nslotz: 2\n");
  EXPECT_EQ(bad_input([&] {
              node.check_keys({"one", "slots"});
            }),
            "f.yaml:2: slotz: unknown key (did you mean slots?)");
  EXPECT_EQ(bad_input([&] { static_cast<void>(node.at("two")); }), "f.yaml:1: missing key 'two'");
}

TEST(Yaml, RefusesAKeyGivenTwice) {
  const auto node = parse("u:\n  a: 1\n  b: 2\n  a: 3\n");
  EXPECT_EQ(bad_input([&] { static_cast<void>(node.at("u").keys()); }),
            "f.yaml:4: u.a: given twice");
  EXPECT_THAT(bad_input([] { static_cast<void>(parse("? [a]\n: 1\n").keys()); }),
              HasSubstr("plain text"));
}

TEST(Yaml, RefusesNumbersThatAreNot) {
  for (const char* text : {"nan", ".nan", "inf", "-.inf", "1e999", "1e-999", "0x10", "0o10", "010",
                           "+1", "1_000", "1.5.2", "two"}) {
    const auto node = parse(std::string("v: ") + text);
    EXPECT_THAT(bad_input([&] { static_cast<void>(node.at("v").number(-1e300, 1e300)); }),
                StartsWith("f.yaml:1: v: must be a finite number in decimal notation, got"))
        << text;
    EXPECT_THAT(bad_input([&] { static_cast<void>(node.at("v").milliseconds(0)); }),
                StartsWith("f.yaml:1: v: must be a finite number in decimal notation, got"))
        << text;
    EXPECT_THAT(bad_input([&] { static_cast<void>(node.at("v").integer(-9, 9)); }),
                HasSubstr("whole number"))
        << text;
  }
  for (const char* text : {"''", "'3'", "[3]", "{a: 3}", "~"}) {
    const auto node = parse(std::string("v: ") + text);
    EXPECT_THAT(bad_input([&] { static_cast<void>(node.at("v").number(-1e300, 1e300)); }),
                StartsWith("f.yaml:1: v: must be a number"))
        << text;
    EXPECT_THAT(bad_input([&] { static_cast<void>(node.at("v").integer(-9, 9)); }),
                StartsWith("f.yaml:1: v: must be a number"))
        << text;
  }
  EXPECT_THAT(bad_input([] { static_cast<void>(parse("v: 1.0").at("v").integer(0, 9)); }),
              HasSubstr("whole number"));
  EXPECT_THAT(
      bad_input([] { static_cast<void>(parse("v: 99999999999999999999").at("v").integer(0, 9)); }),
      HasSubstr("between 0 and 9"));
}

TEST(Yaml, ReadsTimesAndRoundsNoneToZero) {
  const auto node = parse("a: 0\nb: 1e-6\nc: 1e-7\nd: 1.1e9");
  EXPECT_EQ(node.at("a").milliseconds(0), Nanos(0));
  EXPECT_EQ(node.at("b").milliseconds(kNanosecondMs), Nanos(1));
  EXPECT_EQ(bad_input([&] { static_cast<void>(node.at("c").milliseconds(0)); }),
            "f.yaml:3: c: must be 0 or at least 1e-06 (a nanosecond), got 1e-7");
  EXPECT_THAT(bad_input([&] { static_cast<void>(node.at("a").milliseconds(kNanosecondMs)); }),
              HasSubstr("f.yaml:1: a: must be between"));
  EXPECT_THAT(bad_input([&] { static_cast<void>(node.at("d").milliseconds(0)); }),
              HasSubstr("f.yaml:4: d: must be between"));
}

TEST(Yaml, RefusesBytesThatAreNoTextAtTheirLine) {
  EXPECT_EQ(refused_text("a: 1\nb: caf\xe9\n"),
            "f.yaml:2: not a text file: the byte \\xe9, which is not UTF-8");
  EXPECT_EQ(refused_text("a: 1\n# \x1b[31m\n"),
            "f.yaml:2: not a text file: the control character \\x1b");
  EXPECT_THAT(refused_text("a: \x7f"), HasSubstr("f.yaml:1: not a text file"));
  EXPECT_THAT(refused_text("a: \u009b"), HasSubstr("f.yaml:1: not a text file"));
  // Written as escapes of YAML's own.
  EXPECT_EQ(refused_text("a: 1\nb: [\"x\\x1b\"]\n"),
            "f.yaml:2: the text has the control character \\x1b");
  EXPECT_THAT(refused_text("\"k\\N\": 1"), HasSubstr("f.yaml:1: the text has the"));
  EXPECT_EQ(parse("a: Π-RT µ 日本語\n").at("a").text(), "Π-RT µ 日本語");
}

TEST(Yaml, TellsALineOfTextFromAParagraph) {
  const auto node = parse("a: \"x\\ny\"\nb: \"x\\ty\"\nc: |\n  one\n  two\n\n  three\n");
  EXPECT_EQ(bad_input([&] { static_cast<void>(node.at("a").text()); }),
            "f.yaml:1: a: must be one line of text, without tabs");
  EXPECT_THAT(bad_input([&] { static_cast<void>(node.at("b").text()); }), HasSubstr("one line"));
  EXPECT_EQ(node.at("a").paragraph(), "x y");
  EXPECT_EQ(node.at("c").paragraph(), "one two three");
  EXPECT_THAT(bad_input([] { static_cast<void>(parse("\"a\\nb\": 1").keys()); }),
              HasSubstr("f.yaml:1: a key must be one line"));
}

TEST(Yaml, SaysTheRangeThatAValueIsOutOf) {
  const auto node = parse("a: -1\nb: 5000");
  EXPECT_EQ(bad_input([&] { static_cast<void>(node.at("a").number(0, 2.5)); }),
            "f.yaml:1: a: must be between 0 and 2.5, got -1");
  EXPECT_EQ(bad_input([&] { static_cast<void>(node.at("b").integer(1, 64)); }),
            "f.yaml:2: b: must be between 1 and 64, got 5000");
}

TEST(Yaml, SaysWhichTypeItWants) {
  const auto node = parse("m: {a: 1}\nl: [1]\nt: yes\nn:\n");
  EXPECT_EQ(bad_input([&] { static_cast<void>(node.at("m").text()); }),
            "f.yaml:1: m: must be text, is a map");
  EXPECT_THAT(bad_input([&] { static_cast<void>(node.at("m").items()); }),
              HasSubstr("must be a list, is a map"));
  EXPECT_THAT(bad_input([&] { static_cast<void>(node.at("l").keys()); }),
              HasSubstr("must be a map, is a list"));
  EXPECT_THAT(bad_input([&] { static_cast<void>(node.at("t").boolean()); }),
              HasSubstr("must be true or false, got 'yes'"));
  EXPECT_THAT(bad_input([&] { static_cast<void>(node.at("n").text()); }), HasSubstr("is empty"));
  EXPECT_THAT(bad_input([&] { static_cast<void>(node.at("t").at("x")); }),
              HasSubstr("must be a map, is a value"));
}

TEST(Yaml, RefusesWhatWouldTakeMemoryWithoutEnd) {
  // Nine levels of nine aliases: 9^9 nodes out of a few lines.
  std::string bomb = "a0: &a0 [x, x, x, x, x, x, x, x, x]\n";
  for (int i = 1; i < 9; ++i) {
    bomb += fmt::format("a{0}: &a{0} [{1}]\n", i,
                        fmt::join(std::vector<std::string>(9, fmt::format("*a{}", i - 1)), ", "));
  }
  EXPECT_THAT(refused_text(bomb), HasSubstr("aliases expand to more than"));
  EXPECT_THAT(refused_text("a: &a [*a]\n"), HasSubstr("nested deeper than 64"));
  EXPECT_THAT(refused_text(std::string(100, '[') + std::string(100, ']')),
              HasSubstr("nested deeper than 64"));
  EXPECT_THAT(refused_text(std::string(100'000, '[')), HasSubstr("nested too deeply"));
}

TEST(Yaml, OverridesReplaceAndAdd) {
  const std::string text = "units:\n  cpu: {active_w: 1}\n  gpu: {}\n";
  const auto node = parse_yaml(
      "f.yaml", text, "units",
      {{"cpu.active_w", "15"}, {"gpu.energy", "{op_pj: 2}"}, {"gpu.energy.byte_pj", "3"}});
  EXPECT_EQ(node.at("units").at("cpu").at("active_w").number(0, 100), 15);
  EXPECT_EQ(node.at("units").at("gpu").at("energy").at("op_pj").number(0, 100), 2);
  EXPECT_EQ(node.at("units").at("gpu").at("energy").at("byte_pj").number(0, 100), 3);
}

TEST(Yaml, SaysWhenAnOverrideIsToBlame) {
  const std::string text = "units:\n  cpu: {active_w: 1}\n";
  const auto with = [&](const std::string& path, const std::string& value) {
    return parse_yaml("f.yaml", text, "units", {{path, value}});
  };
  const auto node = with("cpu.activ_w", "2").at("units").at("cpu");
  EXPECT_EQ(bad_input([&] { node.check_keys({"active_w"}); }),
            "f.yaml (--set): units.cpu.activ_w: unknown key (did you mean active_w?)");
  const auto bad = with("cpu.active_w", "much").at("units").at("cpu").at("active_w");
  EXPECT_THAT(bad_input([&] { static_cast<void>(bad.number(0, 1)); }),
              StartsWith("f.yaml (--set): units.cpu.active_w: must be a finite number in decimal "
                         "notation, got 'much'"));
  EXPECT_THAT(bad_input([&] { static_cast<void>(with("cpuu.active_w", "1")); }),
              AllOf(HasSubstr("--set cpuu.active_w=1"), HasSubstr("did you mean cpu")));
  EXPECT_THAT(bad_input([&] { static_cast<void>(with("cpu.active_w.x", "1")); }),
              HasSubstr("not a map"));
  EXPECT_THAT(bad_input([&] { static_cast<void>(with("cpu.active_w", "[1")); }),
              HasSubstr("not valid YAML"));
  EXPECT_THAT(bad_input([&] { static_cast<void>(with("cpu.active_w", "~")); }), HasSubstr("empty"));
}

TEST(Yaml, DoesNotChangeTwoUnitsByOneOverride) {
  const std::string text = "units:\n  a: &u {active_w: 1}\n  b: *u\n";
  EXPECT_THAT(bad_input([&] {
                static_cast<void>(parse_yaml("f.yaml", text, "units", {{"a.active_w", "2"}}));
              }),
              AllOf(HasSubstr("units.a"), HasSubstr("units.b")));
}

TEST(Yaml, DoesNotChangeASettingOfTwoUnitsByOneOverride) {
  const auto refused = [](const std::string& text, const std::string& path) {
    return bad_input([&] {
      static_cast<void>(parse_yaml("f.yaml", text, "units", {{path, "2"}}));
    });
  };
  EXPECT_THAT(refused("units:\n  a: {active_w: &w 1}\n  b: {active_w: *w}\n", "a.active_w"),
              HasSubstr("units.a.active_w is the same YAML node as units.b.active_w"));
  const std::string nested = "units:\n  a: {energy: &e {op_pj: 1}}\n  b: {energy: *e}\n";
  for (const char* path : {"b.energy.op_pj", "b.energy"}) {
    EXPECT_THAT(refused(nested, path),
                HasSubstr("units.a.energy is the same YAML node as units.b.energy"));
  }
  EXPECT_THAT(refused("units:\n  a: {cores: &c [0]}\n  b: {sets: [*c]}\n", "a.cores"),
              HasSubstr("units.a.cores is the same YAML node as units.b.sets[0]"));
}

TEST(Yaml, DumpsAPartThatReadsTheSame) {
  const auto node = parse("s: {wrong_output: [a, b], samples: {sobel: [1.0, 1.1]}}");
  const auto again = parse(node.at("s").dump());
  EXPECT_THAT(again.keys(), ElementsAre("wrong_output", "samples"));
  EXPECT_EQ(again.at("samples").at("sobel").items()[1].text(), "1.1");
}

}  // namespace
}  // namespace pirt::test
