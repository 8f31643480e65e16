#include "workloads/backends/nats/wire/wire.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <openssl/evp.h>

#include <algorithm>
#include <bit>
#include <concepts>
#include <cstring>
#include <type_traits>
#include <utility>

#include "workloads/base/error.h"
#include "workloads/model/own_operation.h"
#include "workloads/own/definition.h"
#include "workloads/recognition/scene_workload.h"
#include "workloads/recognition/specs.h"
#include "workloads/vision/vision.h"

namespace pirt::cloud {
namespace {

static_assert(std::endian::native == std::endian::little, "all travels as it lies in memory");

constexpr std::string_view kMagic = "pNET";
constexpr std::size_t kChecksumBytes = 8;
constexpr std::size_t kMostText = 1024, kMostList = 4096;

/// What travels as it lies in memory.
template <typename T>
concept Plain =
    std::is_integral_v<T> || std::is_enum_v<T> || std::same_as<T, Nanos> || std::same_as<T, Digest>;

/// Fields, one after the other: writes them, or reads them from bytes that nobody trusts.
/// @throws Error{kBadInput} for what cannot be read.
class Fields {
 public:
  Fields() = default;
  explicit Fields(ByteView from) : reads_(true), left_(from) {}

  /// Constants are written alone, and what is written stays as it is.
  template <typename... Each>
  Fields& operator()(Each&&... each) {
    (value(const_cast<std::remove_cvref_t<Each>&>(each)), ...);
    return *this;
  }
  Fields& put(ByteView bytes) {
    bytes_.insert(bytes_.end(), bytes.begin(), bytes.end());
    return *this;
  }
  [[nodiscard]] Bytes written() { return std::move(bytes_); }

  ByteView take(std::uint64_t size, std::string_view what) {
    if (size > left_.size()) {
      throw_bad_input(fmt::format("{} of {} bytes, and {} are left", what, size, left_.size()));
    }
    const ByteView bytes = left_.first(static_cast<std::size_t>(size));
    left_ = left_.subspan(bytes.size());
    return bytes;
  }
  template <typename T>
  [[nodiscard]] T number() {
    T read{};
    value(read);
    return read;
  }
  void finish() const {
    if (!left_.empty()) throw_bad_input(fmt::format("{} bytes too many", left_.size()));
  }

 private:
  template <Plain T>
  void value(T& plain) {
    const auto bytes = std::as_writable_bytes(std::span(&plain, 1));
    if (!reads_) return static_cast<void>(put(bytes));
    std::ranges::copy(take(bytes.size(), std::same_as<T, Digest> ? "a digest" : "a number"),
                      bytes.begin());
    if constexpr (requires { T::kLast; }) {
      if (plain <= T::kLast) return;
      throw_bad_input(
          fmt::format("unknown kind {}", static_cast<std::underlying_type_t<T>>(plain)));
    } else if constexpr (std::same_as<T, Nanos>) {
      if (plain >= Nanos::zero() && plain <= kLongest) return;
      throw_bad_input("a duration that is negative, or of years");
    }
  }
  /// It may be shown on a terminal, and written into a document.
  void value(std::string& text) {
    auto size = static_cast<std::uint32_t>(std::min(text.size(), kMostText));
    value(size);
    if (!reads_) return static_cast<void>(put(std::as_bytes(std::span(text)).first(size)));
    if (size > kMostText) throw_bad_input(fmt::format("a text of {} bytes", size));
    for (const std::byte byte : take(size, "a text")) {
      const char c = static_cast<char>(byte);
      text += c >= ' ' && c <= '~' ? c : ' ';
    }
  }
  void value(Bytes& bytes) {
    std::uint64_t size = bytes.size();
    value(size);
    if (!reads_) return static_cast<void>(put(bytes));
    const ByteView read = take(size, "a payload");
    bytes.assign(read.begin(), read.end());
  }
  template <typename T>
  void value(std::optional<T>& field) {
    std::uint8_t given = field.has_value();
    value(given);
    if (given > 1) throw_bad_input("a flag that is neither 0 nor 1");
    if (given == 1) value(reads_ ? field.emplace() : *field);
  }
  template <typename T>
  void value(std::vector<T>& list) {
    auto count = static_cast<std::uint32_t>(list.size());
    value(count);
    if (reads_ && count > kMostList) throw_bad_input(fmt::format("a list of {}", count));
    for (std::uint32_t i = 0; i < count; ++i) value(reads_ ? list.emplace_back() : list[i]);
  }
  void value(Blob& blob) {
    (*this)(blob.digest, blob.size_bytes, blob.chunk_bytes);
    if (reads_ && (blob.size_bytes == 0 || blob.size_bytes > kMostBlobBytes ||
                   blob.chunk_bytes < kLeastChunkBytes)) {
      throw_bad_input(
          fmt::format("a blob of {} bytes in chunks of {}", blob.size_bytes, blob.chunk_bytes));
    }
  }
  template <typename T>  // that has fields()
  void value(T& message) {
    fields(*this, message);
  }

