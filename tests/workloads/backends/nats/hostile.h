// Messages of robots and workers that are none.
#pragma once

#include <cstdint>
#include <cstring>
#include <utility>

#include "workloads/backends/nats/wire/wire.h"
#include "workloads/base/math/random.h"

namespace pirt::cloud::test {

/// With the checksum that fits.
inline Bytes sealed(Bytes frame) {
  constexpr std::size_t kHeader = 24;
  if (frame.size() < kHeader) return frame;
  const std::uint64_t length = frame.size() - kHeader;
  std::memcpy(frame.data() + 8, &length, sizeof length);
  const Digest digest = digest_of(ByteView(frame).subspan(kHeader));
  std::memcpy(frame.data() + 16, digest.bytes.data(), 8);
  return frame;
}

/// A message that is no good one: random, cut, longer, or with other bytes in places that mean
/// something; its checksum fits in half of the cases, so that what lies behind it is reached.
class Hostile {
 public:
  /// @param meaning  So many bytes of @p good, more than 32, mean something.
  Hostile(std::uint64_t seed, Bytes good, std::size_t meaning)
      : random_(seed), good_(std::move(good)), meaning_(meaning) {}

  Bytes next() {
    Bytes bytes = good_;
    switch (random_.below(5)) {
      case 0:
        bytes.resize(random_.below(200));
        for (std::byte& each : bytes) each = static_cast<std::byte>(random_.next());
        return bytes;
      case 1:
        bytes.resize(random_.below(bytes.size()));
        break;
      case 2:
        bytes.insert(bytes.end(), 1 + random_.below(64), std::byte{0x41});
        break;
      case 3: {  // A length, a count, a number of rows that is enormous or negative.
        const std::size_t at = 24 + random_.below(meaning_ - 24 - 8);
        const std::uint64_t value =
            random_.below(2) == 0 ? ~std::uint64_t{0} >> random_.below(40) : random_.next();
        std::memcpy(bytes.data() + at, &value, sizeof value);
        break;
      }
      default:
        for (std::uint64_t i = 0; i <= random_.below(4); ++i) {
          bytes[random_.below(meaning_)] ^= static_cast<std::byte>(1 + random_.below(255));
        }
    }
    return random_.below(2) == 0 ? bytes : sealed(std::move(bytes));
  }

 private:
  Random random_;
  Bytes good_;
  std::size_t meaning_;
};

}  // namespace pirt::cloud::test
