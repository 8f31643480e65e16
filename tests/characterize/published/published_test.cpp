// Published figures: what is taken from each format, what is left out and why.
#include "characterize/published/published.h"

#include <fmt/core.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "characterize/platform/platform.h"
#include "characterize/profile/store/reader.h"
#include "tests/characterize/support.h"
#include "tests/support/data.h"
#include "tests/support/errors.h"
#include "workloads/base/text/text.h"

namespace pirt {
namespace {

using test::bad_input;
using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

constexpr const char* kNcnn =
    "readme_version,soc,unit,threads,network,min_ms,max_ms,avg_ms\n"
    "old,Acme Board 1,CPU A57+A53,8,alexnet,10.5,14,12.25\n"
    "old,Acme Board 1,CPU A57,1,alexnet,30,50,40\n"
    "old,Acme Board 1,GPU Quad (Vulkan),1,mobile-net v2,5,7,6\n"
    "new,Acme Board 1,CPU A57+A53,8,alexnet,9,11,10\n";

constexpr const char* kRobotPerf = R"(
id: a2
name: a2_rectify
results:
- result: {hardware: Board X, metric: latency, metric_unit: ms, type: black, value: 9.23,
    note: "mean 5.41 ms, rms 5.85 ms, max 9.23 ms, min 1.38 ms, lost 0.00 %"}
- result: {hardware: Board X, metric: latency, metric_unit: ms, type: black, value: 8,
    note: "mean_benchmark 6.5, rms_benchmark 7, max_benchmark 8, lost messages 4.08 %"}
- result: {hardware: Board X, metric: latency, metric_unit: ms, type: grey, value: 3,
    note: "mean 2 ms, max 3 ms, throughput swept from 30 to 300 fps"}
- result: {hardware: Board X, metric: power, metric_unit: W, type: black, value: 20.84}
- result: {hardware: Board Y, metric: latency, metric_unit: ms, type: grey, value: 33.68, note: ""}
)";

constexpr const char* kRos2 = R"json({
  "BasicPerformanceMetrics.MEAN_FRAME_RATE": 425.5,
  "10.0fps": {"BasicPerformanceMetrics.FIRST_SENT_RECEIVED_LATENCY": 2.75,
              "BasicPerformanceMetrics.LAST_SENT_RECEIVED_LATENCY": 2.5},
  "60.0fps": {"BasicPerformanceMetrics.FIRST_SENT_RECEIVED_LATENCY": 3.25,
              "BasicPerformanceMetrics.LAST_SENT_RECEIVED_LATENCY": 2.25},
  "custom": {"data_resolution": "HD (1280,720)"
}
, "metadata" : {
  "BenchmarkMetadata.NAME" : "image_proc::RectifyNode Benchmark",
                             "BenchmarkMetadata.DEVICE_HOSTNAME" : "thor-1",
                                                                   "BenchmarkMetadata.DEVICE_ARCH"
      : "aarch64"
}
})json";

TEST(Published, NcnnHasABoardForEachSocEditionAndNumberOfThreads) {
  const auto publication = read_publication("t.csv", kNcnn);
  EXPECT_EQ(publication.format, "ncnn");
  ASSERT_EQ(publication.boards.size(), 3U);
  const auto& all_cores = publication.boards[0];
  EXPECT_EQ(all_cores.name, "acme-board-1");
  EXPECT_EQ(all_cores.edition, "old");
  ASSERT_EQ(all_cores.units.size(), 2U);
  EXPECT_EQ(all_cores.units[0].name, "cpu");
  EXPECT_EQ(all_cores.units[0].device, "CPU A57+A53, 8 threads");
  EXPECT_EQ(all_cores.units[1].name, "gpu");
  ASSERT_EQ(all_cores.figures.size(), 2U);
  EXPECT_EQ(all_cores.figures[0].workload, "ncnn.alexnet");
  EXPECT_THAT(all_cores.figures[0].samples, ElementsAre(Nanos(12'250'000)));
  EXPECT_THAT(all_cores.figures[0].notes,
              ElementsAre("mean of an unknown number of calls, 10.5 to 14 ms"));
  EXPECT_EQ(all_cores.figures[1].workload, "ncnn.mobile_net_v2");
  EXPECT_EQ(publication.boards[1].name, "acme-board-1-1-thread");
  EXPECT_EQ(publication.boards[2].edition, "new");
}

