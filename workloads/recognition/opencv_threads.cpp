#include "workloads/recognition/opencv_threads.h"

#include <condition_variable>
#include <mutex>
#include <opencv2/core.hpp>

namespace pirt::recognition {
namespace {

struct InUse {
  std::mutex mutex;
  std::condition_variable changed;
  int users = 0;
  int waiting = 0;  ///< For more than one thread: who wants one lets them go first.
  int count = 0;    ///< Of the users.
  int before = 0;   ///< To be set again when none is left.
};

InUse& of_process() {
  static auto& all = *new InUse;  // Never destroyed: a call that hangs may outlive main.
  return all;
}

}  // namespace

OpencvThreads::OpencvThreads(int count) : count_(count) {
  if (count_ == 0) return;
  InUse& all = of_process();
  std::unique_lock lock(all.mutex);
  const bool alone = count_ > 1;
  all.waiting += alone ? 1 : 0;
  all.changed.wait(
      lock, [&] { return all.users == 0 || (!alone && all.count == 1 && all.waiting == 0); });
  all.waiting -= alone ? 1 : 0;
  if (all.users++ > 0) return;
  all.count = count_;
  all.before = cv::getNumThreads();
  cv::setNumThreads(count_);
}

OpencvThreads::~OpencvThreads() {
  if (count_ == 0) return;
  InUse& all = of_process();
  const std::lock_guard lock(all.mutex);
  if (--all.users > 0) return;
  cv::setNumThreads(all.before);
  all.changed.notify_all();
}

void compute_on_calling_thread() {
  InUse& all = of_process();
  const std::lock_guard lock(all.mutex);
  if (all.users > 0) {
    all.before = 1;
  } else if (cv::getNumThreads() != 1) {
    cv::setNumThreads(1);
  }
}

}  // namespace pirt::recognition
