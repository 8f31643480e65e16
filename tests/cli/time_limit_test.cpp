// pirt characterize and its time: --max-time, --mix, --resume, --dry-run, and another program that
// holds the database.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sqlite3.h>

#include <chrono>
#include <set>
#include <thread>

#include "tests/cli/program.h"
#include "tests/support/paths.h"

namespace pirt::test {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

class TimeLimit : public testing::Test {
 protected:
  [[nodiscard]] std::string database() const { return scratch_.file("p.db"); }
  [[nodiscard]] Outcome characterize(std::vector<std::string> rest) const {
    rest.insert(rest.begin(), {"characterize", "--db", database()});
    return pirt(rest);
  }
  const Scratch scratch_;
};

const std::vector<std::string> kSmall = {"--quick", "--platform", "fake", "--filter",
                                         "^(pool5|fc8)$"};

std::vector<std::string> small_and(const std::vector<std::string>& more) {
  auto all = kSmall;
  all.insert(all.end(), more.begin(), more.end());
  return all;
}

TEST_F(TimeLimit, SaysWhatItDidNotSufficeForAndHowToGoOn) {
  const auto none = characterize(small_and({"--max-time", "1ns"}));
  EXPECT_EQ(none.exit_code, 4);
  EXPECT_THAT(none.err,
              AllOf(HasSubstr("6 cells have no figure"), HasSubstr("pool5 (cpu, gpu, dsp)"),
                    HasSubstr("pirt characterize --resume --max-time 1min --db " + database())));
  const auto spent = characterize({"--resume"});
  EXPECT_EQ(spent.exit_code, 2);
  EXPECT_THAT(spent.err, AllOf(HasSubstr("has spent its time"), HasSubstr("--max-time 1min")));
  const auto planned = characterize({"--resume", "--max-time", "2min", "--dry-run", "--json", "-"});
  ASSERT_EQ(planned.exit_code, 0) << planned.err;
  EXPECT_GT(planned.json()["spent_s"], 0);
  EXPECT_EQ(planned.json()["max_time_s"], 120);
  EXPECT_EQ(planned.json()["cells"].size(), 6U);
  const auto rest = characterize({"--resume", "--max-time", "5min", "--json", "-"});
  ASSERT_EQ(rest.exit_code, 0) << rest.err;
  EXPECT_EQ(rest.json()["summary"]["cells"], 6);
  EXPECT_EQ(rest.json()["summary"]["cells_unmeasured"].size(), 0U);
  EXPECT_EQ(characterize({"--resume"}).exit_code, 2) << "nothing is left";
}

TEST_F(TimeLimit, ADryRunSaysWhenItEndsAndNothingElse) {
  const auto quick = pirt({"characterize", "--quick", "--platform", "fake", "--dry-run"});
  ASSERT_EQ(quick.exit_code, 0) << quick.err;
  EXPECT_THAT(quick.out, AllOf(HasSubstr("nothing begins after 3:00 min (--max-time)"),
                               HasSubstr("come first: mix full-robot needs them")));
  const auto json =
      pirt({"characterize", "--quick", "--platform", "fake", "--dry-run", "--json", "-"}).json();
  EXPECT_EQ(json["max_time_s"], 180);
  EXPECT_LE(json["estimate_s"], json["max_time_s"]);
  const auto brief =
      pirt({"characterize", "--quick", "--platform", "fake", "--dry-run", "--max-time", "10s"});
  EXPECT_THAT(brief.out, AllOf(HasSubstr("and nothing begins after 0:10 min"),
                               HasSubstr("some rows will be uncertain or missing"),
                               Not(HasSubstr("the rest is for precision"))));
}

TEST_F(TimeLimit, TheMixDecidesWhatComesFirst) {
  const auto mix = scratch_.write("tour.yaml", R"(
mix: tour
pipelines:
  look:
    rate_hz: 10
    tasks: [{name: pool, workload: pool5, eligible: [gpu, cpu]}]
)");
  const auto json = characterize(small_and({"--mix", mix, "--dry-run", "--json", "-"}));
  ASSERT_EQ(json.exit_code, 0) << json.err;
  std::set<std::string> first;
  const auto planned = json.json();
  for (const auto& cell : planned["cells"]) {
    if (cell["first"]) {
      first.insert(cell["workload"].get<std::string>() + " " + cell["unit"].get<std::string>());
    }
  }
  EXPECT_EQ(first, (std::set<std::string>{"pool5 cpu", "pool5 gpu"}));
  EXPECT_EQ(characterize(small_and({"--mix", "full-robt"})).exit_code, 2);
  const auto refused = characterize({"--resume", "--mix", mix});
  EXPECT_EQ(refused.exit_code, 2);
  EXPECT_THAT(refused.err, HasSubstr("--mix"));
}

/// An SQLite shell with an open transaction, from the run's first stored process on.
class Shell {
 public:
  explicit Shell(const std::string& path) {
    while (handle_ == nullptr) {
      std::this_thread::sleep_for(std::chrono::milliseconds(2));
      if (!std::filesystem::exists(path)) continue;
      EXPECT_EQ(sqlite3_open_v2(path.c_str(), &handle_, SQLITE_OPEN_READWRITE, nullptr), SQLITE_OK);
      sqlite3_busy_timeout(handle_, 10'000);
    }
    for (int processes = 0; processes == 0;) {
      run("BEGIN");
      sqlite3_stmt* query = nullptr;
      EXPECT_EQ(sqlite3_prepare_v2(handle_, "SELECT count(*) FROM visit", -1, &query, nullptr),
                SQLITE_OK);
      EXPECT_EQ(sqlite3_step(query), SQLITE_ROW);
      processes = sqlite3_column_int(query, 0);
      sqlite3_finalize(query);
      if (processes == 0) run("COMMIT");
    }
  }
  ~Shell() { sqlite3_close(handle_); }
  Shell(const Shell&) = delete;
  Shell& operator=(const Shell&) = delete;
  void run(const char* sql) {
    EXPECT_EQ(sqlite3_exec(handle_, sql, nullptr, nullptr, nullptr), SQLITE_OK);
  }

 private:
  sqlite3* handle_ = nullptr;
};

class BesideAReader : public TimeLimit {
 protected:
  /// What happens beside the run, once it waits for a reader.
  [[nodiscard]] Outcome run_beside(const std::string& then) {
    const std::string err = scratch_.file("err");
    Outcome outcome;
    std::thread program([&] {
      outcome = run(
          "env --default-signal " + quoted(kProgram) +
          " characterize --quick --platform fake --units cpu,gpu --filter '^(pool5|fc8)$' --db " +
          quoted(database()) + " 2>" + quoted(err) + " & echo $! >" + quoted(scratch_.file("pid")) +
          "; wait $!");
    });
    Shell shell(database());
    while (slurp(err).find("waiting for another program that reads") == std::string::npos) {
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
    if (then == "INT") {
      ::kill(static_cast<pid_t>(std::stoi(slurp(scratch_.file("pid")))), SIGINT);
    } else {
      shell.run("COMMIT");
    }
    program.join();
    outcome.err = slurp(err);
    return outcome;
  }
};

TEST_F(BesideAReader, ItWaitsAndLosesNothing) {
  const auto outcome = run_beside("COMMIT");
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_THAT(outcome.err, HasSubstr("waiting for another program that reads " + database()));
  const auto report = pirt({"report", database(), "--json", "-"});
  ASSERT_EQ(report.exit_code, 0) << report.err;
  const auto shown = report.json();
  for (const auto& row : shown["profile_summary"]) {
    if (row["phase"] != "call") continue;
    EXPECT_EQ(row["processes"], 4) << row;
  }
}

TEST_F(BesideAReader, ASignalEndsTheWaitAndTheRestCanBeGoneOnWith) {
  const auto outcome = run_beside("INT");
  EXPECT_EQ(outcome.exit_code, 4);
  EXPECT_THAT(outcome.err, AllOf(HasSubstr("interrupted while another program used"),
                                 HasSubstr("pirt characterize --resume --db " + database())));
  const auto rest = characterize({"--resume", "--json", "-"});
  ASSERT_EQ(rest.exit_code, 0) << rest.err;
  EXPECT_EQ(rest.json()["summary"]["run_id"], 1);
  EXPECT_TRUE(rest.json()["runs"][0]["finished"].is_string()) << rest.json()["runs"];
}

TEST_F(TimeLimit, TimesOfUnitsStopOnASignalAndAreMeasuredWhenItIsGoneOnWith) {
  // Once there are some rows of the first unit.
  const auto outcome = run(
      "env --default-signal " + quoted(kProgram) +
      " characterize --quick --precision 50% --platform host-cpu --filter '^pool5$' --db " +
      quoted(database()) + " & pid=$!; while ! grep -q handover " + quoted(database()) +
      "-seen 2>/dev/null; do sleep 0.3; " + quoted(kProgram) + " report " + quoted(database()) +
      " --json - >" + quoted(database()) + "-seen 2>/dev/null; done; kill -INT $pid; wait $pid");
  EXPECT_EQ(outcome.exit_code, 4) << outcome.err;
  EXPECT_THAT(outcome.err, HasSubstr("--resume"));
  const auto rest = characterize({"--resume", "--json", "-"});
  ASSERT_EQ(rest.exit_code, 0) << rest.err;
  std::set<std::string> phases;
  const auto shown = rest.json();
  for (const auto& row : shown["unit_time_summary"]) phases.insert(row["phase"]);
  EXPECT_TRUE(phases.contains("handover"));
  EXPECT_TRUE(phases.contains("leave"));
}

}  // namespace
}  // namespace pirt::test