TEST(Published, NcnnHasAUnitForEachClusterOfASoc) {
  const auto publication = read_publication("t.csv",
                                            "soc,unit,threads,network,avg_ms\n"
                                            "Kirin 970,CPU A73,4,squeezenet,50\n"
                                            "Kirin 970,CPU A53,4,squeezenet,120\n"
                                            "Kirin 970,CPU A73,4,alexnet,90\n"
                                            "Kirin 970,CPU A53,4,alexnet,200\n");
  ASSERT_EQ(publication.boards.size(), 1U);
  const PublishedBoard& board = publication.boards[0];
  ASSERT_EQ(board.units.size(), 2U);
  EXPECT_EQ(board.units[0].name, "cpu");
  EXPECT_EQ(board.units[1].name, "cpu_a53");
  EXPECT_EQ(board.units[1].device, "CPU A53, 4 threads");
  ASSERT_EQ(board.figures.size(), 4U);
  EXPECT_THAT(board.figures[0].samples, ElementsAre(from_ms(50)));
  EXPECT_EQ(board.figures[1].unit, "cpu_a53");
  EXPECT_THAT(board.figures[1].samples, ElementsAre(from_ms(120)));
}

TEST(Published, NcnnIsRefusedWithTheLine) {
  const std::string head = "soc,unit,threads,network,avg_ms\n";
  const auto problem = [&](const std::string& text) {
    return bad_input([&] { static_cast<void>(read_publication("t.csv", text)); });
  };
  EXPECT_THAT(problem(head + "a,CPU,1,n,x\n"), AllOf(HasSubstr("t.csv:2"), HasSubstr("avg_ms")));
  EXPECT_THAT(problem(head + "a,CPU,1,n\n"), AllOf(HasSubstr("t.csv:2"), HasSubstr("4 fields")));
  EXPECT_THAT(problem(head + "a,CPU,0,n,1\n"), HasSubstr("threads"));
  EXPECT_THAT(problem(head), HasSubstr("no rows"));
  EXPECT_THAT(problem("soc,unit,threads,network\na,CPU,1,n\n"), HasSubstr("no column 'avg_ms'"));
  EXPECT_THAT(problem("soc,unit,threads,network,min_ms,max_ms,avg_ms\na,CPU,1,n,2,3,4\n"),
              HasSubstr("not between"));
  EXPECT_THAT(problem(head + "Acme 1,CPU,1,n,1\n日本,CPU,1,n,1\n"),
              HasSubstr("t.csv:3: soc '日本' has no letter"));
  EXPECT_THAT(problem(head + "Acme 1,CPU,1,網,1\n"), HasSubstr("t.csv:2: network '網' has no"));
}

TEST(Published, RobotPerfTakesMeansAndSaysWhatItLeavesOut) {
  const auto publication = read_publication("a2.yaml", kRobotPerf);
  EXPECT_EQ(publication.format, "RobotPerf");
  ASSERT_EQ(publication.boards.size(), 2U);
  const auto& board = publication.boards[0];
  EXPECT_EQ(board.name, "board-x");
  ASSERT_EQ(board.figures.size(), 1U);
  EXPECT_EQ(board.figures[0].workload, "robotperf.a2_rectify.black");
  EXPECT_EQ(board.figures[0].unit, "board");
  EXPECT_THAT(board.figures[0].samples, ElementsAre(Nanos(5'410'000), Nanos(6'500'000)));
  EXPECT_THAT(board.figures[0].notes,
              ElementsAre(HasSubstr("message to message"), HasSubstr("lost")));
  EXPECT_EQ(board.facts.at("published.power"), "20.84 W");
  EXPECT_THAT(publication.boards[1].figures, IsEmpty());
  EXPECT_THAT(publication.left_out, ElementsAre(HasSubstr("Board X: the rate was swept"),
                                                HasSubstr("Board Y: the longest alone")));
}

