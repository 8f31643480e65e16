// The log of a trace as a whole, for tests that look into it.
#pragma once

#include <filesystem>
#include <utility>
#include <vector>

#include "scheduler/trace/replay.h"
#include "scheduler/trace/trace_document.h"

namespace pirt::test {

struct TraceLog {
  DispatcherSetup setup;
  std::vector<LogEntry> entries;
  bool complete = true;
};

inline TraceLog load_trace_log(const std::filesystem::path& path) {
  TraceLog log;
  LogFile file = read_log(path, [&log](const DispatcherSetup& /*setup*/, LogEntry entry) {
    log.entries.push_back(std::move(entry));
    return true;
  });
  log.setup = std::move(file.setup);
  log.complete = file.complete;
  return log;
}

}  // namespace pirt::test
