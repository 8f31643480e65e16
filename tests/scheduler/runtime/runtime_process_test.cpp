// What a runtime has of the thread and the process that make it: neither core nor class of the one,
// and no life in a child of the other.
#include <sched.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <filesystem>
#include <memory>
#include <semaphore>
#include <thread>

#include "tests/scheduler/runtime/runtime_support.h"
#include "workloads/base/system/affinity.h"

namespace pirt::test {
namespace {

using namespace std::chrono_literals;

/// Threads of this process, but the calling one.
int others_of_class(int wanted) {
  int count = 0;
  for (const auto& each : std::filesystem::directory_iterator("/proc/self/task")) {
    const pid_t thread = std::stoi(each.path().filename().string());
    if (thread != ::gettid() && ::sched_getscheduler(thread) == wanted) ++count;
  }
  return count;
}

TEST(Runtime, HasNeitherTheCoreNorTheClassOfTheThreadThatMakesIt) {
  const auto cores = usable_cores();
  if (cores.size() < 2) GTEST_SKIP() << "one core is all there is";
  const auto trace = std::filesystem::path(testing::TempDir()) / "pirt_runtime_process.json";
  auto options = options_with({}, R"(
platform: one
units: {cpu: {backend: fake, active_w: 1}}
)");
  std::vector<int> seen;
  options.workloads = {own("look", 0, [&](auto, auto) { seen = current_cores(); })};
  options.trace = trace.string();
  std::jthread([&] {
    bind_to_cores({cores.data(), 1}, "maker");
    const sched_param none{};
    ASSERT_EQ(::sched_setscheduler(0, SCHED_BATCH, &none), 0);
    Runtime runtime(std::move(options));
    EXPECT_EQ(runtime.submit("look", {}).wait(), TaskEnd::kCompleted);
    // Each thread begins when it likes.
    const auto until = std::chrono::steady_clock::now() + 5s;
    while (others_of_class(SCHED_BATCH) > 0 && std::chrono::steady_clock::now() < until) {
      std::this_thread::yield();
    }
    EXPECT_EQ(others_of_class(SCHED_BATCH), 0);
  }).join();
  std::filesystem::remove(trace);
  EXPECT_EQ(seen, cores);
}

TEST(Runtime, AChildThatWasForkedIsToldAndEnds) {
  std::binary_semaphore go(0);
  auto runtime = std::make_unique<Runtime>(
      options_with({own("waits", 0, [&](auto, auto) { go.acquire(); })}, kOneUnit));
  const auto waits = runtime->submit("waits", {});
  const pid_t child = ::fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    ::alarm(5);  // A child that waits for ever ends so.
    int refused = 0;
    const auto refuses = [&refused](const auto& call) {
      try {
        call();
      } catch (const Error& error) {
        if (error.code() == ErrorCode::kEnvironment) ++refused;
      }
    };
    refuses([&] { runtime->submit("waits", {}); });
    refuses([&] { runtime->cancel(waits); });
    refuses([&] { runtime->wait_all(); });
    refuses([&] { static_cast<void>(runtime->statistics()); });
    refuses([&] { runtime->bring_back("cpu"); });
    refuses([&] { waits.wait(); });
    runtime.reset();
    ::_exit(refused == 6 ? 0 : 1);
  }
  int status = 0;
  ASSERT_EQ(::waitpid(child, &status, 0), child);
  EXPECT_TRUE(WIFEXITED(status));
  EXPECT_EQ(WEXITSTATUS(status), 0);
  go.release();
  EXPECT_EQ(waits.wait(), TaskEnd::kCompleted);
}

}  // namespace
}  // namespace pirt::test
