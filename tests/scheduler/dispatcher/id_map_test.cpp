// Ids and where they are found, beside a map of the library.
#include "scheduler/dispatcher/id_map.h"

#include <gtest/gtest.h>

#include <iterator>
#include <map>

#include "workloads/base/math/random.h"

namespace pirt::test {
namespace {

// Dense ids, rising ones, handles that are used again and ids that share their lower bits.
TEST(IdMap, IdsAreFoundWhateverTheyAre) {
  for (std::uint64_t seed = 0; seed < 60; ++seed) {
    Random random(seed);
    IdMap map;
    std::map<TaskId, std::uint32_t> model;
    TaskId number = 0;
    for (std::uint32_t step = 0; step < 3000; ++step) {
      const TaskId ids[] = {random.below(300), ++number, number << 32 | random.below(100),
                            random.below(200) << 20, ~random.below(50)};
      const TaskId id = ids[seed % 6 < 5 ? seed % 6 : random.below(5)];
      ASSERT_EQ(map.insert(id, step), model.emplace(id, step).second);
      while (!model.empty() && random.below(200) < model.size()) {
        const auto gone = std::next(model.begin(), static_cast<int>(random.below(model.size())));
        map.erase(gone->first);
        ASSERT_EQ(map.find(gone->first), IdMap::kAbsent);
        model.erase(gone);
      }
      const TaskId asked =
          step % 2 == 0 || model.empty() ? random.below(300) : model.begin()->first;
      const auto known = model.find(asked);
      ASSERT_EQ(map.find(asked), known == model.end() ? IdMap::kAbsent : known->second);
    }
    for (const auto& [id, value] : model) ASSERT_EQ(map.find(id), value);
  }
}

}  // namespace
}  // namespace pirt::test
