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

/// The message of the number that a frame says.
template <std::size_t kIndex = 0>
Message read_message(std::uint8_t kind, Reader& in) {
  if constexpr (kIndex < std::variant_size_v<Message>) {
    if (kind != kIndex) return read_message<kIndex + 1>(kind, in);
    std::variant_alternative_t<kIndex, Message> message;
    in(message);
    return message;
  } else {
    in.fail(fmt::format("frame of unknown kind {}", kind));
    return {};
  }
}

}  // namespace

std::string Digest::hex() const {
  std::string text;
  for (const std::uint8_t byte : bytes) text += fmt::format("{:02x}", byte);
  return text;
}

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

Bytes encode(const Message& message) {
  Writer body;
  std::visit([&](const auto& each) { body(each); }, message);
  const Bytes bytes = body.take();
  Writer frame;
  frame.reserve(kHeaderBytes + bytes.size());
  frame.raw(std::as_bytes(std::span(kMagic)));
  frame(kProtocol, static_cast<std::uint8_t>(message.index()), std::uint8_t{0},
        std::uint64_t{bytes.size()});
  return frame.raw(checksum(digest_of(bytes))).raw(bytes).take();
}

Decoded<Message> decode(ByteView frame) {
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
  Message message = read_message(kind, inside);
  std::string problem = inside.finish();
  if (!problem.empty()) return {std::nullopt, std::move(problem)};
  return {std::move(message), ""};
}

}  // namespace pirt::cloud