TEST(Published, Ros2BenchmarkTakesLatenciesAtFixedRates) {
  const auto publication = read_publication("r.json", kRos2);
  ASSERT_EQ(publication.boards.size(), 1U);
  const auto& board = publication.boards[0];
  EXPECT_EQ(board.name, "thor-1");
  ASSERT_EQ(board.figures.size(), 1U);
  EXPECT_EQ(board.figures[0].workload, "ros2_benchmark.image_proc_rectifynode");
  EXPECT_THAT(board.figures[0].samples,
              ElementsAre(Nanos(2'750'000), Nanos(2'500'000), Nanos(3'250'000), Nanos(2'250'000)));
  EXPECT_EQ(board.facts.at("published.highest_rate_hz"), "425.5");
}

TEST(Published, Ros2BenchmarkIsRefusedWithoutNames) {
  const auto problem = [](const std::string& what) {
    std::string text = kRos2;
    text.replace(text.find(what), what.size(), "網");
    return bad_input([&] { static_cast<void>(read_publication("r.json", text)); });
  };
  EXPECT_THAT(problem("thor-1"), HasSubstr("'網' has no letter or digit"));
  EXPECT_THAT(problem("image_proc::RectifyNode"), HasSubstr("'網' has no letter or digit"));
}

TEST(Published, OtherFilesAreRefused) {
  const auto problem = [&](const std::string& text) {
    return bad_input([&] { static_cast<void>(read_publication("f", text)); });
  };
  EXPECT_THAT(problem(""), HasSubstr("empty"));
  EXPECT_THAT(problem("{}"), HasSubstr("no result of ros2_benchmark"));
  EXPECT_THAT(problem("{\"metadata\": {\"BenchmarkMetadata.NAME\": \"n\"}}"),
              HasSubstr("no test at a fixed rate"));
  EXPECT_THAT(problem("platform: host\n"), HasSubstr("none of what can be imported"));
}

/// What is said of a table of times that is refused.
std::string times_problem(const std::string& text) {
  return bad_input([&] { static_cast<void>(read_publication("t.csv", text)); });
}

TEST(Times, UnitsAreNoWordsOfPlatformFiles) {
  for (const char* unit : {"source", "provenance", "call_j", "null", "NULL"}) {
    EXPECT_THAT(times_problem(fmt::format("workload,unit,ms\nmine.icp,{},48\n", unit)),
                HasSubstr(fmt::format("t.csv:2: unit '{}' is a word of platform files", unit)));
  }
}

TEST(Times, AreTakenByTheNamesOfTheirColumns) {
  const auto publication =
      read_publication("lab/my times.csv",
                       "source , ms,unit,workload,size,p95_ms,samples,energy_mj,memory_mb\n"
                       "\"rig, \"\"B\"\"\",48,cpu,mine.icp,,61,200,12.5,310\n"
                       ",2.5,gpu,sobel,1280x720,,3,,\n"
                       "\n"
                       ",1.5,gpu,sobel@map,,,,,\n");
  ASSERT_EQ(publication.boards.size(), 1U);
  const PublishedBoard& board = publication.boards[0];
  EXPECT_EQ(board.name, "my-times");
  EXPECT_EQ(board.provenance, Provenance::kMeasured);
  ASSERT_EQ(board.figures.size(), 3U);
  const PublishedFigure& icp = board.figures[0];
  EXPECT_EQ(icp.workload, "mine.icp");
  EXPECT_THAT(icp.samples, ElementsAre(from_ms(48)));
  EXPECT_EQ(icp.p95, from_ms(61));
  EXPECT_EQ(icp.energy_j, 0.0125);
  EXPECT_EQ(icp.memory_bytes, 310'000'000);
  EXPECT_THAT(icp.notes, ElementsAre("of 200 calls", "source: rig, \"B\""));
  EXPECT_THAT(icp.doubts, IsEmpty());
  EXPECT_EQ(board.figures[1].workload, "sobel@1280x720");
  EXPECT_THAT(board.figures[1].doubts, ElementsAre("few_samples"));
  EXPECT_EQ(board.figures[1].p95, std::nullopt);
  EXPECT_EQ(board.figures[2].workload, "sobel@map");
}

