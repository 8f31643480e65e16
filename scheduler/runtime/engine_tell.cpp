// Who hears of what: futures, callbacks, and problems, when the turn is over.
#include <utility>

#include "scheduler/runtime/engine.h"

namespace pirt {

/// To `problem`, without the turn.
void Runtime::Engine::post_line(const std::string& line) {
  if (!options_.problem) return;
  const std::lock_guard lock(telling_);
  to_say_.push_back(line);
  anything_to_tell_ = true;
}

/// What is no problem yet: to `progress` while the runtime starts.
void Runtime::Engine::say(const std::string& line) {
  if (!starting_) {
    post_line(line);
    if (options_.problem) wake_watcher();
    return;
  }
  if (options_.progress) options_.progress(line);
}

void Runtime::Engine::add_problem(std::string problem) {
  post_line(problem);
  problems_.add(std::move(problem));
}

/// Without the turn: callbacks, and who hears that an input is free, may submit.
void Runtime::Engine::tell(TaskChain& ended, Thread thread) {
  const runtime::MustNotWait within;
  const bool ours = thread == Thread::kOurs;
  bool posted = false;
  while (!ended.empty()) {
    TaskRef task(ended.take_first());
    task->inputs.clear();
    task->options.after.clear();
    if (!task->callback) {
      told(std::move(task));
    } else if (ours) {
      call_back(std::move(task));
    } else {
      const std::lock_guard lock(telling_);
      to_tell_.push(task.release());
      posted = anything_to_tell_ = true;
    }
  }
  if (ours && anything_to_tell_) tell_posted();
  if (!ours && (posted || anything_to_tell_)) wake_watcher();
}

/// What ended in the turn of somebody else's thread, and problems.
void Runtime::Engine::tell_posted() {
  while (anything_to_tell_.exchange(false)) {
    TaskChain tasks;
    std::vector<std::string> problems;
    {
      const std::lock_guard lock(telling_);
      tasks.append(to_tell_);
      std::swap(problems, to_say_);
    }
    for (const std::string& each : problems) {
      try {
        options_.problem(each);
      } catch (...) {  // There is nobody else to tell.
      }
    }
    while (!tasks.empty()) call_back(TaskRef(tasks.take_first()));
  }
}

void Runtime::Engine::call_back(TaskRef task) {
  std::string thrown;
  TaskFuture future(std::move(task));
  try {
    future.task_->callback(future, *future.end());
  } catch (const std::exception& error) {
    thrown = error.what();
  } catch (...) {
    thrown = "an exception of an unknown type";
  }
  future.task_->callback = nullptr;
  if (!thrown.empty()) {
    {
      const auto turn = turn_.take();
      add_problem("callback of " + future.task_->workload->name + ": " + thrown);
    }
    wake_watcher();  // What was posted for who had the turn.
  }
  told(std::move(future.task_));
}

void Runtime::Engine::told(TaskRef task) {
  task->told.set();
  task = {};
  room_.leave();
}

}  // namespace pirt
