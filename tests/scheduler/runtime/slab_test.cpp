// Records that are used again: each is one thread's at a time, and the slab goes with the last.
#include "scheduler/runtime/slab.h"

#include <gtest/gtest.h>

#include <set>
#include <thread>
#include <vector>

namespace pirt {
namespace {

struct Record {
  explicit Record() { ++there(); }
  ~Record() { --there(); }
  Record(const Record&) = delete;
  Record& operator=(const Record&) = delete;
  static std::atomic<int>& there() {
    static std::atomic<int> count = 0;
    return count;
  }

  runtime::Slab<Record>::Place place;
  std::atomic<int> owners = 0;
};

TEST(Slab, GivesEachRecordToOneAtATimeWithAPlaceOfItsOwn) {
  auto& slab = runtime::Slab<Record>::make();
  std::vector<Record*> taken;
  std::set<std::uint32_t> places;
  for (int i = 0; i < 1000; ++i) {
    taken.push_back(&slab.take());
    EXPECT_TRUE(places.insert(taken.back()->place.index).second);
    EXPECT_EQ(&slab.at(taken.back()->place.index), taken.back());
  }
  slab.give_back(*taken.back());
  EXPECT_EQ(&slab.take(), taken.back()) << "its memory is in a cache yet";
  for (Record* each : taken) slab.give_back(*each);
  slab.close();
  EXPECT_EQ(Record::there(), 0);
}

TEST(Slab, GoesWhenItsOwnerHasGoneAndTheLastRecordHasComeBack) {
  for (int round = 0; round < 200; ++round) {
    auto& slab = runtime::Slab<Record>::make();
    std::vector<std::jthread> threads;
    std::atomic<int> wrong = 0, begun = 0;
    for (int i = 0; i < 3; ++i) {
      threads.emplace_back([&] {
        std::vector<Record*> mine;
        for (int step = 0; step < 300; ++step) {
          if (step % 3 != 2) {
            mine.push_back(&slab.take());
            if (mine.back()->owners.fetch_add(1) != 0) ++wrong;
          } else {
            mine.back()->owners.fetch_sub(1);
            slab.give_back(*mine.back());
            mine.pop_back();
          }
        }
        ++begun;
        while (begun < 4) std::this_thread::yield();
        for (Record* each : mine) {
          each->owners.fetch_sub(1);
          slab.give_back(*each);
        }
      });
    }
    while (begun < 3) std::this_thread::yield();
    ++begun;
    slab.close();  // While they come back.
    threads.clear();
    EXPECT_EQ(wrong, 0);
    EXPECT_EQ(Record::there(), 0);
  }
}

}  // namespace
}  // namespace pirt