TEST(Times, EveryWrongRowIsNamedWithItsLine) {
  const std::string problem = times_problem(
      "workload,unit,ms,size,p95_ms,samples,energy_mj\n"
      "mine.a,cpu,-1,,,,\n"
      "mine.b,c p u,1,720p,,,\n"
      "\"mine.c\nd\",cpu,1,,0.5,0,nan\n"
      "mine.d,cpu,1,,0.5,,\n"
      "mine.d,cpu,2,,,,\n"
      "sobell,cpu,2,,,,\n"
      "plan_path,cpu,2,640x480,,,\n"
      "mine.e,cpu\n");
  for (const char* said :
       {"t.csv:2: ms", "t.csv:3: size '720p'", "t.csv:3: unit 'c p u'", "t.csv:4: workload",
        "t.csv:4: samples", "t.csv:4: energy_mj", "t.csv:6: p95_ms is below ms",
        "t.csv:7: mine.d on cpu stands at t.csv:6", "t.csv:8: there is no workload 'sobell'",
        "sobel", "t.csv:9: workload 'plan_path' has no other sizes", "t.csv:10: 2 fields"}) {
    EXPECT_THAT(problem, HasSubstr(said));
  }
}

TEST(Times, TablesThatAreNoneAreRefused) {
  EXPECT_THAT(times_problem("workload,unit\nmine.a,cpu\n"), HasSubstr("no column 'ms'"));
  EXPECT_THAT(times_problem("workload,unit,ms,p95\nmine.a,cpu,1,1\n"),
              AllOf(HasSubstr("'p95'"), HasSubstr("p95_ms")));
  EXPECT_THAT(times_problem("workload,unit,ms,ms\nmine.a,cpu,1,1\n"), HasSubstr("twice"));
  EXPECT_THAT(times_problem("workload,unit,ms\n"), HasSubstr("no row"));
  EXPECT_THAT(times_problem("workload;unit;ms\nmine.a;cpu;1,5\n"),
              AllOf(HasSubstr("t.csv:1"), HasSubstr("save it as CSV with ','")));
  EXPECT_THAT(times_problem("# my times\nmine.a cpu 1\n"), HasSubstr("workload, unit, ms"));
  EXPECT_THAT(times_problem("workload,unit,ms\n\"mine.a,cpu,1\n"), HasSubstr("not closed"));
  EXPECT_THAT(times_problem("workload,unit,ms\nmi\"ne.a,cpu,1\n"), HasSubstr("t.csv:2: a quote"));
  std::string many = "workload,unit,ms\n";
  for (int i = 0; i < 30; ++i) many += "x,cpu,1\n";
  EXPECT_THAT(times_problem(many), HasSubstr("more"));
}

