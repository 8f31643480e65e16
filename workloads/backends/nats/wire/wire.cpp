#include "workloads/backends/nats/wire/wire.h"

#include <fmt/format.h>
#include <openssl/evp.h>

#include <algorithm>
#include <concepts>
#include <cstring>
#include <string_view>

#include "workloads/backends/nats/wire/bytes.h"
#include "workloads/base/error.h"

namespace pirt::cloud {
namespace {

template <typename T, typename Of>
concept As = std::same_as<std::remove_const_t<T>, Of>;

}  // namespace

// What each message has, in its order on the wire.
void fields(auto& all, As<TaskId> auto& id) { all(id.run, id.number); }
void fields(auto& all, As<Payload> auto& payload) {
  all(payload.blob);
  if (!payload.blob) all(payload.bytes);
}
void fields(auto& all, As<OfferMessage> auto& offer) { all(offer.run, offer.waiting); }
void fields(auto& all, As<ClaimMessage> auto& claim) { all(claim.run, claim.worker); }
void fields(auto& all, As<TaskMessage> auto& task) {
  all(task.task, task.send, task.waiting, task.time_left, task.workload, task.sizes, task.spec,
      task.parameters, task.inputs);
}
void fields(auto& all, As<ReplyMessage> auto& reply) {
  all(reply.task, reply.send, reply.kind, reply.worker, reply.problem, reply.execute,
      reply.outputs);
}
void fields(auto& all, As<CancelMessage> auto& cancel) { all(cancel.task); }
void fields(auto& all, As<HelloMessage::Known> auto& known) { all(known.workload, known.spec); }
void fields(auto& all, As<HelloMessage> auto& hello) {
  all(hello.instance, hello.worker, hello.version, hello.slots, hello.workloads);
}

namespace {

constexpr std::string_view kMagic = "pNET";
constexpr std::size_t kChecksumBytes = 8;
constexpr std::size_t kHeaderBytes = 4 + 2 + 1 + 1 + 8 + kChecksumBytes;

ByteView checksum(const Digest& digest) {
  return std::as_bytes(std::span(digest.bytes)).first(kChecksumBytes);
}

}  // namespace

std::string Digest::hex() const { return fmt::format("{:02x}", fmt::join(bytes, "")); }

Digest digest_of(ByteView bytes) {
  Digest digest;
  unsigned size = 0;
  if (EVP_Digest(bytes.data(), bytes.size(), digest.bytes.data(), &size, EVP_sha256(), nullptr) !=
          1 ||
      size != digest.bytes.size()) {
    throw_environment("OpenSSL computes no SHA-256; is its library damaged, or in FIPS mode?");
  }
  return digest;
}

std::string TaskId::hex() const { return fmt::format("{:016x}{:016x}", run, number); }

template <typename T>
Bytes encode(const T& message) {
  const Bytes bytes = Writer()(message).take();
  Writer frame;
  frame.reserve(kHeaderBytes + bytes.size());
  frame.raw(std::as_bytes(std::span(kMagic)));
  frame(kProtocol, T::kKind, std::uint8_t{0}, std::uint64_t{bytes.size()});
  return frame.raw(checksum(digest_of(bytes))).raw(bytes).take();
}

template <typename T>
Decoded<T> decode_as(ByteView frame) {
  Reader in(frame);
  const ByteView magic = in.raw(kMagic.size(), "the beginning");
  if (!in.ok() || std::memcmp(magic.data(), kMagic.data(), kMagic.size()) != 0) {
    return {std::nullopt, "no frame of pirt"};
  }
  const auto protocol = in.number<std::uint16_t>();
  if (in.ok() && protocol != kProtocol) {
    return {std::nullopt, fmt::format("protocol {}, and this pirt speaks {}: give robots and "
                                      "workers the same version of pirt",
                                      protocol, kProtocol)};
  }
  const auto kind = in.number<std::uint8_t>();
  if (in.number<std::uint8_t>() != 0) in.fail("a reserved byte that is not 0");
  const auto length = in.number<std::uint64_t>();
  const ByteView sum = in.raw(kChecksumBytes, "the checksum");
  const ByteView body = in.raw(length, "the body");
  if (std::string problem = in.finish(); !problem.empty()) return {std::nullopt, problem};
  if (!std::ranges::equal(sum, checksum(digest_of(body)))) return {std::nullopt, "damaged"};
  Reader inside(body);
  T message;
  if (kind == T::kKind) {
    inside(message);
  } else {
    inside.fail(kind > HelloMessage::kKind ? fmt::format("frame of unknown kind {}", kind)
                                           : "a message of another kind");
  }
  std::string problem = inside.finish();
  if (!problem.empty()) return {std::nullopt, std::move(problem)};
  return {std::move(message), ""};
}

template Bytes encode(const OfferMessage&);
template Bytes encode(const ClaimMessage&);
template Bytes encode(const TaskMessage&);
template Bytes encode(const ReplyMessage&);
template Bytes encode(const CancelMessage&);
template Bytes encode(const HelloMessage&);
template Decoded<OfferMessage> decode_as(ByteView);
template Decoded<ClaimMessage> decode_as(ByteView);
template Decoded<TaskMessage> decode_as(ByteView);
template Decoded<ReplyMessage> decode_as(ByteView);
template Decoded<CancelMessage> decode_as(ByteView);
template Decoded<HelloMessage> decode_as(ByteView);

}  // namespace pirt::cloud
