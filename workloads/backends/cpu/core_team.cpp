#include "workloads/backends/cpu/core_team.h"

#include <array>
#include <utility>

#include "workloads/base/error.h"
#include "workloads/base/system/affinity.h"
#include "workloads/base/system/thread.h"

namespace pirt::cpu {

CoreTeam::CoreTeam(const std::vector<int>& cores)
    : begin_(static_cast<std::ptrdiff_t>(cores.size()) + 1),
      end_(static_cast<std::ptrdiff_t>(cores.size()) + 1) {
  threads_.reserve(cores.size());
  try {
    for (std::size_t i = 0; i < cores.size(); ++i) {
      threads_.push_back(
          start_thread([this, i, core = cores[i]] { work(static_cast<int>(i), core); }));
    }
  } catch (...) {
    // In the place of those that are missing and of this one, so that the others end.
    static_cast<void>(
        begin_.arrive(static_cast<std::ptrdiff_t>(cores.size() + 1 - threads_.size())));
    throw;
  }
}

CoreTeam::~CoreTeam() {
  body_ = nullptr;
  begin_.arrive_and_wait();
}

void CoreTeam::run(const std::function<void(int)>& body) {
  body_ = &body;
  begin_.arrive_and_wait();
  end_.arrive_and_wait();
  const std::lock_guard lock(mutex_);
  if (failure_) std::rethrow_exception(std::exchange(failure_, nullptr));
}

void CoreTeam::work(int index, int core) {
  try {
    bind_to_cores(std::array{core}, "cpu");
  } catch (const std::exception&) {
    // The core went away since it was listed: slower on another one, and still right.
  }
  while (true) {
    begin_.arrive_and_wait();
    if (body_ == nullptr) return;
    try {
      (*body_)(index);
    } catch (...) {
      const std::lock_guard lock(mutex_);
      if (!failure_) failure_ = std::current_exception();
    }
    end_.arrive_and_wait();
  }
}

}  // namespace pirt::cpu
