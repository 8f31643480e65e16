#include "cli/long_run.h"

#include <fmt/format.h>

#include <csignal>
#include <cstdio>

#include "cli/output.h"

namespace pirt::cli {
namespace {

std::atomic<bool> stop_requested = false;

extern "C" void request_stop(int signal) {
  stop_requested = true;
  std::signal(signal, SIG_DFL);
}

}  // namespace

const std::atomic<bool>* stop_on_signal() {
  std::signal(SIGINT, request_stop);
  std::signal(SIGTERM, request_stop);
  return &stop_requested;
}

void warn_of_skipped(const CampaignPlan& plan, const std::string& done) {
  for (const auto& skip : plan.skipped) {
    const auto what =
        skip.workload.empty() ? "unit " + skip.unit : skip.workload + " on unit " + skip.unit;
    warn(fmt::format("{} is not {}: {}", what, done, skip.reason));
  }
}

ProgressLine::ProgressLine() : shown_(stderr_is_terminal()) {}

void ProgressLine::show(const std::string& text) const {
  if (!shown_) return;
  fmt::print(stderr, "\r{}\x1b[K", text);
  std::fflush(stderr);
}

void ProgressLine::clear() const {
  if (shown_) fmt::print(stderr, "\r\x1b[K");
}

}  // namespace pirt::cli
