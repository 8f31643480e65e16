// The servers that stages of virtual time wait for: a unit's, or a link's one.
//
// Jobs are opaque numbers. Whoever owns the servers asks for the next completion, lets time pass
// until then and takes it.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "characterize/platform/platform.h"
#include "scheduler/virtual/moments.h"
#include "workloads/base/time.h"

namespace pirt {

using JobId = std::uint32_t;

class Servers {
 public:
  /// A server begins with the job. @return  The work that it is, @p work so far.
  using Begins = std::function<Nanos(JobId job, Nanos work)>;
  virtual ~Servers() = default;
  /// @param work      Server time at rate 1, >= 0.
  /// @param sequence  Unique and rising over all arrivals.
  virtual void arrive(JobId job, Nanos work, std::uint64_t sequence, Nanos now) = 0;
  /// A job needs so much more.
  /// @param now  Not after next().
  /// @return     The server time that it needed without that; absent, and it does not need more,
  /// unless it is being served.
  virtual std::optional<Nanos> lengthen(JobId job, Nanos by, Nanos now) = 0;
  /// Takes the job whose completion is next(); now == next().time.
  virtual JobId complete_next() = 0;
  /// The job whose completion is next(), if nobody waits to be served in its place.
  [[nodiscard]] virtual std::optional<JobId> unchallenged() const { return std::nullopt; }
  /// It has more work, and stays where it is: what complete_next and arrive come to then.
  virtual void go_on(Nanos /*work*/, std::uint64_t /*sequence*/) {}
  /// The job departs without being complete. @return  The server time that it still needed; absent
  /// if it is not here.
  /// @param now  Not after next().
  virtual std::optional<Nanos> remove(JobId job, Nanos now) = 0;
  [[nodiscard]] const Moment& next() const { return next_; }
  /// The jobs that have arrived and are not complete, with the server time that each still needs.
  /// @param now  Not after next().
  [[nodiscard]] virtual std::vector<std::pair<JobId, Nanos>> remaining(Nanos now) const = 0;

 protected:
  Moment next_;
};

/// @param servers  >= 1.
/// @param begins   Empty = what arrives is what it takes.
[[nodiscard]] std::unique_ptr<Servers> make_servers(int servers, Discipline discipline,
                                                    Servers::Begins begins = {});

}  // namespace pirt
