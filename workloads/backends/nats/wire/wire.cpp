#include "workloads/backends/nats/wire/wire.h"

#include <fmt/core.h>

#include <algorithm>
#include <cstring>
#include <string_view>

#include "workloads/backends/nats/wire/bytes.h"

namespace pirt::cloud {
namespace {

constexpr std::string_view kMagic = "pNET";
constexpr std::size_t kChecksumBytes = 8;
constexpr std::size_t kHeaderBytes = 4 + 2 + 1 + 1 + 8 + kChecksumBytes;

// The order is that of Message.
enum class FrameKind : std::uint8_t { kTask = 1, kReply, kWithdraw, kAnnouncement };

void write(Writer& out, const TaskMessage& task) {
  out.id(task.task).number(task.send);
  out.number(static_cast<std::uint8_t>(task.time_left.has_value()));
  out.number(task.time_left.value_or(Nanos::zero()).count());
  out.payload(task.body);
}

void write(Writer& out, const ReplyMessage& reply) {
  out.id(reply.task).number(reply.send).number(static_cast<std::uint8_t>(reply.kind));
  out.text(reply.worker).text(reply.problem);
  out.number(reply.execute.count()).number(reply.held.count());
  out.payload(reply.outputs);
}

void write(Writer& out, const WithdrawMessage& withdraw) {
  out.id(withdraw.task).number(withdraw.sequence);
  out.number(static_cast<std::uint32_t>(withdraw.blobs.size()));
  for (const Blob& blob : withdraw.blobs) out.blob(blob);
}

void write(Writer& out, const AnnouncementMessage& announcement) {
  out.text(announcement.worker).text(announcement.version).number(announcement.slots);
  out.number(static_cast<std::uint32_t>(announcement.workloads.size()));
  for (const auto& known : announcement.workloads) out.text(known.workload).digest(known.spec);
}

Message read_task(Reader& in) {
  TaskMessage task;
  task.task = in.id();
  task.send = in.number<std::uint32_t>();
  task.time_left = in.optional_nanos();
  task.body = in.payload();
  return task;
}

Message read_reply(Reader& in) {
  ReplyMessage reply;
  reply.task = in.id();
  reply.send = in.number<std::uint32_t>();
  const auto kind = in.number<std::uint8_t>();
  if (kind < static_cast<std::uint8_t>(ReplyKind::kDone) ||
      kind > static_cast<std::uint8_t>(ReplyKind::kRunning)) {
    in.fail(fmt::format("reply of unknown kind {}", kind));
  }
  reply.kind = static_cast<ReplyKind>(kind);
  reply.worker = in.text();
  reply.problem = in.text();
  reply.execute = in.duration();
  reply.held = in.duration();
  reply.outputs = in.payload();
  return reply;
}

Message read_withdraw(Reader& in) {
  WithdrawMessage withdraw;
  withdraw.task = in.id();
  withdraw.sequence = in.number<std::uint64_t>();
  const std::size_t count = in.count();
  for (std::size_t i = 0; i < count && in.ok(); ++i) withdraw.blobs.push_back(in.blob());
  return withdraw;
}

Message read_announcement(Reader& in) {
  AnnouncementMessage announcement;
  announcement.worker = in.text();
  announcement.version = in.text();
  announcement.slots = in.number<std::uint32_t>();
  const std::size_t count = in.count();
  for (std::size_t i = 0; i < count && in.ok(); ++i) {
    auto name = in.text();
    announcement.workloads.push_back({std::move(name), in.digest()});
  }
  return announcement;
}

Message read_body(FrameKind kind, Reader& in) {
  switch (kind) {
    case FrameKind::kTask:
      return read_task(in);
    case FrameKind::kReply:
      return read_reply(in);
    case FrameKind::kWithdraw:
      return read_withdraw(in);
    case FrameKind::kAnnouncement:
      return read_announcement(in);
  }
  in.fail(fmt::format("frame of unknown kind {}", static_cast<int>(kind)));
  return TaskMessage{};
}

ByteView checksum(const Digest& digest) {
  return std::as_bytes(std::span(digest.bytes)).first(kChecksumBytes);
}

}  // namespace

std::string TaskId::hex() const { return fmt::format("{:016x}{:016x}", run, number); }

Bytes encode(const Message& message) {
  Writer body;
  std::visit([&](const auto& each) { write(body, each); }, message);
  const Bytes bytes = body.take();
  Writer frame;
  frame.reserve(kHeaderBytes + bytes.size());
  frame.raw(std::as_bytes(std::span(kMagic))).number(kProtocol);
  frame.number(static_cast<std::uint8_t>(message.index() + 1)).number(std::uint8_t{0});
  frame.number(std::uint64_t{bytes.size()}).raw(checksum(digest_of(bytes))).raw(bytes);
  return frame.take();
}

Decoded<Message> decode(ByteView frame) {
  Reader in(frame);
  const ByteView magic = in.raw(kMagic.size(), "the beginning");
  if (!in.ok() || std::memcmp(magic.data(), kMagic.data(), kMagic.size()) != 0) {
    return {std::nullopt, "no frame of pirt"};
  }
  const auto protocol = in.number<std::uint16_t>();
  if (in.ok() && protocol != kProtocol) {
    return {std::nullopt, fmt::format("protocol {}, and this pirt speaks {}", protocol, kProtocol)};
  }
  const auto kind = static_cast<FrameKind>(in.number<std::uint8_t>());
  if (in.number<std::uint8_t>() != 0) in.fail("a reserved byte that is not 0");
  const auto length = in.number<std::uint64_t>();
  const ByteView sum = in.raw(kChecksumBytes, "the checksum");
  const ByteView body = in.raw(length, "the body");
  if (std::string problem = in.finish(); !problem.empty())
    return {std::nullopt, std::move(problem)};
  if (!std::ranges::equal(sum, checksum(digest_of(body)))) return {std::nullopt, "damaged"};
  Reader inside(body);
  Message message = read_body(kind, inside);
  std::string problem = inside.finish();
  if (!problem.empty()) return {std::nullopt, std::move(problem)};
  return {std::move(message), ""};
}

Bytes encode(const TaskBody& body) {
  Writer out;
  out.reserve(body.tensors.size() + 256);
  out.number(kProtocol).text(body.workload).number(static_cast<std::uint32_t>(body.sizes.size()));
  for (const std::int64_t size : body.sizes) out.number(size);
  out.digest(body.spec).number(static_cast<std::uint8_t>(body.parameters.has_value()));
  if (body.parameters) out.blob(*body.parameters);
  out.raw(body.tensors);
  return out.take();
}

Decoded<TaskBody> decode_body(ByteView bytes) {
  Reader in(bytes);
  TaskBody body;
  if (in.number<std::uint16_t>() != kProtocol) in.fail("a body of another protocol");
  body.workload = in.text();
  const std::size_t count = in.count();
  for (std::size_t i = 0; i < count && in.ok(); ++i) {
    body.sizes.push_back(in.number<std::int64_t>());
  }
  body.spec = in.digest();
  if (in.flag()) body.parameters = in.blob();
  body.tensors = in.rest();
  if (!in.ok()) return {std::nullopt, in.finish()};
  return {std::move(body), ""};
}

}  // namespace pirt::cloud
