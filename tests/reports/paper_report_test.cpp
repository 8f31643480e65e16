// Table V of the paper: every cell within 2 %, the energy mode's throughput within 4 %.
#include "reports/paper/paper_report.h"

#include <gtest/gtest.h>

#include <cmath>

#include "workloads/base/text/json.h"

namespace pirt {
namespace {

TEST(PaperReport, ReproducesEveryCellOfTableFive) {
  const auto cells = paper_cells();
  ASSERT_EQ(cells.size(), 13U);
  for (const auto& cell : cells) {
    const bool loose = cell.mode == "energy" && cell.figure.starts_with("throughput");
    EXPECT_LE(std::abs(cell.ours / cell.paper - 1), loose ? 0.04 : 0.02)
        << cell.mode << ": " << cell.figure;
    EXPECT_TRUE(cell.holds());
  }
}

TEST(PaperReport, SaysWhatIsFarOff) {
  const std::vector<PaperCell> cells = {{"latency", "energy, J", 4.0, 4.2, 0.02}};
  EXPECT_FALSE(cells[0].holds());
  EXPECT_EQ(paper_table(cells).rows[0].back(), "MISSED");
  EXPECT_EQ(paper_table(cells).rows[0][4], "+5.0%");
  EXPECT_EQ(paper_table(cells).rows[0][2], "+4");  // published
  EXPECT_EQ(paper_json(cells)["table5"][0]["holds"], false);
}

}  // namespace
}  // namespace pirt
