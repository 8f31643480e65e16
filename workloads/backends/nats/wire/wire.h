// What robots and workers send each other, byte by byte. Knows no connection and no clock.
//
// A frame, little endian:
//     "pNET"  u16 protocol  u8 kind  u8 0  u64 length of the body  8 bytes: SHA-256 of the body
//     body
// Nothing that comes in is trusted: every length is checked against what is there, every count and
// text against a limit, before anything is allocated. What does not fit is no message, with a
// reason.
#pragma once

#include <compare>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <variant>
#include <vector>

#include "workloads/backends/nats/wire/digest.h"
#include "workloads/base/time.h"

namespace pirt::cloud {

using Bytes = std::vector<std::byte>;
using ByteView = std::span<const std::byte>;

/// Of frames and of all bodies; another one is not read.
inline constexpr std::uint16_t kProtocol = 1;

/// One task of one robot: a run of its program, and a number in it; or what follows from a key.
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
inline constexpr std::uint32_t kLeastChunkBytes = 4096;

/// What a frame carries where it fits, and else where it lies.
using Payload = std::variant<Bytes, Blob>;

/// A task on its way to a worker. Robots are told by the subject, which the server vouches for.
struct TaskMessage {
  TaskId task = {};
  std::uint32_t send = 1;               ///< How often the robot has sent it, this time included.
  std::optional<Nanos> time_left = {};  ///< To its deadline, as it was sent; absent = none.
  Payload body = {};                    ///< A TaskBody.
};

/// What is to be computed: all of it as it was submitted, however often it is sent.
struct TaskBody {
  std::string workload;
  std::vector<std::int64_t> sizes =
      {};            ///< Of one's own, as the kind's maker takes them; else empty.
  Digest spec = {};  ///< spec_digest of the workload, as the robot knows it.
  std::optional<Blob> parameters = {};  ///< Absent if the workload has none.
  ByteView tensors = {};                ///< Of encode_tensors; lies in what was decoded.
};

enum class ReplyKind : std::uint8_t {
  kDone = 1,
  kFailedTry,        ///< The kernel threw, or its process died.
  kRefused,          ///< No worker of this kind ever will: unknown, another spec, wrong sizes.
  kNeedsParameters,  ///< They are not on the stream; the task waits there.
  kExpired,          ///< Its time was over before it began.
  kRunning,          ///< No end: a worker has begun, or still computes.
};

struct ReplyMessage {
  TaskId task = {};
  std::uint32_t send = 1;
  ReplyKind kind = ReplyKind::kDone;
  std::string worker = {};
  std::string problem = {};  ///< Of kFailedTry and kRefused, in one line.
  /// By the worker's clock: the computation, and all from taking the task to sending this.
  Nanos execute{0}, held{0};
  Payload outputs = {};  ///< Of kDone: encode_tensors.
};

/// The robot does not want it any more: a task that is not to be run, a blob that was read.
struct WithdrawMessage {
  TaskId task = {};
  std::uint64_t sequence = 0;  ///< On the stream of tasks; 0 = unknown.
  std::vector<Blob> blobs = {};
};

/// What a worker can do.
struct AnnouncementMessage {
  struct Known {
    std::string workload;
    Digest spec;
    friend bool operator==(const Known&, const Known&) = default;
  };
  std::string worker = {}, version = {};
  std::uint32_t slots = 1;
  std::vector<Known> workloads = {};
};

using Message = std::variant<TaskMessage, ReplyMessage, WithdrawMessage, AnnouncementMessage>;

[[nodiscard]] Bytes encode(const Message& message);
[[nodiscard]] Bytes encode(const TaskBody& body);

/// What was read, or why not.
template <typename T>
struct Decoded {
  std::optional<T> value;
  std::string problem;  ///< One line; empty if there is a value.
};
[[nodiscard]] Decoded<Message> decode(ByteView frame);
/// @param bytes  Are there as long as the body is.
[[nodiscard]] Decoded<TaskBody> decode_body(ByteView bytes);

}  // namespace pirt::cloud
