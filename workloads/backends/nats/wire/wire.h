// What robots and workers send each other, byte by byte, and where. Knows no connection and no
// clock. The server's permissions bind a robot to the subjects of its name; only blobs are stored.
//
//     pirt.hello                        worker -> robots    what it knows; that it lives
//     pirt.offer.ROBOT                  robot -> workers    how many tasks wait there
//     pirt.claim.ROBOT                  worker -> robot     it wants one of them
//     pirt.task.ROBOT.WORKER            robot -> worker     a task, or an offer: there is none
//                                       (WORKER: its instance in hexadecimal digits)
//     pirt.answer.ROBOT                 worker -> robot     that it has it; what became of it
//     pirt.cancel.ROBOT                 robot -> workers    nobody wants it any more
//     pirt.blob.ROBOT.in.TASK.N         robot -> workers    stream PIRT_ROBOT, its own:
//     pirt.blob.ROBOT.par.DIGEST.N      robot -> workers    what is larger than a message
//     pirt.blob.ROBOT.out.TASK-SEND.N   worker -> robot
//
// A frame, little endian:
//     "pNET"  u16 protocol  u8 kind  u8 0  u64 length of the body  8 bytes: SHA-256 of the body
//     body: the fields of the message, in order (wire.cpp)
// Nothing that comes in is trusted: every length, count and text is checked before anything is
// allocated. Tensors are read by the specs of a workload that the reader knows, or makes itself.
#pragma once

#include <fmt/core.h>

#include <array>
#include <compare>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "workloads/base/time.h"
#include "workloads/model/workload.h"

namespace pirt::cloud {

using Bytes = std::vector<std::byte>;
using ByteView = std::span<const std::byte>;

/// SHA-256, which nobody can aim at: names what is sent by its content, and finds damage.
struct Digest {
  std::array<std::uint8_t, 32> bytes{};

  /// 64 hexadecimal digits.
  [[nodiscard]] std::string hex() const;
  friend auto operator<=>(const Digest&, const Digest&) = default;
};

[[nodiscard]] Digest digest_of(ByteView bytes);

/// Another one is not read; 1 had its tasks on a stream.
inline constexpr std::uint16_t kProtocol = 2;
/// No task takes or waits longer: what follows from sums of a few is in range.
inline constexpr Nanos kLongest = std::chrono::hours(24 * 366);

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

/// A workload as it travels.
struct Kind {
  std::string name = {};                 ///< Of the workload that whoever reads it knows.
  std::vector<std::int64_t> sizes = {};  ///< What its maker takes: a picture's width and height, or
                                         ///< images a call; empty = made in one size.
  /// What whoever knows it announces; absent = of sizes that do not tell. Not sent.
  std::optional<Digest> known_by = {};
};
[[nodiscard]] Kind kind_of(const Workload& workload);

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
  Kind kind = {};
  Digest spec = {};                     ///< spec_digest of the workload, as the robot knows it.
  std::optional<Blob> parameters = {};  ///< Absent if the workload has none.
  Payload inputs = {};                  ///< encode_tensors.
};

enum class ReplyKind : std::uint8_t {
  kDone,
  kFailedTry,   ///< It threw, its process died, or it was over its time: a try.
  kCallFailed,  ///< Its own function says so (CallFailed): nobody is to try again.
  kRefused,     ///< Not computed here: unknown, another spec, wrong sizes, over a quota.
  kMissing,     ///< Its parameters or inputs are not on the stream. No try.
  kLater,       ///< No room, or no way to the stream. No try.
  kExpired,     ///< Its time was over before it began.
  kRunning,     ///< No end: a worker has it.
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
  std::vector<Known> workloads = {};
};

/// @param message  One of those above.
template <typename T>
[[nodiscard]] Bytes encode(const T& message);
/// @throws Error{kBadInput} for what is no such message.
template <typename T>
[[nodiscard]] T decode_as(ByteView frame);
/// What a frame says that it is: reading it may show that it is none.
template <typename T>
[[nodiscard]] bool is_frame_of(ByteView frame) {
  constexpr std::size_t kKindAt = 6;
  return frame.size() > kKindAt && frame[kKindAt] == std::byte{T::kKind};
}

/// The rows that they have.
[[nodiscard]] Bytes encode_tensors(std::span<const Tensor> tensors);
/// At most so many bytes encode_tensors makes of these; fewer only where lists are not full.
[[nodiscard]] std::uint64_t encoded_bytes(std::span<const TensorSpec> specs);
/// @param specs  Of the tensors that are expected.
/// @param own    Of a user's own workload: what has no ranges takes any numbers.
/// @throws Error{kBadInput} for all others, values out of their ranges, and numbers that are none.
[[nodiscard]] std::vector<Tensor> decode_tensors(ByteView bytes, std::span<const TensorSpec> specs,
                                                 bool own = false);
/// Into tensors that are there; with an error they are as they were.
void decode_tensors_into(ByteView bytes, std::span<Tensor> tensors);

/// Of all that has to be the same for two programs to mean the same computation: kernel, variant,
/// precision, batch, the specs of its tensors, and a user's models.
[[nodiscard]] Digest spec_digest(const Workload& workload);

inline constexpr const char* kHelloSubject = "pirt.hello";

/// Letters, digits, _ and -, at most 64 of them: what a robot's name may be.
[[nodiscard]] bool is_robot_name(std::string_view name);
/// @throws Error{kBadInput} for another one.
void check_robot_name(std::string_view name);

/// @param what  offer, claim, answer, cancel.
[[nodiscard]] inline std::string subject(std::string_view what, std::string_view robot) {
  return fmt::format("pirt.{}.{}", what, robot);
}
[[nodiscard]] inline std::string task_subject(std::string_view robot, std::uint64_t worker) {
  return fmt::format("pirt.task.{}.{:x}", robot, worker);
}
[[nodiscard]] inline std::string blob_stream(std::string_view robot) {
  return "PIRT_" + std::string(robot);
}
/// Where the chunks of a blob lie; each adds "." and its number. @param what  in, par, out.
[[nodiscard]] inline std::string blob_subject(std::string_view robot, std::string_view what,
                                              std::string_view name) {
  return fmt::format("pirt.blob.{}.{}.{}", robot, what, name);
}
/// The third part of a subject.
[[nodiscard]] inline std::string robot_of(std::string_view subject) {
  subject.remove_prefix(subject.find('.', subject.find('.') + 1) + 1);
  return std::string(subject.substr(0, subject.find('.')));
}

}  // namespace pirt::cloud
