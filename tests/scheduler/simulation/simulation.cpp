// Usage: live_simulation robot|mix FIRST LAST          seeds, ends included
//        live_simulation robot|mix SEED --actions N    one of them, told step by step
// The seeds run in a process of their own, so that one that crashes, or hangs, has an end; then
// the shortest prefix of what it does from outside is looked for that fails as well.
#include "tests/scheduler/simulation/simulation.h"

#include <fmt/format.h>
#include <sched.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <string>

#include "scheduler/trace/replay.h"
#include "workloads/base/error.h"

namespace pirt::simulated {

void expect_replay(World& world, const std::filesystem::path& trace, bool complete) {
  if (!std::filesystem::exists(trace)) {
    if (complete) world.fail("there is no trace");
    return;
  }
  const FileReplay replay = replay_file(trace);
  if (replay.complete != complete) world.fail("the trace's end is not what it should be");
  if (const auto& at = replay.result.difference) {
    world.fail(fmt::format("the trace does not replay: {} at {:.6f} ms: {}, then {}", at->input,
                           to_ms(at->at), at->recorded, at->replayed));
  }
}

FullDisk::FullDisk() {
  const rlimit none{.rlim_cur = 0, .rlim_max = RLIM_INFINITY};
  ::setrlimit(RLIMIT_FSIZE, &none);
}
FullDisk::~FullDisk() {
  const rlimit all{.rlim_cur = RLIM_INFINITY, .rlim_max = RLIM_INFINITY};
  ::setrlimit(RLIMIT_FSIZE, &all);
}

namespace {

/// What a process says of itself, also when it has died.
struct Progress {
  std::uint64_t seed = 0;
  int actions = 0;
};

struct Work {
  std::string kind;
  std::filesystem::path folder;
  Progress* progress = nullptr;

  /// @return  A hash of what happened.
  std::uint64_t play(std::uint64_t number, int most_actions, bool tells) const {
    ::alarm(60);  // Of real time: a loop without a step.
    progress->seed = number;
    Seed seed{.number = number, .most_actions = most_actions, .folder = folder};
    World world({.seed = number, .tells = tells});
    try {
      progress->actions = kind == "robot" ? play_robot(world, seed) : play_mix(world, seed);
    } catch (const std::exception& error) {
      world.fail(std::string("thrown: ") + error.what());
    }
    return world.trail();
  }

  /// Whether the child did it without a failure.
  template <typename Body>
  [[nodiscard]] static bool in_child(bool silent, const Body& body) {
    std::fflush(nullptr);
    const pid_t child = ::fork();
    if (child == 0) {
      if (silent && std::freopen("/dev/null", "w", stderr) == nullptr) std::_Exit(3);
      body();
      std::fflush(nullptr);
      std::_Exit(0);
    }
    int status = 0;
    while (::waitpid(child, &status, 0) < 0) continue;
    if (!silent && WIFSIGNALED(status)) {
      std::fprintf(stderr, "%s\n", ::strsignal(WTERMSIG(status)));
    }
    return WIFEXITED(status) && WEXITSTATUS(status) == 0;
  }

  [[nodiscard]] bool fails(std::uint64_t seed, int actions) const {
    return !in_child(true, [&] { play(seed, actions, false); });
  }

  /// @return  0, or 1 where one has failed.
  [[nodiscard]] int run(std::uint64_t first, std::uint64_t last) const {
    constexpr std::uint64_t kTwice = 50;  // Every so many: the same happens again.
    const bool good = in_child(false, [&] {
      for (std::uint64_t seed = first; seed <= last; ++seed) {
        const std::uint64_t trail = play(seed, Seed().most_actions, false);
        if (seed % kTwice == 0 && play(seed, Seed().most_actions, false) != trail) {
          std::fprintf(stderr, "the seed gives something else each time\n");
          std::_Exit(1);
        }
      }
    });
    if (good) {
      std::printf("%s: seeds %llu to %llu hold\n", kind.c_str(),
                  static_cast<unsigned long long>(first), static_cast<unsigned long long>(last));
      return 0;
    }
    const std::uint64_t seed = progress->seed;
    std::fprintf(stderr, "%s: seed %llu fails\n", kind.c_str(),
                 static_cast<unsigned long long>(seed));
    constexpr int kMostActions = 120;
    for (int actions = 0; actions < kMostActions; ++actions) {
      if (!fails(seed, actions)) continue;
      std::fprintf(stderr, "so do its first %d actions: live_simulation %s %llu --actions %d\n",
                   actions, kind.c_str(), static_cast<unsigned long long>(seed), actions);
      break;
    }
    return 1;
  }
};

int simulate(int argc, char** argv) {
  const std::string kind = argc > 1 ? argv[1] : "";
  if (argc < 4 || (kind != "robot" && kind != "mix")) {
    std::fprintf(stderr, "live_simulation robot|mix FIRST LAST, or robot|mix SEED --actions N\n");
    return 2;
  }
  // Who hands on wakes a thread that would sleep on another core.
  cpu_set_t core;
  CPU_ZERO(&core);
  CPU_SET(static_cast<unsigned>(::sched_getcpu()), &core);
  ::sched_setaffinity(0, sizeof core, &core);
  static_cast<void>(std::signal(SIGXFSZ, SIG_IGN));
  auto* const shared =
      ::mmap(nullptr, sizeof(Progress), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
  std::string folder = (std::filesystem::temp_directory_path() / "pirt_simulation_XXXXXX").string();
  if (shared == MAP_FAILED || ::mkdtemp(folder.data()) == nullptr) return 4;
  const Work work{.kind = kind, .folder = folder, .progress = new (shared) Progress};
  const auto number = [&](int at) { return std::strtoull(argv[at], nullptr, 10); };
  int code = 0;
  if (std::string(argv[3]) == "--actions" && argc > 4) {
    code = Work::in_child(false, [&] { work.play(number(2), static_cast<int>(number(4)), true); })
               ? 0
               : 1;
  } else {
    code = work.run(number(2), number(3));
  }
  std::filesystem::remove_all(folder);
  return code;
}

}  // namespace
}  // namespace pirt::simulated

int main(int argc, char** argv) { return pirt::simulated::simulate(argc, argv); }
