// StarPU 1.3 (eager) and oneTBB's task_group.
#include <starpu.h>
#include <tbb/global_control.h>
#include <tbb/task_group.h>

#include <atomic>
#include <chrono>
#include <cstdlib>
#include <memory>

#include "tests/bench/peers/tasks.h"

namespace pirt::bench {
namespace {

double since(std::chrono::steady_clock::time_point begin) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
}

std::atomic<int> heard = 0;

extern "C" void nothing(void** /*buffers*/, void* /*argument*/) {}
extern "C" void hear(void* /*argument*/) { ++heard; }

double run_starpu(int tasks, bool chain) {
  static starpu_codelet codelet;
  codelet.cpu_funcs[0] = nothing;
  codelet.nbuffers = 0;
  heard = 0;
  starpu_resume();
  const auto begin = std::chrono::steady_clock::now();
  // Held until all is submitted: a task whose predecessor is destroyed cannot name it.
  std::vector<starpu_task*> all;
  if (chain) all.reserve(static_cast<std::size_t>(tasks));
  for (int i = 0; i < tasks; ++i) {
    starpu_task* task = starpu_task_create();
    task->cl = &codelet;
    task->callback_func = hear;
    if (chain) {
      task->destroy = 0;
      if (i > 0) starpu_task_declare_deps_array(task, 1, &all.back());
      all.push_back(task);
    }
    if (starpu_task_submit(task) != 0) std::abort();
  }
  starpu_task_wait_for_all();
  const double elapsed_s = since(begin);
  starpu_pause();  // Its workers look for tasks all the time, on the cores of the others.
  for (starpu_task* task : all) starpu_task_destroy(task);
  if (heard != tasks) std::abort();
  return elapsed_s;
}

double run_tbb(int tasks, bool chain) {
  heard = 0;
  tbb::task_group group;
  const auto begin = std::chrono::steady_clock::now();
  if (chain) {
    std::function<void(int)> next = [&](int left) {
      ++heard;
      if (left > 1) group.run([&next, left] { next(left - 1); });
    };
    group.run([&] { next(tasks); });
  } else {
    for (int i = 0; i < tasks; ++i) group.run([] { ++heard; });
  }
  group.wait();
  const double elapsed_s = since(begin);
  if (heard != tasks) std::abort();
  return elapsed_s;
}

}  // namespace

std::vector<TaskPeer> task_peers() {
  starpu_conf conf;
  starpu_conf_init(&conf);
  conf.ncpus = 2;
  conf.ncuda = 0;
  conf.nopencl = 0;
  conf.sched_policy_name = "eager";
  std::vector<TaskPeer> peers;
  if (starpu_init(&conf) == 0) {
    starpu_pause();
    peers.push_back({"StarPU 1.3 eager", run_starpu});
  }
  static const tbb::global_control two(tbb::global_control::max_allowed_parallelism, 2);
  peers.push_back({"oneTBB task_group", run_tbb});
  return peers;
}

}  // namespace pirt::bench
