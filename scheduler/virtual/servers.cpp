#include "scheduler/virtual/servers.h"

#include <algorithm>
#include <cassert>
#include <deque>
#include <functional>
#include <utility>
#include <vector>

namespace pirt {
namespace {

/// Each server takes one job at a time, in order of arrival.
class FifoServers final : public Servers {
 public:
  FifoServers(int servers, Begins begins) : begins_(std::move(begins)), idle_(servers) {}

  void arrive(JobId job, Nanos work, std::uint64_t sequence, Nanos now) override {
    if (idle_ == 0) {
      waiting_.push_back({job, work, sequence});
      return;
    }
    --idle_;
    serve({job, work, sequence}, now);
  }

  std::optional<Nanos> lengthen(JobId job, Nanos by, Nanos now) override {
    const auto found = std::ranges::find(busy_, job, &Busy::job);
    if (found == busy_.end()) return std::nullopt;
    const Nanos left = found->end.time - now;
    found->end.time += by;
    std::ranges::make_heap(busy_, std::greater{});
    next_ = busy_.front().end;
    return left;
  }

  JobId complete_next() override {
    assert(!busy_.empty());
    std::ranges::pop_heap(busy_, std::greater{});
    const Busy done = busy_.back();
    busy_.pop_back();
    serve_next(done.end.time);
    return done.job;
  }

  std::optional<JobId> unchallenged() const override {
    return waiting_.empty() ? std::optional(busy_.front().job) : std::nullopt;
  }

  void go_on(Nanos work, std::uint64_t sequence) override {
    if (busy_.size() > 1) std::ranges::pop_heap(busy_, std::greater{});
    busy_.back().end = {busy_.back().end.time + work, sequence};
    if (busy_.size() > 1) std::ranges::push_heap(busy_, std::greater{});
    next_ = busy_.front().end;
  }

  std::optional<Nanos> remove(JobId job, Nanos now) override {
    if (const auto at = std::ranges::find(waiting_, job, &Waiting::job); at != waiting_.end()) {
      const Nanos work = at->work;
      waiting_.erase(at);
      return work;
    }
    const auto at = std::ranges::find(busy_, job, &Busy::job);
    if (at == busy_.end()) return std::nullopt;
    const Nanos rest = at->end.time - now;
    busy_.erase(at);
    std::ranges::make_heap(busy_, std::greater{});
    serve_next(now);
    return rest;
  }

  std::vector<std::pair<JobId, Nanos>> remaining(Nanos now) const override {
    std::vector<std::pair<JobId, Nanos>> jobs;
    for (const Busy& each : busy_) jobs.emplace_back(each.job, each.end.time - now);
    for (const Waiting& each : waiting_) jobs.emplace_back(each.job, each.work);
    return jobs;
  }

 private:
  struct Waiting {
    JobId job = 0;
    Nanos work{0};
    std::uint64_t sequence = 0;
  };
  struct Busy {
    Moment end;
    JobId job = 0;
    friend auto operator<=>(const Busy&, const Busy&) = default;
  };

  void serve(const Waiting& job, Nanos now) {
    const Nanos work = begins_ ? begins_(job.job, job.work) : job.work;
    busy_.push_back({{now + work, job.sequence}, job.job});
    std::ranges::push_heap(busy_, std::greater{});
    next_ = busy_.front().end;
  }

  /// A server is free: it begins with who has waited longest.
  void serve_next(Nanos now) {
    if (waiting_.empty()) {
      ++idle_;
      next_ = busy_.empty() ? Moment{} : busy_.front().end;
    } else {
      const Waiting first = waiting_.front();
      waiting_.pop_front();
      serve(first, now);
    }
  }

  Begins begins_;
  int idle_;
  std::vector<Busy> busy_;  ///< A heap, earliest first.
  std::deque<Waiting> waiting_;
};

/// n jobs share k servers, each at rate min(1, k/n).
///
/// All jobs progress alike, so that one number is enough: the work that a job present from the
/// start would have had done ("virtual time" of the queueing literature). A job ends when that
/// reaches its value at arrival plus its work. Both are kept in 2^-32 ns, in 128 bits, so that jobs
/// depart, and the others speed up, between whole nanoseconds; only what is reported of a
/// completion rounds, up to the next.
/// @source  Demers, Keshav, Shenker: Analysis and Simulation of a Fair Queueing Algorithm, SIGCOMM
/// 1989.
class SharedServers final : public Servers {
 public:
  SharedServers(int servers, Begins begins) : begins_(std::move(begins)), servers_(servers) {}

