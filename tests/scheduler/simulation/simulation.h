// Seeds of simulated runs: what happens in each, and what has to hold.
#pragma once

#include <cstdint>
#include <filesystem>
#include <limits>

#include "tests/scheduler/simulation/world.h"

namespace pirt::simulated {

struct Seed {
  std::uint64_t number = 0;
  /// Of what is done from outside, only so much: less than all of it tells where it goes wrong.
  int most_actions = std::numeric_limits<int>::max();
  std::filesystem::path folder;  ///< For its trace.
};

/// A robot's program: threads that submit, cancel, wait, ask and bring back, to the end of their
/// Runtime. Fails the world where one of these does not hold:
/// - every task ends once, is told once, and its value is that of its inputs;
/// - nobody writes what somebody reads, a future's holder too;
/// - statistics balance at every moment, and tell in the end what callbacks have heard;
/// - a state is what the tasks made of it that completed;
/// - the trace replays, with its end or without;
/// - all threads end, and inputs are let go of.
/// @return  How many actions there were.
int play_robot(World& world, const Seed& seed);

/// A mix, live: the same for its tasks, firings and record. A firing counts from when it was due;
/// signals end it.
int play_mix(World& world, const Seed& seed);

/// The trace gives the same decisions again; one that is not complete, up to where it ends.
/// @param complete  It was finished.
void expect_replay(World& world, const std::filesystem::path& trace, bool complete);

/// No byte more can be written to files for as long as it is there.
class FullDisk {
 public:
  FullDisk();
  ~FullDisk();
  FullDisk(const FullDisk&) = delete;
  FullDisk& operator=(const FullDisk&) = delete;
};

}  // namespace pirt::simulated
