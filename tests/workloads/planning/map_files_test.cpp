// Map and scenario files: what they say, and what is refused with its place.
#include "workloads/planning/map_files.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <zlib.h>

#include <fstream>

#include "tests/support/data.h"
#include "tests/support/errors.h"
#include "workloads/base/text/text.h"

namespace pirt::planning {
namespace {

using test::bad_input;
using testing::AllOf;
using testing::HasSubstr;

class MapFiles : public testing::Test {
 protected:
  MapFiles() : folder_(testing::TempDir() + "/pirt-maps-" + std::to_string(::getpid())) {
    std::filesystem::create_directories(folder_);
  }
  ~MapFiles() override { std::filesystem::remove_all(folder_); }

  std::filesystem::path write(const std::string& name, const std::string& text) const {
    std::ofstream(folder_ / name, std::ios::binary) << text;
    return folder_ / name;
  }
  /// A map of one row with these pixels.
  std::filesystem::path ros(const std::string& pgm, const std::string& more = "") const {
    write("m.pgm", pgm);
    return write("m.yaml",
                 "image: m.pgm\nresolution: 0.1\norigin: [0, 0, 0]\noccupied_thresh: 0.65\n"
                 "free_thresh: 0.196\n" +
                     more);
  }

  std::filesystem::path folder_;
};

constexpr const char* kMap = "type octile\nheight 2\nwidth 3\nmap\n.GS\n@OT\n";

TEST_F(MapFiles, ReadsMovingAi) {
  const auto grid = read_map(write("a.map", kMap));
  EXPECT_EQ(grid.width, 3);
  EXPECT_EQ(grid.height, 2);
  EXPECT_EQ(grid.at({2, 0}), CellState::kFree);
  EXPECT_EQ(grid.at({2, 1}), CellState::kOccupied);
}

TEST_F(MapFiles, RefusesDamagedMovingAiMapsWithTheirPlace) {
  const auto refused = [this](const std::string& text) {
    return bad_input([&] { static_cast<void>(read_map(write("a.map", text))); });
  };
  EXPECT_THAT(refused(""), HasSubstr("type octile"));
  EXPECT_THAT(refused("type tile\n"), AllOf(HasSubstr("a.map:1:"), HasSubstr("type octile")));
  EXPECT_THAT(refused("type octile\nheight -2\n"), HasSubstr("a.map:2:"));
  EXPECT_THAT(refused("type octile\nheight 2\nwidth 99999\nmap\n"), HasSubstr("a.map:3:"));
  EXPECT_THAT(refused("type octile\nheight 30000\nwidth 30000\nmap\n"), HasSubstr("too many"));
  EXPECT_THAT(refused("type octile\nheight 2\nwidth 3\nmap\n...\n"), HasSubstr("row 2 of 2"));
  EXPECT_THAT(refused("type octile\nheight 1\nwidth 3\nmap\n....\n"), HasSubstr("4 cells"));
  EXPECT_THAT(refused("type octile\nheight 1\nwidth 3\nmap\n...\n...\n"), HasSubstr("more than"));
  EXPECT_THAT(refused("type octile\nheight 1\nwidth 3\nmap\n..x\n"),
              AllOf(HasSubstr("a.map:5:"), HasSubstr("'x' in column 3")));
}

TEST_F(MapFiles, ReadsScenarios) {
  const auto grid = read_map(write("a.map", kMap));
  const auto queries =
      read_scenario(write("a.scen", "version 1\n0\ta.map\t3\t2\t0\t0\t2\t0\t2.00000000\n"), grid);
  ASSERT_EQ(queries.size(), 1U);
  EXPECT_EQ(queries[0].goal, (Cell{2, 0}));
  EXPECT_EQ(queries[0].optimal_length, 2);
}

TEST_F(MapFiles, RefusesDamagedScenariosWithTheirPlace) {
  const auto grid = read_map(write("a.map", kMap));
  const auto refused = [&](const std::string& text) {
    return bad_input([&] { static_cast<void>(read_scenario(write("a.scen", text), grid)); });
  };
  EXPECT_THAT(refused("version 2\n"), HasSubstr("a.scen:1:"));
  EXPECT_THAT(refused("version 1\n"), HasSubstr("no query"));
  EXPECT_THAT(refused("version 1\n0 a.map 3 2 0 0 2 0 2\n"), HasSubstr("9 fields"));
  EXPECT_THAT(refused("version 1\n0\ta.map\t4\t2\t0\t0\t2\t0\t2\n"),
              AllOf(HasSubstr("a.scen:2:"), HasSubstr("width 4")));
  EXPECT_THAT(refused("version 1\n0\ta.map\t3\t2\t0\t0\t3\t0\t2\n"),
              AllOf(HasSubstr("column of the goal"), HasSubstr("between 0 and 2")));
  EXPECT_THAT(refused("version 1\n0\ta.map\t3\t2\t0\t0\t2\t0\tnan\n"), HasSubstr("optimal length"));
}

TEST_F(MapFiles, ReadsPixelsByTheThresholds) {
  // 0 is black: occupied; 100: occupancy 0.608, between the thresholds; 205 unknown; 254 free.
  const std::string pixels = "P2\n# a comment\n5 1\n255\n0 100 205 210 254\n";
  const auto states = [](const Grid& grid) { return grid.cells; };
  using enum CellState;
  EXPECT_EQ(states(read_map(ros(pixels))),
            (std::vector<CellState>{kOccupied, kUnknown, kUnknown, kFree, kFree}));
  EXPECT_EQ(states(read_map(ros(pixels, "negate: 1\n"))),
            (std::vector<CellState>{kFree, kUnknown, kOccupied, kOccupied, kOccupied}));
  // The negative of a map that map_saver wrote: its unknown is 255 - 205.
  EXPECT_EQ(states(read_map(ros("P2 3 1 255 255 50 1", "negate: true\n"))),
            (std::vector<CellState>{kOccupied, kUnknown, kFree}));
  EXPECT_EQ(states(read_map(ros("P2 1 1 255 254", "negate: false\nunknown_thresh: 0.5\n"))),
            (std::vector<CellState>{kFree}));
  EXPECT_EQ(states(read_map(ros("P2 4 1 255 0 19 100 101", "mode: raw\n"))),
            (std::vector<CellState>{kFree, kFree, kOccupied, kUnknown}));
}

/// A row of a PNG. @param colour  0 grey, 3 palette, 4 grey and alpha, 6 RGBA.
std::string png(int colour, int depth, int width, const std::string& row,
                const std::vector<std::pair<std::string, std::string>>& chunks = {}) {
  const auto big_endian = [](std::uint32_t value) {
    std::string bytes;
    for (int shift = 24; shift >= 0; shift -= 8) bytes += static_cast<char>(value >> shift & 255);
    return bytes;
  };
  const auto chunk = [&](const std::string& name, const std::string& data) {
    const std::string covered = name + data;
    return big_endian(static_cast<std::uint32_t>(data.size())) + covered +
           big_endian(static_cast<std::uint32_t>(
               crc32_z(0, reinterpret_cast<const Bytef*>(covered.data()), covered.size())));
  };
  std::string text =
      "\x89PNG\r\n\x1a\n" + chunk("IHDR", big_endian(static_cast<std::uint32_t>(width)) +
                                              big_endian(1) + static_cast<char>(depth) +
                                              static_cast<char>(colour) + std::string(3, '\0'));
  for (const auto& [name, data] : chunks) text += chunk(name, data);
  const std::string rows = '\0' + row;
  std::string packed(compressBound(rows.size()), '\0');
  uLongf size = packed.size();
  compress(reinterpret_cast<Bytef*>(packed.data()), &size,
           reinterpret_cast<const Bytef*>(rows.data()), rows.size());
  return text + chunk("IDAT", packed.substr(0, size)) + chunk("IEND", "");
}

TEST_F(MapFiles, ReadsTransparentPixelsByTheTable) {
  using enum CellState;
  struct Row {
    const char* mode;
    bool negate;
    int grey, alpha;
    CellState expected;
  };
  // Occupied above 0.65, free below 0.196. With alpha in the mean: (3 * 255 + 10) / 4 = 193 is an
  // occupancy of 0.243.
  const Row table[] = {
      {"trinary", false, 255, 255, kFree},    {"trinary", false, 0, 255, kOccupied},
      {"trinary", false, 205, 255, kUnknown}, {"trinary", false, 255, 0, kUnknown},
      {"trinary", false, 0, 0, kUnknown},     {"trinary", false, 255, 254, kFree},
      {"trinary", false, 255, 10, kUnknown},  {"trinary", false, 60, 128, kOccupied},
      {"trinary", true, 0, 255, kFree},       {"trinary", true, 255, 255, kOccupied},
      {"trinary", true, 50, 255, kUnknown},   {"trinary", true, 0, 0, kUnknown},
      {"scale", false, 255, 255, kFree},      {"scale", false, 255, 254, kUnknown},
      {"scale", false, 0, 0, kUnknown},       {"scale", false, 0, 255, kOccupied},
      {"scale", true, 0, 254, kUnknown},      {"raw", false, 0, 255, kFree},
      {"raw", false, 100, 0, kOccupied},      {"raw", false, 101, 255, kUnknown},
      {"raw", true, 100, 255, kOccupied}};
  for (const Row& row : table) {
    const char grey = static_cast<char>(row.grey);
    const char alpha = static_cast<char>(row.alpha);
    const std::string more =
        std::string("mode: ") + row.mode + "\nnegate: " + (row.negate ? "1" : "0") + "\n";
    for (const auto& picture :
         {png(6, 8, 1, {grey, grey, grey, alpha}), png(4, 8, 1, {grey, alpha}),
          png(3, 8, 1, {'\1'}, {{"PLTE", {0, 0, 0, grey, grey, grey}}, {"tRNS", {'\0', alpha}}})}) {
      EXPECT_EQ(read_map(ros(picture, more)).cells, std::vector{row.expected})
          << more << row.grey << ' ' << row.alpha << " kind " << int(picture[25]);
    }
  }
}

TEST_F(MapFiles, ReadsTheTransparentGreyOfAPng) {
  using enum CellState;
  EXPECT_EQ(read_map(ros(png(0, 8, 3, {'\0', '\xfe', '\xff'}, {{"tRNS", {'\0', '\xff'}}}))).cells,
            (std::vector{kOccupied, kFree, kUnknown}));
  // Two bits a pixel: 0, 2, 3 are 0, 170, 255.
  EXPECT_EQ(read_map(ros(png(0, 2, 3, {'\x2c'}, {{"tRNS", {'\0', '\3'}}}))).cells,
            (std::vector{kOccupied, kUnknown, kUnknown}));
  EXPECT_EQ(read_map(ros(png(0, 2, 3, {'\x2c'}))).cells, (std::vector{kOccupied, kUnknown, kFree}));
}

TEST_F(MapFiles, RefusesDamagedRosMaps) {
  const auto refused = [this](const std::string& pgm, const std::string& more = "") {
    return bad_input([&] { static_cast<void>(read_map(ros(pgm, more))); });
  };
  EXPECT_THAT(refused("P5\n2 2\n255\nabc"), HasSubstr("3 bytes of pixels"));
  EXPECT_THAT(refused("P5\n2 2\n255\nabcde"), HasSubstr("5 bytes of pixels"));
  static_cast<void>(read_map(ros("P5\n2 2\n255\nabcd\r\n")));  // ends as a text does
  EXPECT_THAT(refused("P5\n1 1\n65535\nab"), HasSubstr("16 bits"));
  EXPECT_THAT(refused("P5\n1000000 1000000\n255\n"), HasSubstr("too many"));
  EXPECT_THAT(refused("P5\n0 1\n255\n"), HasSubstr("its width"));
  EXPECT_THAT(refused("P2 1 1 200 201"), HasSubstr("its pixel"));
  EXPECT_THAT(refused("P2 2 2 255 1 2 # cut off\n"), HasSubstr("ends after 2 of 4 pixels"));
  EXPECT_THAT(refused("not a picture"), HasSubstr("neither"));
  EXPECT_THAT(refused("P5\n1 1\n255\na", "colour: red\n"), HasSubstr("unknown key"));
  EXPECT_THAT(refused("P5\n1 1\n255\na", "mode: trinarry\n"), HasSubstr("trinary"));
  constexpr const char* kPlace =
      "resolution: 0.1\norigin: [0, 0, 0]\noccupied_thresh: 0.65\nfree_thresh: 0.196\n";
  write("n.yaml", "image: none.pgm\n" + std::string(kPlace));
  const auto missing = [this] {
    return bad_input([&] { static_cast<void>(read_map(folder_ / "n.yaml")); });
  };
  EXPECT_THAT(missing(), AllOf(HasSubstr("n.yaml:1: image"), HasSubstr("none.pgm")));
  write("n.yaml", "image: C:\\maps\\m.pgm\n" + std::string(kPlace));
  EXPECT_THAT(missing(), HasSubstr("n.yaml:1: image"));
  write("m.pgm", "P5\n1 1\n255\na");
  EXPECT_THAT(missing(), HasSubstr("beside this file: image: m.pgm"));
  EXPECT_THAT(bad_input([&] { static_cast<void>(read_map(folder_ / "m.pgm")); }),
              HasSubstr(".yaml of ROS"));
}

TEST(RosMap, GreysOfTheDepotAreUnknownAlthoughItsThresholdSaysFree) {
  PIRT_DATA_OR_SKIP(folder, "maps-nav2");
  const auto grid = read_map(folder / "depot.yaml");
  EXPECT_EQ(std::ranges::count(grid.cells, CellState::kFree), 170587);
  EXPECT_EQ(std::ranges::count(grid.cells, CellState::kUnknown), 8894);
  EXPECT_EQ(std::ranges::count(grid.cells, CellState::kOccupied), 5947);
}

}  // namespace
}  // namespace pirt::planning
