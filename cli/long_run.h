// What commands that measure for minutes share: Ctrl-C that keeps what there is, and a line that
// shows how far they are.
#pragma once

#include <atomic>
#include <string>

#include "characterize/campaign/campaign.h"

namespace pirt::cli {

/// A flag that the first Ctrl-C (or SIGTERM, SIGHUP) sets from here on; the second one ends the
/// process at once. A reader of our output that goes away (SIGPIPE) sets it too, and processor
/// time that is about to be used up (SIGXCPU). Signals that are
/// ignored stay ignored.
[[nodiscard]] const std::atomic<bool>* stop_on_signal();

/// How often that was asked for from here on, up to twice; the third Ctrl-C ends the process at
/// once.
[[nodiscard]] const std::atomic<int>* count_stop_signals();

/// Warns of each unit that @p plan leaves out, "... is not <done>: <reason>", and in a line of all
/// workloads that it leaves out on another; where they are several, @p says_why names what has the
/// reasons.
void warn_of_skipped(const CampaignPlan& plan, const std::string& done,
                     const std::string& says_why);

/// One line on stderr that is written over; silent if stderr is no terminal.
class ProgressLine {
 public:
  ProgressLine();
  ~ProgressLine() { clear(); }
  ProgressLine(const ProgressLine&) = delete;
  ProgressLine& operator=(const ProgressLine&) = delete;

  void show(const std::string& text) const;
  void clear() const;

 private:
  bool shown_;
};

}  // namespace pirt::cli