  bool reads_ = false;
  ByteView left_ = {};
  Bytes bytes_ = {};
};

// What each message has, in its order on the wire.
void fields(Fields& all, TaskId& id) { all(id.run, id.number); }
void fields(Fields& all, Payload& payload) {
  all(payload.blob);
  if (!payload.blob) all(payload.bytes);
}
void fields(Fields& all, OfferMessage& offer) { all(offer.run, offer.waiting); }
void fields(Fields& all, ClaimMessage& claim) { all(claim.run, claim.worker); }
void fields(Fields& all, TaskMessage& task) {
  all(task.task, task.send, task.waiting, task.time_left, task.kind.name, task.kind.sizes,
      task.spec, task.parameters, task.inputs);
}
void fields(Fields& all, ReplyMessage& reply) {
  all(reply.task, reply.send, reply.kind, reply.worker, reply.problem, reply.execute,
      reply.outputs);
}
void fields(Fields& all, CancelMessage& cancel) { all(cancel.task); }
void fields(Fields& all, HelloMessage::Known& known) { all(known.workload, known.spec); }
void fields(Fields& all, HelloMessage& hello) {
  all(hello.instance, hello.worker, hello.version, hello.workloads);
}

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

bool is_robot_name(std::string_view name) {
  constexpr const char* kGood = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789_-";
  return !name.empty() && name.size() <= 64 && name.find_first_not_of(kGood) == name.npos;
}

void check_robot_name(std::string_view name) {
  if (is_robot_name(name)) return;
  throw_bad_input("robot '" + std::string(name) +
                  "' cannot be called that; a name is made of letters, digits, '_' and '-'");
}

std::string TaskId::hex() const { return fmt::format("{:016x}{:016x}", run, number); }

template <typename T>
Bytes encode(const T& message) {
  const Bytes bytes = Fields()(message).written();
  Fields frame;
  frame.put(std::as_bytes(std::span(kMagic)));
  frame(kProtocol, T::kKind, std::uint8_t{0}, std::uint64_t{bytes.size()});
  return frame.put(checksum(digest_of(bytes))).put(bytes).written();
}

template <typename T>
T decode_as(ByteView frame) {
  const ByteView magic = std::as_bytes(std::span(kMagic));
  if (!std::ranges::equal(frame.first(std::min(frame.size(), magic.size())), magic)) {
    throw_bad_input("no frame of pirt");
  }
  Fields in(frame.subspan(magic.size()));
  const auto protocol = in.number<std::uint16_t>();
  if (protocol != kProtocol) {
    throw_bad_input(
        fmt::format("protocol {}, and this pirt speaks {}: give robots and workers the "
                    "same version of pirt",
                    protocol, kProtocol));
  }
  const auto kind = in.number<std::uint8_t>();
  if (in.number<std::uint8_t>() != 0) throw_bad_input("a reserved byte that is not 0");
  const auto length = in.number<std::uint64_t>();
  const ByteView sum = in.take(kChecksumBytes, "the checksum");
  const ByteView body = in.take(length, "the body");
  in.finish();
  if (!std::ranges::equal(sum, checksum(digest_of(body)))) throw_bad_input("damaged");
  if (kind != T::kKind) {
    throw_bad_input(kind > HelloMessage::kKind ? fmt::format("frame of unknown kind {}", kind)
                                               : "a message of another kind");
  }
  Fields inside(body);
  T message;
  inside(message).finish();
  return message;
}

template Bytes encode(const OfferMessage&);
template Bytes encode(const ClaimMessage&);
template Bytes encode(const TaskMessage&);
template Bytes encode(const ReplyMessage&);
template Bytes encode(const CancelMessage&);
template Bytes encode(const HelloMessage&);
template OfferMessage decode_as(ByteView);
template ClaimMessage decode_as(ByteView);
template TaskMessage decode_as(ByteView);
template ReplyMessage decode_as(ByteView);
template CancelMessage decode_as(ByteView);
template HelloMessage decode_as(ByteView);

Bytes encode_tensors(std::span<const Tensor> tensors) {
  Fields out;
  out(static_cast<std::uint32_t>(tensors.size()));
  for (const Tensor& tensor : tensors) out(tensor.rows()).put(tensor.used_bytes());
  return out.written();
}

std::uint64_t encoded_bytes(std::span<const TensorSpec> specs) {
  std::uint64_t size = 4;
  for (const TensorSpec& spec : specs) size += 8 + static_cast<std::uint64_t>(spec.size_bytes());
  return size;
}

std::vector<Tensor> decode_tensors(ByteView bytes, std::span<const TensorSpec> specs, bool own) {
  auto tensors = make_tensors(specs);
  decode_tensors_into(bytes, tensors);
  for (const Tensor& each : tensors) {
    if (own && each.spec().ranges.empty()) continue;
    if (const std::string problem = out_of_range(each); !problem.empty()) throw_bad_input(problem);
  }
  return tensors;
}

void decode_tensors_into(ByteView bytes, std::span<Tensor> tensors) {
  for (const bool copies : {false, true}) {  // Once all of it fits.
    Fields in(bytes);
    const auto count = in.number<std::uint32_t>();
    if (count != tensors.size()) {
      throw_bad_input(fmt::format("{} tensors, and {} are expected", count, tensors.size()));
    }
    for (Tensor& tensor : tensors) {
      const TensorSpec& spec = tensor.spec();
      const std::int64_t capacity = spec.shape.empty() ? 1 : spec.shape[0];
      const auto rows = in.number<std::int64_t>();
      const bool fits = rows == capacity || (spec.varies && rows >= 0 && rows < capacity);
      if (!fits) throw_bad_input(fmt::format("{} rows for {}", rows, spec.describe()));
      const std::int64_t size = rows * (spec.size_bytes() / capacity);
      const ByteView data = in.take(static_cast<std::uint64_t>(size), spec.name);
      if (!copies) continue;
      if (spec.varies) tensor.set_rows(rows);
      if (!data.empty()) std::memcpy(tensor.data(), data.data(), data.size());
    }
    in.finish();
  }
}

Digest spec_digest(const Workload& workload) {
  Fields out;
  out(workload.kernel, workload.variant, workload.precision, workload.batch);
  for (const auto* const specs : {&workload.inputs, &workload.parameters, &workload.outputs}) {
    out(static_cast<std::uint32_t>(specs->size()));
    for (const TensorSpec& spec : *specs) out(spec.element, spec.varies, spec.shape);
  }
  if (const auto* const scene =
          dynamic_cast<const recognition::DescribeByModels*>(workload.operation.get())) {
    out(scene->fingerprint);
  }
  if (const OwnOperation* const own = own_operation(workload)) out(own->digest);
  return digest_of(out.written());
}

Kind kind_of(const Workload& workload) {
  const std::string suffix = "@" + workload.variant;
  if (workload.batch > 1 && workload.name.ends_with(suffix)) {  // fc6@batch8
    return {workload.name.substr(0, workload.name.size() - suffix.size()), {workload.batch}};
  }
  if (const auto size = own::size_in(workload.name)) {
    return {own::plain_name(workload.name), {size->width, size->height}};
  }
  const Operation* const operation = workload.operation.get();
  if (const auto* const scene = dynamic_cast<const recognition::DescribeByModels*>(operation)) {
    const Workload known =
        recognition::resized(*scene, recognition::kPictureWidth, recognition::kPictureHeight);
    return {.name = workload.name,
            .sizes = {scene->width, scene->height},
            .known_by = spec_digest(known)};
  }
  const auto* const image = dynamic_cast<const vision::ImageOperation*>(operation);
  if (image == nullptr || !workload.variant.empty() || workload.batch > 1) {
    return {.name = workload.name, .known_by = spec_digest(workload)};
  }
  return {workload.name, {image->width, image->height}};
}

}  // namespace pirt::cloud
