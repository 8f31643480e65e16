// The cores of backend fpga by themselves, against the definitions of their workloads or, where
// they have numbers of their own, against a model of these, to the last bit; and how many cycles
// they take.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>

#include "tests/workloads/backends/fpga/fpga_support.h"
#include "workloads/backends/fpga/sdram.h"
#include "workloads/backends/fpga/simulation.h"
#include "workloads/base/math/random.h"
#include "workloads/catalog/catalog.h"

namespace pirt {
namespace {

/// What comes out of @p core, whose sides stop at random if there is a seed, and how often what it
/// showed changed although it was not taken.
struct Observed {
  std::vector<std::uint64_t> out;
  int withdrawn = 0;
};

Observed pass(fpga::Core& core, const test::CoreCase& one, std::uint64_t seed) {
  Random random(seed);
  const auto stops = [&] { return seed != 0 && random.below(3) == 0; };
  Observed observed;
  std::size_t taken = 0;
  bool waits = false;  // for out_ready, with what was shown before
  std::uint64_t shown_before = 0;
  for (int cycle = 0; observed.out.size() < one.expected.size() && cycle < 2'000'000; ++cycle) {
    const bool has_more = taken < one.in.size();
    const fpga::Driven driven{.in_valid = has_more && !stops(),
                              .in_data = has_more ? one.in[taken] : ~std::uint64_t{0},
                              .out_ready = !stops()};
    const fpga::Shown shown = core.show(driven);
    if (waits && (!shown.out_valid || shown.out_data != shown_before)) ++observed.withdrawn;
    if (driven.in_valid && shown.in_ready) ++taken;
    if (shown.out_valid && driven.out_ready) observed.out.push_back(shown.out_data);
    waits = shown.out_valid && !driven.out_ready;
    shown_before = shown.out_data;
    core.clock();
  }
  return observed;
}

class FpgaCore : public testing::TestWithParam<std::string> {};

// Widths below, at and beside what a window spans; a single row where the core allows it.
constexpr std::array<std::pair<int, int>, 8> kSizes = {
    {{8, 4}, {9, 7}, {26, 1}, {27, 5}, {52, 3}, {53, 53}, {64, 30}, {131, 61}}};

TEST_P(FpgaCore, IsExactAtOddSizesWhoeverWaits) {
  const auto core = fpga::find_core(GetParam()).make();
  const auto& type = fpga::find_core(GetParam());
  int computed = 0;
  for (const auto& [width, height] : kSizes) {
    if (width < type.min_width || height < type.min_height) continue;
    const auto one = test::core_case(GetParam(), width, height);
    for (std::uint64_t seed = 0; seed <= 10; ++seed) {
      core->start(width, height, one.parameters);
      // A second picture follows without a reset.
      for (int picture = 0; picture < 2; ++picture) {
        const auto [out, withdrawn] = pass(*core, one, seed);
        ASSERT_EQ(out, one.expected)
            << width << "x" << height << ", seed " << seed << ", picture " << picture;
        ASSERT_EQ(withdrawn, 0);
      }
      ++computed;
    }
  }
  EXPECT_GE(computed, 5 * 11);
}

// White, and edges of black and white in each direction, alone, in steps of two and all over: the
// largest gradients, products and sums of them.
TEST_P(FpgaCore, IsExactWherePicturesAreExtreme) {
  constexpr std::array<test::Pixel*, 6> kPictures = {
      [](int, int) -> std::uint8_t { return 255; },
      [](int x, int y) -> std::uint8_t { return (x + y) % 2 == 0 ? 255 : 0; },
      [](int x, int) -> std::uint8_t { return x / 2 % 2 == 0 ? 255 : 0; },
      [](int, int y) -> std::uint8_t { return y / 2 % 2 == 0 ? 255 : 0; },
      [](int x, int y) -> std::uint8_t { return (x / 2 + y / 2) % 2 == 0 ? 255 : 0; },
      [](int x, int y) -> std::uint8_t { return x > 30 && y > 28 ? 255 : 0; }};
  const auto core = fpga::find_core(GetParam()).make();
  for (std::size_t i = 0; i < kPictures.size(); ++i) {
    const auto one = test::core_case(GetParam(), 64, 60, kPictures[i]);
    core->start(64, 60, one.parameters);
    EXPECT_EQ(pass(*core, one, 0).out, one.expected) << "picture " << i;
  }
}

// A pixel a cycle: 5 % for the rows that a window waits for and for the pipeline. optical_flow's
// window waits for 26 rows of 480, which is its limit of 0.33 M cycles; undistort waits for as many
// as the lens of the catalog bends lines by, and two.
TEST_P(FpgaCore, TakesAPixelACycle) {
  const std::string name = GetParam();
  const int width = name == "sobel" ? 1920 : 640, height = name == "sobel" ? 1080 : 480;
  const auto workload = test::workload_of_core(name, width, height);
  const auto data = test::data_of_seed_1(workload);
  const auto call = fpga::find_kernel(workload.kernel)->make(workload, data.parameters);
  const auto core = fpga::find_core(name).make();
  // Only how many elements there are matters.
  std::vector<std::byte> out(static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
  auto in = call.in[0].memory;
  const auto cycles =
      fpga::cycles_alone(*core, {width, height, call.parameters, {{in, 1}}, {{out, 1}}});
  const double pixels = 1.0 * width * height;
  double limit = 1.05 * pixels;
  if (name == "optical_flow") limit = 330'000;
  if (name == "undistort") limit = 1.005 * static_cast<double>(in.size());
  EXPECT_GE(static_cast<double>(cycles), pixels);
  EXPECT_LE(static_cast<double>(cycles), limit);
}

std::vector<std::string> core_names() {
  std::vector<std::string> names;
  for (const auto& core : fpga::cores()) {
    if (core.max_width > 0) names.emplace_back(core.name);
  }
  return names;
}
INSTANTIATE_TEST_SUITE_P(All, FpgaCore, testing::ValuesIn(core_names()),
                         [](const auto& test) { return test.param; });

// Windows in which all is at its extreme: 52 * 52 products of 255 * 255, the largest that there
// are, and of both signs.
TEST(FpgaOpticalFlow, IsExactWhereSumsAreLargest) {
  const int width = 60, height = 57;
  auto one = test::core_case("optical_flow", width, height);
  Data data;
  for (int picture = 0; picture < 2; ++picture)
    data.inputs.push_back(test::noise_picture(width, height, 1));
  for (std::size_t i = 0; i < one.in.size(); ++i) {
    const auto x = i % 60, y = i / 60;
    const bool bright = (x / 2 + y / 2) % 2 == 0;
    data.inputs[0].as<std::uint8_t>()[i] = bright ? 255 : 0;
    data.inputs[1].as<std::uint8_t>()[i] = (x / 2) % 2 == 0 ? 0 : 255;
  }
  one.in = test::elements_of(data.inputs, one.in.size());
  one.expected = test::flow_model(data, width, height);
  const auto core = fpga::find_core("optical_flow").make();
  core->start(width, height, {});
  EXPECT_EQ(pass(*core, one, 0).out, one.expected);
}

/// Cycles of the SDRAM until all of @p streams has moved, with another side that is always fast
/// enough and takes what it reads in the next cycle.
std::int64_t sdram_cycles(std::vector<fpga::Stream> streams) {
  fpga::Sdram sdram({}, streams);
  for (std::int64_t cycle = 0;; ++cycle) {
    for (fpga::Stream& stream : streams) {
      if (stream.reads()) {
        stream.take(static_cast<int>(std::min<std::size_t>(8, stream.queued())));
      }
    }
    if (std::ranges::all_of(streams, &fpga::Stream::is_done)) return cycle;
    sdram.clock();
  }
}

fpga::Stream read_of(std::vector<std::byte>& memory, std::int64_t words) {
  memory.resize(static_cast<std::size_t>(2 * words));
  return fpga::Stream::reading(memory);
}

// A row is opened (3 cycles), the first word comes 3 later, then one a cycle.
TEST(FpgaSdram, WaitsForARowAndForTheFirstWord) {
  std::vector<std::byte> memory;
  EXPECT_EQ(sdram_cycles({read_of(memory, 64)}), 3 + 3 + 64);
  EXPECT_EQ(sdram_cycles({read_of(memory, 200)}), 3 + 3 + 200);  // bursts follow one another
}

// Word 1025 lies in another row: the first one is closed (3), the other opened (3), its first word
// waited for (3).
TEST(FpgaSdram, ClosesARowBeforeItOpensTheNext) {
  std::vector<std::byte> memory;
  EXPECT_EQ(sdram_cycles({read_of(memory, 1025)}), 6 + 1024 + 9 + 1);
}

// In cycle 1117 a refresh is due: after the burst that is under way all rows are closed (3) and one
// is refreshed (9), and the stream's is opened again (6).
TEST(FpgaSdram, RefreshesBetweenBursts) {
  std::vector<std::byte> memory;
  EXPECT_EQ(sdram_cycles({read_of(memory, 1200)}), 6 + 1024 + 9 + 176 + 3 + 9 + 6);
}

// Each in a bank of its own: between the last word read and the first written, the writer's row is
// opened (3) and the bus turns (1).
TEST(FpgaSdram, TurnsTheBusBetweenReadingAndWriting) {
  std::vector<std::byte> from, to(128);
  std::vector<fpga::Stream> streams = {read_of(from, 64), fpga::Stream::writing(to)};
  for (int i = 0; i < 128; ++i) streams[1].give(static_cast<std::uint64_t>(i), 1);
  EXPECT_EQ(sdram_cycles(streams), 6 + 64 + 3 + 1 + 64);
}

}  // namespace
}  // namespace pirt