  void arrive(JobId job, Nanos work, std::uint64_t sequence, Nanos now) override {
    progress(fixed(now));
    if (jobs_.empty()) done_ = 0;
    if (begins_) work = begins_(job, work);
    jobs_.push_back({done_ + fixed(work), sequence, job});
    std::ranges::push_heap(jobs_, later);
    find_next();
  }

  std::optional<Nanos> lengthen(JobId job, Nanos by, Nanos now) override {
    progress(fixed(now));
    std::optional<Nanos> left;
    if (const auto found = std::ranges::find(jobs_, job, &Job::job); found != jobs_.end()) {
      left = round_up(found->end - done_);
      found->end += fixed(by);
    }
    std::ranges::make_heap(jobs_, later);
    find_next();
    return left;
  }

  JobId complete_next() override {
    progress(fixed(next_.time));
    assert(!departed_.empty());
    const JobId job = departed_.front().job;
    departed_.pop_front();
    find_next();
    return job;
  }

  std::optional<Nanos> remove(JobId job, Nanos now) override {
    progress(fixed(now));
    std::optional<Nanos> rest;
    if (const auto at = std::ranges::find(departed_, job, &Departed::job); at != departed_.end()) {
      departed_.erase(at);
      rest = Nanos::zero();
    } else if (const auto in = std::ranges::find(jobs_, job, &Job::job); in != jobs_.end()) {
      rest = round_up(in->end - done_);
      jobs_.erase(in);
      std::ranges::make_heap(jobs_, later);
    }
    find_next();
    return rest;
  }

  std::vector<std::pair<JobId, Nanos>> remaining(Nanos now) const override {
    SharedServers then = *this;
    then.progress(fixed(now));
    std::vector<std::pair<JobId, Nanos>> jobs;
    for (const Job& each : then.jobs_) jobs.emplace_back(each.job, round_up(each.end - then.done_));
    for (const Departed& each : then.departed_) jobs.emplace_back(each.job, Nanos::zero());
    return jobs;
  }

 private:
  __extension__ using Fixed = __int128;  ///< 2^-32 ns.
  static constexpr int kFraction = 32;
  struct Job {
    Fixed end = 0;  ///< In terms of done_.
    std::uint64_t sequence = 0;
    JobId job = 0;
  };
  struct Departed {
    Moment moment;
    JobId job = 0;
  };
  static bool later(const Job& a, const Job& b) {
    return a.end != b.end ? a.end > b.end : a.sequence > b.sequence;
  }
  static Fixed fixed(Nanos time) { return Fixed{time.count()} << kFraction; }
  /// At most what is just not never.
  static Nanos round_up(Fixed time) {
    constexpr Fixed kMost = (Nanos::max() - Nanos(1)).count();
    const Fixed up = (time + (Fixed{1} << kFraction) - 1) >> kFraction;
    return Nanos(static_cast<std::int64_t>(std::min(up, kMost)));
  }

  /// When the first job ends if nothing arrives, rounded up to 2^-32 ns.
  Fixed first_end() const {
    const Fixed rest = jobs_.front().end - done_;
    const auto jobs = static_cast<Fixed>(jobs_.size());
    return last_ + (jobs <= servers_ ? rest : (rest * jobs + servers_ - 1) / servers_);
  }

  void progress(Fixed now) {
    while (!jobs_.empty() && first_end() <= now) {
      last_ = first_end();
      std::ranges::pop_heap(jobs_, later);
      const Job& first = jobs_.back();
      done_ = first.end;
      departed_.push_back({{round_up(last_), first.sequence}, first.job});
      jobs_.pop_back();
    }
    const auto jobs = static_cast<Fixed>(jobs_.size());
    if (jobs > 0) done_ += jobs <= servers_ ? now - last_ : (now - last_) * servers_ / jobs;
    last_ = now;
  }

  void find_next() {
    if (!departed_.empty()) {
      next_ = departed_.front().moment;
    } else {
      next_ = jobs_.empty() ? Moment{} : Moment{round_up(first_end()), jobs_.front().sequence};
    }
  }

  Begins begins_;
  int servers_;
  std::vector<Job> jobs_;          ///< A heap, earliest end first.
  std::deque<Departed> departed_;  ///< Ended, and not yet taken.
  Fixed done_ = 0;
  Fixed last_ = 0;
};

}  // namespace

std::unique_ptr<Servers> make_servers(int servers, Discipline discipline, Servers::Begins begins) {
  if (discipline == Discipline::kProcessorSharing) {
    return std::make_unique<SharedServers>(servers, std::move(begins));
  }
  return std::make_unique<FifoServers>(servers, std::move(begins));
}

}  // namespace pirt
