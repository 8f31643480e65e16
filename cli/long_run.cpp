#include "cli/long_run.h"

#include <fmt/core.h>
#include <signal.h>

#include <cstdio>
#include <map>
#include <vector>

#include "cli/options/output.h"
#include "workloads/base/text/text.h"

namespace pirt::cli {
namespace {

std::atomic<bool> stop_requested = false;

extern "C" void request_stop(int) { stop_requested = true; }

std::atomic<int> stops = 0;

extern "C" void count_stop(int signal) {
  if (++stops >= 2) ::signal(signal, SIG_DFL);
}

/// What is ignored already stays so: nohup, or a shell's background.
void stop_on(int signal, int flags, void (*handler)(int) = request_stop) {
  struct sigaction now {};
  ::sigaction(signal, nullptr, &now);
  if (now.sa_handler == SIG_IGN) return;
  now = {};
  now.sa_handler = handler;
  now.sa_flags = flags;
  ::sigaction(signal, &now, nullptr);
}

}  // namespace

const std::atomic<bool>* stop_on_signal() {
  constexpr int kOnce = static_cast<int>(SA_RESETHAND | SA_RESTART);
  for (const int signal : {SIGINT, SIGTERM, SIGHUP}) stop_on(signal, kOnce);
  // Not once: what is still to be said would end the process before it has cleaned up.
  stop_on(SIGPIPE, SA_RESTART);
  stop_on(SIGXCPU, SA_RESTART);  // a limit on processor time, of which a second is left
  return &stop_requested;
}

const std::atomic<int>* count_stop_signals() {
  for (const int signal : {SIGINT, SIGTERM, SIGHUP}) stop_on(signal, SA_RESTART, count_stop);
  return &stops;
}

void warn_of_skipped(const CampaignPlan& plan, const std::string& done,
                     const std::string& says_why) {
  std::map<std::string, std::vector<const Skip*>> by_unit;
  for (const auto& skip : plan.skipped) {
    if (skip.workload.empty()) {
      warn(fmt::format("unit {} is not {}: {}", skip.unit, done, skip.reason));
    } else {
      by_unit[skip.unit].push_back(&skip);
    }
  }
  for (const auto& [unit, skips] : by_unit) {
    if (skips.size() == 1) {
      const Skip& skip = *skips.front();
      warn(fmt::format("{} on unit {} is not {}: {}", skip.workload, unit, done, skip.reason));
      continue;
    }
    std::vector<std::string> names;
    for (const Skip* skip : skips) names.push_back(skip->workload);
    warn(fmt::format("{} workloads on unit {} are not {} ({} says why): {}", names.size(), unit,
                     done, says_why, join(names, ", ")));
  }
}

ProgressLine::ProgressLine() : shown_(stderr_is_terminal()) {}

void ProgressLine::show(const std::string& text) const {
  if (!shown_) return;
  std::fprintf(stderr, "\r%s\x1b[K", text.c_str());
  std::fflush(stderr);
}

void ProgressLine::clear() const {
  if (shown_) std::fputs("\r\x1b[K", stderr);
}

}  // namespace pirt::cli
