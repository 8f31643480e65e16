#include <fmt/core.h>

#include <chrono>
#include <thread>
#include <utility>

#include "workloads/backends/nats/service/worker_link.h"
#include "workloads/base/error.h"

namespace pirt::cloud {
namespace {

constexpr Nanos kLook = std::chrono::milliseconds(100);
constexpr Nanos kSettling = std::chrono::seconds(1);  ///< Of a link that came or went.
constexpr Nanos kQuiet = std::chrono::seconds(5);     ///< Between what robots do wrong.

std::string counted(const WorkerCounts& counts) {
  const auto of = [&](ReplyKind how) { return counts.ended(how); };
  return fmt::format(
      "{} taken, {} done, {} failed, {} refused, {} missed, {} returned, {} expired, {} cancelled, "
      "{} malformed",
      counts.taken, of(ReplyKind::kDone), of(ReplyKind::kFailedTry), of(ReplyKind::kRefused),
      of(ReplyKind::kMissing), of(ReplyKind::kLater), of(ReplyKind::kExpired), counts.cancelled,
      counts.malformed);
}

/// Whenever there is a link. Where an administrator makes the streams, a worker may not; and what
/// is there is the administrator's.
/// @param again  Nothing is thrown: the server may be another one tomorrow.
void look_at_server(Connection& connection, const ServiceEvents& events, bool again) {
  bool ends = !again;
  try {
    if (connection.chunk_bytes() == 0) throw_environment(connection.why_no_chunks());
    const std::string first = "$JS.API.STREAM.INFO.PIRT_" + Setup{}.robots[0];
    const auto answer = connection.request(first, "", std::chrono::seconds(1));
    if (!answer.came) return;
    const StreamAnswer stream = read_answer(answer);
    if (stream.error == 0) return;
    ends = ends && stream.error != kNoStream;  // Robots of other names may have theirs.
    for (const std::string& line : set_up(connection, {})) events.say(line);
  } catch (const Error& error) {
    if (ends) throw;  // Such as no JetStream at all.
    events.say(error.what());
  }
}

}  // namespace

void serve(const WorkerOptions& options, std::span<const Workload* const> workloads,
           const ServiceEvents& events) {
  WorkerLink worker(options, workloads);
  Connection& connection = worker.connection();
  const std::string server = public_url(options.connection.server);
  const MachineClock clock;
  Nanos quiet_until = clock.now() + kSettling;
  bool was_up = false, was_ever_up = false;
  std::string said;
  while (!events.stop()) {
    const bool up = connection.is_up();
    if (up != was_up) {
      events.say((up ? "connected to " : "lost ") + server);
      was_up = up;
      quiet_until = clock.now() + kSettling;
      if (up) look_at_server(connection, events, was_ever_up);
      if (up && !std::exchange(was_ever_up, true)) {
        events.say(fmt::format("worker {} with {} slot{}", options.name, options.limits.slots,
                               options.limits.slots == 1 ? "" : "s"));
      }
    }
    std::string why = up ? connection.problem() : connection.why_down();
    if (why != said && clock.now() >= quiet_until) {
      if (!why.empty()) events.say(up ? why : server + ": " + why);
      quiet_until = clock.now() + kQuiet;
      said = std::move(why);
    }
    std::this_thread::sleep_for(kLook);
  }
  events.say(counted(worker.counts()));
}

}  // namespace pirt::cloud
