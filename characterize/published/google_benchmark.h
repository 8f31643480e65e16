// JSON of Google Benchmark, entry by entry: for whoever takes its times as figures of one's own.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "workloads/base/text/json.h"

namespace pirt {

struct BenchmarkEntry {
  enum class Kind : std::uint8_t { kTime, kAggregate, kError, kSkipped } kind = Kind::kTime;
  std::string name;
  std::string said = {};  ///< Of kError: what it was.
  double real_ns = 0;     ///< Of kTime alone.
  std::int64_t threads = 1;
};

/// The object with the list `benchmarks`, among what a program has printed besides. Absent if there
/// is none.
[[nodiscard]] std::optional<Json> find_benchmarks(std::string_view text);

/// All of its entries, in their order.
/// @throws JsonError for one without name, or a time without `real_time` or in an unknown unit.
[[nodiscard]] std::vector<BenchmarkEntry> benchmark_entries(const Json& root);

}  // namespace pirt
