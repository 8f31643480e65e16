// The log of a trace as a whole, for tests that look into it.
#pragma once

#include <filesystem>
#include <vector>

#include "scheduler/trace/replay.h"
#include "scheduler/trace/trace_reader.h"

namespace pirt::test {

struct TraceLog {
  DispatcherSetup setup;
  std::vector<LogEntry> entries;
  bool complete = true;
};

inline TraceLog load_trace_log(const std::filesystem::path& path) {
  TraceReader reader(path);
  TraceLog log{.setup = reader.setup(), .entries = {}};
  while (auto entry = reader.next()) log.entries.push_back(*std::move(entry));
  log.complete = !reader.ends_in_the_middle();
  return log;
}

}  // namespace pirt::test
