// What one option writes is nothing that another names: for every command, and for every way to
// name a file.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>
#include <regex>
#include <set>

#include "tests/cli/program.h"
#include "workloads/base/text/json.h"
#include "workloads/base/text/text.h"

namespace pirt::test {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

struct HelpEntry {
  std::string name;  ///< "--json", or that of a positional argument.
  std::string type;  ///< "OUTFILE|-"; empty = a flag.
  bool required = false;
  std::string needs = {};  ///< Another option, without which it means nothing.

  [[nodiscard]] bool is_written() const { return type.starts_with("OUTFILE"); }
  [[nodiscard]] bool is_continued() const { return type == "DATAFILE"; }
  [[nodiscard]] bool is_file() const { return type.find("FILE") != std::string::npos; }
  [[nodiscard]] std::vector<std::string> given(const std::string& value) const {
    return name.starts_with('-') ? std::vector{name, value} : std::vector{value};
  }
};

std::string help_text(const std::string& command) {
  auto words = command.empty() ? std::vector<std::string>() : split(command, ' ');
  words.emplace_back("--help");
  return pirt(words).out;
}

/// With their kinds: "generate dag". Without words before, all that --help shows.
void add_commands(const std::string& before, std::vector<std::string>& commands) {
  const std::string help = help_text(before);
  const std::regex line("\n  ([a-z-]+) ");
  const auto begin = help.find("Subcommands:");
  if (begin == std::string::npos) return;
  for (std::sregex_iterator it(help.begin() + static_cast<std::ptrdiff_t>(begin), help.end(), line),
       end;
       it != end; ++it) {
    commands.push_back((before.empty() ? "" : before + " ") + it->str(1));
    add_commands(commands.back(), commands);
  }
}

std::vector<std::string> all_commands() {
  std::vector<std::string> commands = {"sample"};  // not in the help
  add_commands("", commands);
  return commands;
}

std::vector<HelpEntry> help_of(const std::string& command) {
  std::vector<HelpEntry> entries;
  const std::string help = help_text(command);
  const std::regex line(
      "\n  (?:-[a-z],)?([a-z-]+)(?: (?!Needs:)([A-Z][^ =\n]*))?(?:=[^ \n]*| \\[[^\n]*\\] )?"
      "([^\n]* REQUIRED)?(?: Needs: ([a-z-]+))?");
  for (std::sregex_iterator it(help.begin(), help.end(), line), end; it != end; ++it) {
    entries.push_back({(*it)[1], (*it)[2], (*it)[3].matched, (*it)[4]});
  }
  return entries;
}

/// Names of what is required, and of what @p given needs, and so on.
std::set<std::string> needed_by(const std::vector<HelpEntry>& entries,
                                std::vector<std::string> given) {
  for (const auto& entry : entries) {
    if (entry.required) given.push_back(entry.name);
  }
  std::set<std::string> needed;
  for (std::size_t i = 0; i < given.size(); ++i) {
    if (!needed.insert(given[i]).second) continue;
    for (const auto& entry : entries) {
      if (entry.name == given[i] && !entry.needs.empty()) given.push_back(entry.needs);
    }
  }
  return needed;
}

TEST(Options, EachSaysWhatItTakes) {
  // What CLI11 calls an option that was added without saying so.
  const std::set<std::string> unsaid = {"TEXT", "INT", "UINT", "FLOAT"};
  const auto commands = all_commands();
  ASSERT_GT(commands.size(), 5U);
  EXPECT_THAT(commands, testing::Contains("generate dag"));
  for (const auto& command : commands) {
    const auto entries = help_of(command);
    EXPECT_GT(entries.size(), 1U) << command;
    for (const auto& entry : entries) {
      EXPECT_FALSE(unsaid.contains(entry.type)) << command << ' ' << entry.name;
    }
  }
}

TEST(Options, WriteNothingThatAnotherOptionNames) {
  const Scratch scratch;
  const auto shared = scratch.write("shared.yaml", "what was there");
  int pairs = 0;
  for (const auto& command : all_commands()) {
    const auto entries = help_of(command);
    for (const auto& written : entries) {
      if (!written.is_written() && !written.is_continued()) continue;
      for (const auto& other : entries) {
        if (!other.is_file() || other.name == written.name) continue;
        std::vector<std::string> arguments = split(command, ' ');
        if (command == "list") arguments.emplace_back("units");
        for (const auto* entry : {&other, &written}) {
          for (const auto& part : entry->given(shared)) arguments.push_back(part);
        }
        const auto needed = needed_by(entries, {other.name, written.name});
        for (const auto& entry : entries) {
          if (!needed.contains(entry.name) || !entry.is_file()) continue;
          if (entry.name == other.name || entry.name == written.name) continue;
          const std::string name = entry.name.substr(entry.name.find_first_not_of('-'));
          const auto third = scratch.write(name + ".yaml", "also needed");
          for (const auto& part : entry.given(third)) arguments.push_back(part);
        }
        const auto outcome = pirt(arguments);
        if (outcome.err.find(" excludes ") != std::string::npos) {  // never given together
          expect_refused(outcome, {});
          continue;
        }
        expect_refused(outcome, {"would overwrite", written.name, "name another file"});
        ++pairs;
      }
    }
  }
  EXPECT_GT(pairs, 30);
  EXPECT_EQ(slurp(shared), "what was there");
}

class SameFile : public testing::Test {
 protected:
  void SetUp() override {
    fs::create_directory(scratch_.file("folder"));
    fs::create_directory_symlink(scratch_.file("folder"), scratch_.file("other"));
    scratch_.write("folder/trace", "what was there");
    fs::create_symlink(scratch_.file("folder/trace"), scratch_.file("symbolic"));
    fs::create_hard_link(scratch_.file("folder/trace"), scratch_.file("hard"));
    fs::create_symlink("folder/later", scratch_.file("dangling"));
  }
  /// In the scratch folder.
  [[nodiscard]] Outcome pirt_here(const std::string& arguments) const {
    return run("cd " + quoted(scratch_.file("")) + " || exit 9; " + quoted(kProgram) + " " +
               arguments);
  }
  Scratch scratch_;
};

TEST_F(SameFile, IsRecognizedByAnyName) {
  for (const auto* name : {"folder/trace", "./folder/trace", "folder/../folder/trace",
                           "other/trace", "symbolic", "hard", "\"$PWD/folder/trace\""}) {
    expect_refused(pirt_here("replay folder/trace --json " + std::string(name)),
                   {"--json", "would overwrite trace 'folder/trace'"});
  }
  EXPECT_EQ(slurp(scratch_.file("folder/trace")), "what was there");
}

TEST_F(SameFile, IsRecognizedBeforeItExists) {
  const std::string schedule =
      "schedule --mode met --platform snapdragon820 --mix convolution-1000 --trace folder/later "
      "--json ";
  for (const auto* name : {"folder/later", "./folder/later", "other/later", "dangling",
                           "\"$PWD/other/../folder/later\""}) {
    expect_refused(pirt_here(schedule + name), {"--trace", "--json", "would overwrite"});
  }
  EXPECT_FALSE(fs::exists(scratch_.file("folder/later")));
}

TEST_F(SameFile, IsWrittenThroughItsLinks) {
  const std::string schedule =
      "schedule --mode met --platform snapdragon820 --mix convolution-1000 ";
  const auto outcome = pirt_here(schedule + "--trace symbolic --json dangling");
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_TRUE(fs::is_symlink(scratch_.file("symbolic")));
  EXPECT_TRUE(fs::is_symlink(scratch_.file("dangling")));
  EXPECT_EQ(pirt_here("replay folder/trace").exit_code, 0);
  EXPECT_THAT(slurp(scratch_.file("folder/later")), HasSubstr("\"makespan_s\""));
  // A link to what has no name.
  EXPECT_THAT(pirt_here(schedule + "--trace /dev/fd/3 3>&1 >/dev/null | cat").err,
              HasSubstr("not a regular file"));
}

TEST_F(SameFile, MayBeAName) {
  // A shipped platform, beside a file that has its name.
  const auto outcome = pirt_here("list units --platform host --json host");
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_TRUE(fs::exists(scratch_.file("host")));
}

TEST_F(SameFile, IsWhereStandardOutputLeads) {
  const auto outcome = pirt_here("list modes --json both >both");
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_THAT(outcome.err, HasSubstr("standard output"));
  EXPECT_EQ(pirt_here("list modes --json - >alone").exit_code, 0);
  EXPECT_EQ(pirt_here("list modes --json /dev/stdout >>alone").exit_code, 0);
  EXPECT_THAT(slurp(scratch_.file("alone")), HasSubstr("}\n{"));
}

TEST_F(SameFile, MayBeADevice) {
  EXPECT_EQ(pirt_here("export folder/trace --format csv -o /dev/null").exit_code, 2);
  const auto outcome = pirt_here(
      "schedule --mode met --platform snapdragon820 --mix convolution-1000 --json "
      "/dev/null >/dev/null");
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
}

TEST_F(SameFile, MayBeContinuedButNotReplaced) {
  const auto tuning = quoted(scratch_.write("tuning.json", "{}"));
  const auto run_here = [&](const std::string& arguments) {
    return run("PIRT_TUNING=" + tuning + " " + quoted(kProgram) + " " + arguments);
  };
  expect_refused(run_here("list modes --json " + tuning), {"the tuning file", "would overwrite"});
  EXPECT_THAT(run_here("tune --platform nowhere --output " + tuning).err,
              HasSubstr("unknown platform 'nowhere'"));
}

TEST_F(SameFile, IsNoPictureOfTheFolderThatIsRead) {
  scratch_.write("folder/a.png", "no picture, which is found out later");
  const std::string characterize =
      "characterize --platform fake --filter sobel --dry-run --images other --json ";
  expect_refused(pirt_here(characterize + "folder/a.png"), {"a file of --images 'other'"});
  expect_refused(pirt_here(characterize + "folder/notes.json"), {"a.png"});  // is decoded
}

TEST_F(SameFile, IsNothingOfARecordedMachine) {
  fs::create_directory(scratch_.file("folder/proc"));
  scratch_.write("folder/proc/stat", "");
  expect_refused(pirt_here("doctor --root other --json folder/proc/stat"),
                 {"a file of --root 'other'"});
}

TEST_F(SameFile, OfARunThatIsGoneOnWithIsRefusedToo) {
  const auto platform =
      run("cat " + quoted(kSourceFolder) + "/characterize/platform/platforms/fake.yaml");
  scratch_.write("mine.yaml", platform.out);
  const auto begun = pirt_here(
      "characterize --quick --platform mine.yaml --filter '^pool5$' --db p.db & pid=$!; while kill "
      "-0 $pid && [ ! -e p.db ]; do sleep 0.02; done; kill -TERM $pid; wait $pid");
  ASSERT_EQ(begun.exit_code, 4) << begun.err;
  const auto before = slurp(scratch_.file("mine.yaml"));
  expect_refused(pirt_here("characterize --resume --db p.db --json mine.yaml"),
                 {"the run's platform", "would overwrite"});
  EXPECT_EQ(slurp(scratch_.file("mine.yaml")), before);
}

TEST(StandardOutput, TakesOneResult) {
  expect_refused(pirt({"report", "paper", "-o", "-", "--json", "/dev/stdout"}),
                 {"--output", "--json", "stdout"});
  const auto json = pirt({"report", "paper", "--format", "html", "--json", "-"});
  EXPECT_EQ(json.json()["schema_version"], 1);
}

TEST(StandardOutput, IsRefusedWhereAFileIsNeeded) {
  for (const auto& command : all_commands()) {
    for (const auto& entry : help_of(command)) {
      if (entry.type != "OUTFILE" && !entry.is_continued()) continue;
      expect_refused(pirt({command, entry.name, "-"}), {entry.name, "standard output"});
      expect_refused(pirt({command, entry.name, "--quick"}), {entry.name, "./--quick"});
      expect_refused(pirt({command, entry.name, ""}), {entry.name, "empty"});
    }
  }
}

TEST(Databases, KeepWhatLiesBesideThem) {
  const Scratch scratch;
  const auto database = scratch.file("p.db");
  const auto made = pirt({"characterize", "--quick", "--platform", "fake", "--filter", "^pool5$",
                          "--units", "gpu", "--db", database});
  ASSERT_EQ(made.exit_code, 0) << made.err;
  const auto before = slurp(database);
  for (const auto* suffix : {"-journal", "-wal", "-shm"}) {
    expect_refused(pirt({"report", database, "-o", database + suffix}), {"--output", suffix});
    expect_refused(pirt({"list", "modes", "--json", database + suffix}), {"--json", database});
    expect_refused(pirt({"characterize", "--platform", "fake", "--filter", "^pool5$", "--db",
                         scratch.file("new.db"), "--json", scratch.file("new.db") + suffix}),
                   {"--json", "new.db"});
    expect_refused(pirt({"characterize", "--platform", "fake", "--filter", "^pool5$", "--db",
                         scratch.file("none.db") + suffix}),
                   {"--db", "none.db"});
  }
  EXPECT_EQ(pirt({"list", "modes", "--json", scratch.file("notes-journal")}).exit_code, 0);
  EXPECT_EQ(slurp(database), before);
}

TEST(Report, WritesJsonBesideADocument) {
  const Scratch scratch;
  const auto outcome =
      pirt({"report", "paper", "--format", "md", "--json", scratch.file("x.json")});
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_THAT(outcome.out, testing::StartsWith("# "));
  EXPECT_EQ(slurp(scratch.file("x.json")), pirt({"report", "paper", "--json", "-"}).out);
}

TEST(Outputs, AreTriedBeforeAnythingIsMeasured) {
  const Scratch scratch;
  fs::create_directory(scratch.file("folder"));
  for (const auto& target : {scratch.file("none/x.json"), scratch.file("folder")}) {
    const auto outcome = pirt({"characterize", "--platform", "fake", "--filter", "sobel", "--db",
                               scratch.file("p.db"), "--json", target});
    expect_refused(outcome, {"cannot write", target});
    EXPECT_FALSE(fs::exists(scratch.file("p.db")));
  }
  EXPECT_EQ(std::distance(fs::directory_iterator(scratch.file("")), {}), 1);
}

}  // namespace
}  // namespace pirt::test
