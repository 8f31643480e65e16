// Firings that are submitted by a template, beside the same as plain tasks.
#include <sstream>
#include <utility>

#include "tests/scheduler/support.h"
#include "workloads/base/math/random.h"

namespace pirt::test {
namespace {

/// Firings of one shape that come again and again: a chain of two that shares a state, and one that
/// reads what the last of its kind made.
std::vector<NamedTask> shape(TaskId first, std::vector<TaskId>& after) {
  after = {first};
  static constexpr SeriesId kRead[] = {0};
  std::vector<NamedTask> tasks = {
      task_of(first, {.eligible = kLocal}),
      task_of(first + 1, {.eligible = kLocal, .real_time = false}, after),
      task_of(first + 2, {.eligible = unit_bit(kGpu)})};
  tasks[0].series = 0;
  tasks[1].state = 0;
  tasks[2].reads = kRead;
  return tasks;
}

// The template is used again and again while its tasks wait, run and fail.
TEST(DispatcherTemplates, ATemplateIsWhatItsTasksAreSubmittedOneFiringAfterTheOther) {
  for (std::uint64_t seed = 0; seed < 60; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    Random random(seed);
    Script plain(policy_of("throughput", setup_of(2, 1, 2)), {1, 1, 2, 1});
    Script templated(policy_of("throughput", setup_of(2, 1, 2)), {1, 1, 2, 1});
    std::vector<TaskId> after;
    const auto of = templated.dispatcher().add_template(shape(900, after));
    std::vector<std::pair<UnitId, TaskId>> running;
    for (TaskId firing = 0; firing < 40; ++firing) {
      const auto tasks = shape(10 * firing, after);
      std::string said = plain.submit_all(firing, tasks);
      ASSERT_EQ(templated.submit_all(firing, tasks, of), said);
      for (int i = 0; i < 4; ++i) {
        for (std::istringstream words(said); words >> said;) {
          const auto unit = std::string("GDCL").find(said[0]);
          if (unit != std::string::npos) {
            running.emplace_back(static_cast<UnitId>(unit), std::stoull(said.substr(1)));
          }
        }
        said.clear();
        if (running.empty()) break;
        const auto at = running.begin() + static_cast<std::ptrdiff_t>(random.below(running.size()));
        const auto [unit, task] = *at;
        running.erase(at);
        const auto how = random.below(6) == 0 ? Outcome::kFailed : Outcome::kCompleted;
        said = plain.complete(unit, task, how);
        ASSERT_EQ(templated.complete(unit, task, how), said);
      }
    }
    ASSERT_EQ(plain.dispatcher().counts().completed, templated.dispatcher().counts().completed);
    ASSERT_GT(plain.dispatcher().counts().completed, 30);
  }
}

TEST(DispatcherTemplates, OfTasksThatMakeNoSenseThereIsNoneAndNothingIsSubmittedByIt) {
  Script script(policy_of("throughput", setup_of(2, 1, 2)), {1, 1, 2, 1});
  NamedDispatcher& dispatcher = script.dispatcher();
  std::vector<TaskId> after;
  auto tasks = shape(0, after);
  tasks[2].kind.eligible = 0;
  EXPECT_EQ(dispatcher.add_template(tasks), Dispatcher::kNoTemplate);
  tasks = shape(0, after);
  after = {7};  // It is none of these.
  EXPECT_EQ(dispatcher.add_template(tasks), Dispatcher::kNoTemplate);
  Effects out;
  EXPECT_FALSE(dispatcher.submit(1, Dispatcher::kNoTemplate, tasks, Nanos(0), out));
  EXPECT_EQ(dispatcher.counts().submitted, 0);
}

}  // namespace
}  // namespace pirt::test
