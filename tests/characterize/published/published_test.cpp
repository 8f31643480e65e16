// Published figures: what is taken from each format, what is left out and why.
#include "characterize/published/published.h"

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
