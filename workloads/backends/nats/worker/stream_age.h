// How long a message has been on its stream. The server says by its own clock when it stored it;
// nobody compares that with another machine's: how far both are apart is the least that was seen,
// so that what follows is never more than it was.
#pragma once

#include <algorithm>
#include <array>
#include <charconv>
#include <cstdint>
#include <optional>
#include <string_view>

#include "workloads/base/time.h"

namespace pirt::cloud {

class StreamAge {
 public:
  /// @param ack  The subject under which the message is acknowledged:
  ///             $JS.ACK.[DOMAIN.ACCOUNT.]STREAM.CONSUMER.DELIVERED.SEQUENCE.SEQUENCE.TIME.PENDING
  /// @param now  By a clock of this machine's that is not set.
  /// @return  At least so long; 0 for what is no such subject.
  [[nodiscard]] Nanos at_least(std::string_view ack, Nanos now) {
    const auto stored = stored_at(ack);
    if (!stored) return Nanos::zero();
    const Nanos apart = now - *stored;
    least_apart_ = std::min(least_apart_.value_or(apart), apart);
    return apart - *least_apart_;
  }

 private:
  [[nodiscard]] static std::optional<Nanos> stored_at(std::string_view ack) {
    constexpr std::size_t kShort = 9, kLong = 11;
    std::array<std::string_view, kLong + 1> parts;
    std::size_t count = 0;
    while (!ack.empty() && count < parts.size()) {
      const std::size_t end = std::min(ack.find('.'), ack.size());
      parts[count++] = ack.substr(0, end);
      ack.remove_prefix(std::min(end + 1, ack.size()));
    }
    if (count < kShort || parts[0] != "$JS" || parts[1] != "ACK") return std::nullopt;
    const std::string_view time = parts[count == kShort ? kShort - 2 : kLong - 2];
    std::int64_t nanos = 0;
    const auto [end, error] = std::from_chars(time.data(), time.data() + time.size(), nanos);
    if (error != std::errc() || end != time.data() + time.size()) return std::nullopt;
    return Nanos(nanos);
  }

  std::optional<Nanos> least_apart_;
};

}  // namespace pirt::cloud
