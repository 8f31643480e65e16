// Equal pieces of work: what is measured of the usable cores, and where most of the pieces lie.
#include "characterize/doctor/jitter.h"

#include <gtest/gtest.h>

#include "workloads/base/error.h"
#include "workloads/base/system/affinity.h"

namespace pirt {
namespace {

using std::chrono::milliseconds;

TEST(Jitter, TimesPiecesOnEachCore) {
  const auto cores = current_cores();
  const auto found = measure_jitter(cores, milliseconds(100));
  ASSERT_EQ(found.cores.size(), cores.size());
  for (std::size_t i = 0; i < cores.size(); ++i) {
    EXPECT_EQ(found.cores[i].core, cores[i]);
    ASSERT_FALSE(found.cores[i].pieces.empty());
    for (const Nanos piece : found.cores[i].pieces) EXPECT_GT(piece, Nanos(0));
  }
  ASSERT_FALSE(found.reading.empty());
  for (const Nanos piece : found.reading) EXPECT_GT(piece, Nanos(0));
  EXPECT_EQ(current_cores(), cores) << "the caller's own affinity is left alone";
}

TEST(Jitter, HasAPieceHoweverShortTheTime) {
  const auto found = measure_jitter({current_cores().front()}, Nanos(1));
  ASSERT_EQ(found.cores.size(), 1U);
  EXPECT_EQ(found.cores[0].pieces.size(), 1U);
  EXPECT_EQ(found.reading.size(), 1U);
}

TEST(Jitter, RefusesACoreThatIsNotThere) {
  try {
    static_cast<void>(measure_jitter({100'000}, milliseconds(1)));
    FAIL() << "no error";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kEnvironment);
  }
}

TEST(Jitter, ItsRangeLeavesTheOutermostTwentiethsOut) {
  std::vector<Nanos> pieces;
  for (int i = 1; i <= 100; ++i) pieces.push_back(milliseconds(900 + 2 * i));  // median 1001
  const JitterRange range = range_of(pieces);
  EXPECT_NEAR(range.low, 910 / 1001.0, 1e-6);
  EXPECT_NEAR(range.high, 1090 / 1001.0, 1e-6);
  EXPECT_NEAR(range.spread(), 90 / 1001.0, 1e-6);
  pieces.back() = std::chrono::hours(1);
  EXPECT_NEAR(range_of(pieces).high, range.high, 1e-6) << "a single stop is no jitter";
  EXPECT_EQ(range_of(std::vector<Nanos>(7, milliseconds(5))).spread(), 0);
}

}  // namespace
}  // namespace pirt