TEST(Times, RowsAreMeasuredAndSayWhere) {
  const test::TemporaryFolder folder;
  const auto file = folder.path() / "p.db";
  const auto board =
      read_publication("rig.csv",
                       "workload,unit,ms,p95_ms,energy_mj,memory_mb\nsobel,cpu,2,3,4,5\n")
          .boards[0];
  {
    ProfileWriter writer(file);
    write_published(writer, board, "our lab");
  }
  const Profile profile = ProfileReader(file).read("rig");
  const PhaseRow& row = *profile.find("sobel", "cpu", Phase::kCall);
  EXPECT_EQ(row.provenance, Origin(Provenance::kMeasured));
  EXPECT_TRUE(is_valid(row));
  EXPECT_EQ(row.median, from_ms(2));
  EXPECT_EQ(row.p95, from_ms(3));
  EXPECT_EQ(row.ci_low, std::nullopt);
  EXPECT_EQ(row.host_memory_bytes, 5'000'000);
  EXPECT_GT(row.ops, 0) << "what is of pirt's catalogue is known";
  EXPECT_THAT(row.notes, testing::Contains("measured elsewhere"));
  EXPECT_EQ(profile.find_energy("sobel", "cpu")->energy_j, 0.004);
  EXPECT_EQ(profile.runs.front().environment.at("source"), "our lab");
  const auto platform = published_platform(profile);
  ASSERT_TRUE(platform);
  EXPECT_THAT(parse_platform("p", *platform, {}, 1).unit_names(), ElementsAre("cpu"));
}

constexpr const char* kGoogleBenchmark = R"json({
  "context": {"date": "2026-01-01T00:00:00+00:00", "host_name": "Rig 1", "num_cpus": 8},
  "benchmarks": [
    {"name": "BM_Icp/1024/repeats:2", "run_name": "BM_Icp/1024", "run_type": "iteration",
     "repetitions": 2, "repetition_index": 0, "threads": 1, "iterations": 10, "real_time": 2.5,
     "cpu_time": 2.4, "time_unit": "ms"},
    {"name": "BM_Icp/1024", "run_name": "BM_Icp/1024", "run_type": "iteration", "threads": 1,
     "iterations": 10, "real_time": 2.75, "cpu_time": 2.4, "time_unit": "ms"},
    {"name": "BM_Icp/1024_mean", "run_name": "BM_Icp/1024", "run_type": "aggregate",
     "aggregate_name": "mean", "real_time": 2.6, "cpu_time": 2.4, "time_unit": "ms"},
    {"name": "BM_Par/threads:4", "run_name": "BM_Par/threads:4", "run_type": "iteration",
     "threads": 4, "iterations": 10, "real_time": 7, "cpu_time": 7, "time_unit": "us"},
    {"name": "BM_Gpu", "run_type": "iteration", "skipped": true, "skip_message": "no GPU",
     "iterations": 0, "real_time": 0, "cpu_time": 0, "time_unit": "ns"},
    {"name": "BM_Bad", "run_type": "iteration", "error_occurred": true, "error_message": "no"}
  ]})json";

TEST(GoogleBenchmark, IterationsAreSamples) {
  const auto publication = read_publication("g.json", kGoogleBenchmark);
  EXPECT_EQ(publication.format, "Google Benchmark");
  const PublishedBoard& board = publication.boards.at(0);
  EXPECT_EQ(board.name, "rig-1");
  EXPECT_EQ(board.provenance, Provenance::kMeasured);
  ASSERT_EQ(board.figures.size(), 1U);
  EXPECT_EQ(board.figures[0].workload, "gbench.bm_icp_1024");
  EXPECT_THAT(board.figures[0].samples, ElementsAre(Nanos(2'500'000), Nanos(2'750'000)));
  EXPECT_THAT(publication.left_out, ElementsAre(HasSubstr("aggregates"), HasSubstr("threads"),
                                                HasSubstr("failed"), HasSubstr("skipped")));
}

TEST(GoogleBenchmark, TwoOfOneNameAreRefused) {
  const auto problem = [](const std::string& second) {
    return bad_input([&] {
      static_cast<void>(read_publication(
          "g.json",
          R"({"context": {}, "benchmarks": [{"name": "BM_A/1", "real_time": 1}, {"name": ")" +
              second + R"(", "real_time": 1, "time_unit": "ns"}]})"));
    });
  };
  EXPECT_THAT(problem("bm_a:1"), AllOf(HasSubstr("'BM_A/1' and 'bm_a:1'"), HasSubstr("g.json")));
  EXPECT_THAT(problem("//"), HasSubstr("no letter or digit"));
}

