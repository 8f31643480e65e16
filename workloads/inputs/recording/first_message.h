// Reading what a topic says where its first messages may say nothing.
#pragma once

#include <algorithm>
#include <cstddef>
#include <string>

#include "workloads/base/error.h"
#include "workloads/inputs/recording/recording.h"

namespace pirt {

/// What is read of the first of @p count that can be used: what is recorded may begin with
/// nonsense.
/// @throws Error{kBadInput} as the last one, if none can.
template <typename Read>
[[nodiscard]] auto first_usable(std::size_t count, const Read& read) {
  for (std::size_t i = 0;; ++i) {
    try {
      return read(i);
    } catch (const Error& error) {
      if (error.code() != ErrorCode::kBadInput || i + 1 >= count) throw;
    }
  }
}

template <typename Read>
[[nodiscard]] auto read_message(const Recording& recording, std::size_t topic, std::size_t i,
                                const Read& read) {
  const std::string bytes = recording.message(topic, i);
  auto in = recording.reader(topic, i, bytes);
  return read(in);
}

/// Of the first message that is one, among the first hundred: a sensor that starts may say
/// nonsense.
template <typename Read>
[[nodiscard]] auto first_message(const Recording& recording, std::size_t topic, const Read& read) {
  constexpr std::size_t kTried = 100;
  return first_usable(std::min(kTried, recording.topics()[topic].messages),
                      [&](std::size_t i) { return read_message(recording, topic, i, read); });
}

}  // namespace pirt
