// What robots and workers send each other, byte by byte. Knows no connection and no clock.
//
// A frame, little endian:
//     "pNET"  u16 protocol  u8 kind  u8 0  u64 length of the body  8 bytes: SHA-256 of the body
//     body: the fields of the message, in order (wire.cpp)
// Nothing that comes in is trusted: every length is checked against what is there, every count and
// text against a limit, before anything is allocated. What does not fit is no message, with a
// reason.
#pragma once

#include <array>
#include <compare>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "workloads/base/time.h"

namespace pirt::cloud {

using Bytes = std::vector<std::byte>;
using ByteView = std::span<const std::byte>;

/// SHA-256: names what is sent by its content, and finds damage. Whoever shares a cache with others
/// needs one that nobody can aim at.
struct Digest {
  std::array<std::uint8_t, 32> bytes{};

  /// 64 hexadecimal digits.
  [[nodiscard]] std::string hex() const;
  friend auto operator<=>(const Digest&, const Digest&) = default;
};

[[nodiscard]] Digest digest_of(ByteView bytes);

/// Another one is not read; 1 had its tasks on a stream.
inline constexpr std::uint16_t kProtocol = 2;

/// One task of one robot: a run of its program, and a number in it.
struct TaskId {
  std::uint64_t run = 0, number = 0;

  /// 32 hexadecimal digits.
  [[nodiscard]] std::string hex() const;
  friend auto operator<=>(const TaskId&, const TaskId&) = default;
};

/// Bytes that lie in chunks on a stream, under their content's name.
struct Blob {
  Digest digest;
  std::uint64_t size_bytes = 0;
  std::uint32_t chunk_bytes = 0;

  [[nodiscard]] std::uint32_t chunks() const {
    return static_cast<std::uint32_t>((size_bytes + chunk_bytes - 1) / chunk_bytes);
  }
  friend bool operator==(const Blob&, const Blob&) = default;
};
inline constexpr std::uint64_t kMostBlobBytes = std::uint64_t{1} << 32;
/// Smaller ones would be no more than a way to keep whoever reads them busy.
inline constexpr std::uint32_t kLeastChunkBytes = 32 << 10;

/// What a frame carries where it fits, and else where it lies.
struct Payload {
  Bytes bytes = {};
  std::optional<Blob> blob = {};

  [[nodiscard]] std::uint64_t size_bytes() const { return blob ? blob->size_bytes : bytes.size(); }
};

// Each message has its kind, as the frame says it.

/// How many tasks a run of a robot's program has waiting: a worker may ask for one. Robots are told
/// by the subject, which the server vouches for.
struct OfferMessage {
  static constexpr std::uint8_t kKind = 0;
  std::uint64_t run = 0;
  std::uint32_t waiting = 0;
};

/// A worker asks a robot for its next task.
struct ClaimMessage {
  static constexpr std::uint8_t kKind = 1;
  std::uint64_t run = 0;
  std::uint64_t worker = 0;  ///< Its instance.
};

/// What a robot gives it: all that is to be computed, and the sizes of it first.
struct TaskMessage {
  static constexpr std::uint8_t kKind = 2;
  TaskId task = {};
  std::uint32_t send = 1;               ///< How often it was handed out, this time included.
  std::uint32_t waiting = 0;            ///< As OfferMessage, without this one.
  std::optional<Nanos> time_left = {};  ///< To its deadline, as it was sent; absent = none.
  std::string workload = {};
  /// Of one's own, as the kind's maker takes them; else empty.
  std::vector<std::int64_t> sizes = {};
  Digest spec = {};                     ///< spec_digest of the workload, as the robot knows it.
  std::optional<Blob> parameters = {};  ///< Absent if the workload has none.
  Payload inputs = {};                  ///< encode_tensors.
};

enum class ReplyKind : std::uint8_t {
  kDone,
  kFailedTry,  ///< It threw, its process died, or it was over its time: a try.
  kRefused,    ///< This is never computed: unknown, another spec, wrong sizes, over a quota.
  kMissing,    ///< Its parameters or inputs are not on the stream. No try.
  kLater,      ///< No room, or no way to the stream. No try.
  kExpired,    ///< Its time was over before it began.
  kRunning,    ///< No end: a worker has it.
  kLast = kRunning,
};

struct ReplyMessage {
  static constexpr std::uint8_t kKind = 3;
  TaskId task = {};
  std::uint32_t send = 1;
  ReplyKind kind = ReplyKind::kDone;
  std::string worker = {};
  std::string problem = {};  ///< In one line; empty if done.
  Nanos execute{0};          ///< By the worker's clock.
  Payload outputs = {};      ///< Of kDone: encode_tensors.
};

/// The robot does not want it any more.
struct CancelMessage {
  static constexpr std::uint8_t kKind = 4;
  TaskId task = {};
};

/// What a worker can do. Said every few seconds: who says it lives.
struct HelloMessage {
  static constexpr std::uint8_t kKind = 5;
  struct Known {
    std::string workload = {};
    Digest spec = {};
    friend bool operator==(const Known&, const Known&) = default;
  };
  std::uint64_t instance = 0;  ///< Of one start of its program.
  std::string worker = {}, version = {};
  std::uint32_t slots = 1;
  std::vector<Known> workloads = {};
};

/// What was read, or why not.
template <typename T>
struct Decoded {
  std::optional<T> value;
  std::string problem;  ///< One line; empty if there is a value.
};

/// @param message  One of those above.
template <typename T>
[[nodiscard]] Bytes encode(const T& message);
template <typename T>
[[nodiscard]] Decoded<T> decode_as(ByteView frame);

}  // namespace pirt::cloud
