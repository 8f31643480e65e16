// Queues of tasks, beside plain ones in the same order, and what finding a place in them costs.
#include "scheduler/dispatcher/task_list.h"

#include <cmath>
#include <map>

#include "tests/scheduler/support.h"
#include "workloads/base/math/random.h"

namespace pirt::test {
namespace {

struct Counting {
  std::int64_t* compared = nullptr;
  bool operator()(const TaskRecord& a, const TaskRecord& b) const {
    ++*compared;
    return precedes(a, b);
  }
};

TaskSlot add(TaskStore& store, Nanos rank, std::uint64_t sequence) {
  const TaskSlot slot = store.add(store.add_firing());
  store[slot].rank = rank;
  store[slot].sequence = sequence;
  return slot;
}

// Long queues and short ones, whose ranks are all the same, few or many; tasks come with new
// sequences and with those of before, and leave from the front or from anywhere.
TEST(TaskList, ServesByRankAndThenInOrderWhateverComesAndLeaves) {
  for (std::uint64_t seed = 0; seed < 40; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    Random random(seed);
    const std::uint64_t ranks = std::uint64_t{1} << 4 * (seed % 4);
    TaskStore store;
    TaskList queue;
    std::map<std::pair<Nanos, std::uint64_t>, TaskSlot> model;
    std::vector<TaskSlot> left;
    std::uint64_t sequence = 0;
    for (int step = 0; step < 4000; ++step) {
      // It grows for a while, and then shrinks to nothing.
      const bool grows = random.below(10) < (step % 1000 < 500 ? 7U : 3U);
      if (grows && !left.empty() && random.below(4) == 0) {
        const TaskSlot back = left.back();
        left.pop_back();
        queue.insert(store, back);
        model[{store[back].rank, store[back].sequence}] = back;
      } else if (grows) {
        ++sequence;
        const auto rank = Nanos(random.below(ranks));
        const TaskSlot slot = add(store, rank, sequence);
        queue.insert(store, slot);
        model[{rank, sequence}] = slot;
      } else if (!model.empty()) {
        const std::uint64_t last = random.below(2) == 0 ? 1 : model.size();
        const auto at = std::next(model.begin(), static_cast<std::ptrdiff_t>(random.below(last)));
        queue.erase(store, at->second);
        left.push_back(at->second);
        model.erase(at);
      }
      ASSERT_EQ(queue.empty(), model.empty());
      TaskSlot each = queue.front();
      if (step % 50 != 0) continue;
      for (const auto& [key, slot] : model) {
        ASSERT_EQ(each, slot);
        each = store[each].next;
      }
      ASSERT_EQ(each, kNoSlot);
    }
  }
}

// A task more among n of random deadlines takes some 2 log2 n comparisons, not n / 4.
TEST(TaskList, FindsAPlaceAmongManyInLogarithmicTime) {
  for (const int tasks : {1'000, 32'000}) {
    Random random(7);
    std::int64_t compared = 0;
    TaskStore store;
    OrderedTasks<Counting> queue(Counting{&compared});
    for (int i = 0; i < 2 * tasks; ++i) {
      if (i == tasks) compared = 0;
      queue.insert(store,
                   add(store, Nanos(random.below(1'000'000)), static_cast<std::uint64_t>(i)));
      if (i >= tasks) queue.erase(store, queue.front());
    }
    EXPECT_LE(static_cast<double>(compared) / tasks, 4 * std::log2(tasks)) << tasks;
  }
}

// The same through a dispatcher: what waits for a unit in mode edf starts by its deadline.
TEST(TaskList, TasksThatWaitStartByTheirDeadlines) {
  PolicySetup setup = setup_of(1, 1, 1);
  setup.servers = {1, 1, 1, 1};
  setup.costs = {
      {CallCost{.total = Nanos(5), .occupied = Nanos(5)}, CallCost{}, CallCost{}, CallCost{}}};
  NamedDispatcher dispatcher({1, 1, 1, 1}, policy_of("edf", setup));
  Random random(3);
  Effects out;
  std::multimap<Nanos, TaskId> waiting;  // Equal ones in order of submission.
  TaskId running = 0;
  for (TaskId id = 0; id < 500; ++id) {
    const auto deadline = Nanos(1'000 + random.below(300));
    NamedTask task = task_of(id, {.eligible = unit_bit(kGpu)});
    task.deadline = deadline;
    ASSERT_TRUE(dispatcher.submit(id, std::span(&task, 1), Nanos(0), out));
    if (id > 0) waiting.emplace(deadline, id);
    if (id % 7 == 6) {
      const auto gone = std::next(waiting.begin(), static_cast<int>(random.below(waiting.size())));
      dispatcher.cancel(gone->second, Nanos(0), out);
      waiting.erase(gone);
    }
  }
  out.clear();
  for (Nanos now{5}; !waiting.empty(); now += Nanos(5)) {
    ASSERT_TRUE(dispatcher.complete(kGpu, running, Outcome::kCompleted, now, out));
    ASSERT_EQ(out.started.size(), 1U);
    running = out.started[0].task;
    ASSERT_EQ(running, waiting.begin()->second);
    waiting.erase(waiting.begin());
    out.clear();
  }
}

}  // namespace
}  // namespace pirt::test