constexpr const char* kNvbench = R"json({
  "meta": {"version": {"json": {"major": 1, "minor": 0, "patch": 0}}},
  "devices": [{"id": 0, "name": "Card A"}, {"id": 1, "name": "Card B"}],
  "benchmarks": [{"name": "copy", "index": 0, "axes": [], "states": [
    {"name": "Device=0 Elements=2^16", "device": 0, "is_skipped": false,
     "axis_values": [{"name": "Elements", "type": "int64", "value": "65536"}],
     "summaries": [
       {"tag": "nv/cold/sample_size", "data": [{"name": "value", "type": "int64", "value": "500"}]},
       {"tag": "nv/cold/time/cpu/mean", "data": [{"name": "value", "type": "float64", "value": "2.0e-05"}]},
       {"tag": "nv/cold/time/gpu/mean", "data": [{"name": "value", "type": "float64", "value": 0.00001}]}]},
    {"name": "Device=1 Elements=2^16", "device": 1, "is_skipped": true,
     "axis_values": [{"name": "Elements", "type": "int64", "value": "65536"}], "summaries": []}
  ]}]})json";

TEST(Nvbench, TakesTheHostsClock) {
  const auto publication = read_publication("lab/nv.json", kNvbench);
  EXPECT_EQ(publication.format, "nvbench");
  const PublishedBoard& board = publication.boards.at(0);
  EXPECT_EQ(board.name, "nv");
  ASSERT_EQ(board.units.size(), 2U);
  EXPECT_EQ(board.units[1].name, "gpu1");
  ASSERT_EQ(board.figures.size(), 1U);
  EXPECT_EQ(board.figures[0].workload, "nvbench.copy_elements_65536");
  EXPECT_EQ(board.figures[0].unit, "gpu");
  EXPECT_THAT(board.figures[0].samples, ElementsAre(Nanos(20'000)));
  EXPECT_THAT(board.figures[0].notes, ElementsAre(HasSubstr("500 calls")));
  EXPECT_THAT(publication.left_out,
              ElementsAre(HasSubstr("nvbench.copy_elements_65536"), HasSubstr("GPU's own times")));
}

/// As StarPU writes it; one worker of each kind and both together.
std::string starpu_history() {
  const std::string regression =
      "# number of entries\n2\n# sumlnx\n0e+00\t0e+00\t0e+00\t0e+00\tnan\tnan\t0\t0\t0\n"
      "# a\nnan\tnan\tnan\n# not multiple-regression-base\n0\n# hash\tsize\n";
  const std::string entries =
      "d46431bb\t1228800\t6.5e+07\t3.25e+03\t7.8e+01\t1.5e+07\t5e+10\t4697\n"
      "24c84a50\t11059200\tnan\t8.75e+04\t9.5e+02\t2.8e+08\t2.5e+13\t4\n\n";
  const auto device = [](int type, int id, int cores) {
    return fmt::format("# DEV_0\n{}\n# id\n{}\n# cores\n{}\n", type, id, cores);
  };
  return "##################\n# Performance Model Version\n45\n\n# number of combinations\n3\n# "
         "COMB_0\n1\n" +
         device(0, 0, 1) + "2\n" + regression + entries + regression + entries + "1\n" +
         device(1, 0, 1) + "1\n" + regression + entries + "2\n" + device(0, 0, 1) +
         device(1, 0, 1) + "1\n" + regression + entries;
}

TEST(StarPU, AHistoryIsTheMeansOfACodeletByItsBytes) {
  const auto publication = read_publication("codelets/45/chol_gemm.mirage", starpu_history());
  EXPECT_EQ(publication.format, "StarPU");
  const PublishedBoard& board = publication.boards.at(0);
  EXPECT_EQ(board.name, "mirage");
  ASSERT_EQ(board.figures.size(), 4U);
  EXPECT_EQ(board.figures[0].workload, "starpu.chol_gemm_1228800");
  EXPECT_EQ(board.figures[0].unit, "cpu");
  EXPECT_THAT(board.figures[0].samples, ElementsAre(Nanos(3'250'000)));
  EXPECT_EQ(board.figures[0].ops, 65'000'000);
  EXPECT_EQ(board.figures[1].ops, std::nullopt);
  EXPECT_THAT(board.figures[1].doubts, ElementsAre("few_samples"));
  EXPECT_EQ(board.figures[2].unit, "cuda0");
  EXPECT_THAT(publication.left_out,
              ElementsAre(HasSubstr("implementations"), HasSubstr("2 devices")));
}

TEST(StarPU, AnotherVersionOrACutFileIsRefused) {
  const auto problem = [](const std::string& text) {
    return bad_input([&] { static_cast<void>(read_publication("a.b", text)); });
  };
  EXPECT_THAT(problem("# Performance Model Version\n44\n"), HasSubstr("version 44"));
  const std::string whole = starpu_history();
  EXPECT_THAT(problem(whole.substr(0, whole.size() / 2)), HasSubstr("a.b:"));
}

TEST(Published, RowsAreOfProvenancePublishedWithTheirSource) {
  const test::TemporaryFolder folder;
  const auto file = folder.path() / "p.db";
  const auto board = read_publication("t.csv", kNcnn).boards[0];
  {
    ProfileWriter writer(file);
    write_published(writer, board, "README of Acme");
  }
  const Profile profile = ProfileReader(file).read("acme-board-1");
  const PhaseRow* row = profile.find("ncnn.alexnet", "cpu", Phase::kCall);
  ASSERT_NE(row, nullptr);
  EXPECT_EQ(row->provenance, Origin(Provenance::kPublished));
  EXPECT_TRUE(is_valid(*row));
  EXPECT_EQ(row->median, Nanos(12'250'000));
  EXPECT_EQ(row->ops, std::nullopt);
  EXPECT_EQ(profile.find_energy("ncnn.alexnet", "cpu"), nullptr);
  EXPECT_EQ(profile.runs.front().environment.at("source"), "README of Acme");
  const Platform platform =
      parse_platform("board.yaml", published_platform(board, "README of \"Acme\": 1"), {}, 1);
  EXPECT_EQ(platform.name, "acme-board-1");
  EXPECT_THAT(platform.unit_names(), ElementsAre("cpu", "gpu"));
}

TEST(Published, RealFilesAreRead) {
  PIRT_DATA_OR_SKIP(ncnn, "profiles-ncnn-snapdragon/ncnn_snapdragon_latency_ms.csv");
  PIRT_DATA_OR_SKIP(rectify, "profiles-robotperf/a2_rectify.yaml");
  PIRT_DATA_OR_SKIP(thor, "profiles-ros2_benchmark/image_proc_rectify_node-agx_thor.json");
  PIRT_DATA_OR_SKIP(gemm, "profiles-starpu-mirage/codelets/chol_model_gemm.mirage");
  EXPECT_EQ(read_publication(gemm, read_text(gemm)).boards[0].figures.size(), 16U);
  const auto table = read_publication("ncnn", read_file(ncnn));
  // 4 editions of the 820, the 821 and the 810 with all threads and with one.
  EXPECT_EQ(table.boards.size(), 8U);
  EXPECT_EQ(table.boards[0].figures[6].workload, "ncnn.alexnet");
  EXPECT_THAT(table.boards[0].figures[6].samples, ElementsAre(Nanos(205'180'000)));
  const auto robotperf = read_publication("a2", read_file(rectify));
  const auto kria = std::ranges::find(robotperf.boards, "kria-kr260", &PublishedBoard::name);
  ASSERT_NE(kria, robotperf.boards.end());
  EXPECT_FALSE(kria->figures.empty());
  EXPECT_EQ(read_publication("thor", read_file(thor)).boards[0].figures[0].samples.size(), 6U);
}

}  // namespace
}  // namespace pirt
