#include "workloads/backends/nats/wire/wire.h"

#include <fmt/core.h>

#include <algorithm>
#include <bit>
#include <cstring>
#include <string_view>

namespace pirt::cloud {
namespace {

static_assert(std::endian::native == std::endian::little, "tensors travel as they lie in memory");

constexpr std::string_view kMagic = "pNET";
constexpr std::size_t kChecksumBytes = 8;
constexpr std::size_t kHeaderBytes = 4 + 2 + 1 + 1 + 8 + kChecksumBytes;
constexpr std::size_t kMostText = 1024;
constexpr std::size_t kMostList = 4096;

// The order is that of Message.
enum class Kind : std::uint8_t { kTask = 1, kReply, kWithdraw, kAnnouncement };

class Writer {
 public:
  template <typename T>
  requires std::is_integral_v<T> Writer& number(T value) {
    using Unsigned = std::make_unsigned_t<T>;
    const auto bits = static_cast<Unsigned>(value);
    for (std::size_t i = 0; i < sizeof bits; ++i) {
      bytes_.push_back(static_cast<std::byte>(static_cast<std::uint64_t>(bits) >> (8 * i)));
    }
    return *this;
  }
  Writer& raw(ByteView bytes) {
    bytes_.insert(bytes_.end(), bytes.begin(), bytes.end());
    return *this;
  }
  Writer& text(std::string_view text) {
    text = text.substr(0, kMostText);
    number(static_cast<std::uint32_t>(text.size()));
    return raw(std::as_bytes(std::span(text)));
  }
  Writer& digest(const Digest& digest) { return raw(std::as_bytes(std::span(digest.bytes))); }
  Writer& id(const TaskId& id) { return number(id.run).number(id.number); }
  Writer& blob(const Blob& blob) {
    return digest(blob.digest).number(blob.size_bytes).number(blob.chunk_bytes);
  }
  Writer& payload(const Payload& payload) {
    number(static_cast<std::uint8_t>(payload.index()));
    if (const auto* const blob = std::get_if<Blob>(&payload)) return this->blob(*blob);
    const Bytes& bytes = std::get<Bytes>(payload);
    number(std::uint64_t{bytes.size()});
    return raw(bytes);
  }
  void reserve(std::size_t size) { bytes_.reserve(size); }
  [[nodiscard]] Bytes take() { return std::move(bytes_); }

 private:
  Bytes bytes_;
};

/// Once something is wrong, all that follows is 0 and empty, and the first problem stays.
class Reader {
 public:
  explicit Reader(ByteView bytes) : left_(bytes) {}

  template <typename T>
  T number() {
    std::uint64_t bits = 0;
    const ByteView bytes = raw(sizeof(T), "a number");
    for (std::size_t i = 0; i < bytes.size(); ++i) {
      bits |= std::to_integer<std::uint64_t>(bytes[i]) << (8 * i);
    }
    return static_cast<T>(bits);
  }
  ByteView raw(std::uint64_t size, std::string_view what) {
    if (!ok()) return {};
    if (size > left_.size()) {
      fail(fmt::format("{} of {} bytes, and {} are left", what, size, left_.size()));
      return {};
    }
    const ByteView bytes = left_.first(static_cast<std::size_t>(size));
    left_ = left_.subspan(bytes.size());
    return bytes;
  }
  std::string text() {
    const auto size = number<std::uint32_t>();
    if (size > kMostText) fail(fmt::format("a text of {} bytes", size));
    const ByteView bytes = raw(size, "a text");
    return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
  }
  Digest digest() {
    Digest digest;
    const ByteView bytes = raw(digest.bytes.size(), "a digest");
    std::memcpy(digest.bytes.data(), bytes.data(), bytes.size());
    return digest;
  }
  TaskId id() {
    TaskId id;
    id.run = number<std::uint64_t>();
    id.number = number<std::uint64_t>();
    return id;
  }
  Blob blob() {
    Blob blob;
    blob.digest = digest();
    blob.size_bytes = number<std::uint64_t>();
    blob.chunk_bytes = number<std::uint32_t>();
    if (ok() && (blob.size_bytes == 0 || blob.size_bytes > kMostBlobBytes ||
                 blob.chunk_bytes < kLeastChunkBytes)) {
      fail(fmt::format("a blob of {} bytes in chunks of {}", blob.size_bytes, blob.chunk_bytes));
    }
    return blob;
  }
  Payload payload() {
    switch (number<std::uint8_t>()) {
      case 0: {
        const ByteView bytes = raw(number<std::uint64_t>(), "a payload");
        return Bytes(bytes.begin(), bytes.end());
      }
      case 1:
        return blob();
      default:
        fail("an unknown kind of payload");
        return Bytes{};
    }
  }
  /// Number of entries that follow.
  std::size_t count() {
    const auto count = number<std::uint32_t>();
    if (count > kMostList) fail(fmt::format("a list of {}", count));
    return ok() ? count : 0;
  }
  std::optional<Nanos> optional_nanos() {
    const bool given = flag();
    const Nanos value(number<std::int64_t>());
    return given ? std::optional(value) : std::nullopt;
  }
  bool flag() {
    const auto value = number<std::uint8_t>();
    if (value > 1) fail("a flag that is neither 0 nor 1");
    return value == 1;
  }
  Nanos duration() {
    const Nanos value(number<std::int64_t>());
    if (value < Nanos::zero()) fail("a negative duration");
    return value;
  }

  void fail(std::string problem) {
    if (ok()) problem_ = std::move(problem);
  }
  [[nodiscard]] bool ok() const { return problem_.empty(); }
  [[nodiscard]] ByteView rest() { return ok() ? left_ : ByteView{}; }
  /// The problem, or that something is left over.
  [[nodiscard]] std::string finish() {
    if (!left_.empty()) fail(fmt::format("{} bytes too many", left_.size()));
    return problem_;
  }

 private:
  ByteView left_;
  std::string problem_;
};

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

Message read_body(Kind kind, Reader& in) {
  switch (kind) {
    case Kind::kTask:
      return read_task(in);
    case Kind::kReply:
      return read_reply(in);
    case Kind::kWithdraw:
      return read_withdraw(in);
    case Kind::kAnnouncement:
      return read_announcement(in);
  }
  in.fail(fmt::format("frame of unknown kind {}", static_cast<int>(kind)));
  return TaskMessage{};
}

ByteView checksum(const Digest& digest) {
  return std::as_bytes(std::span(digest.bytes)).first(kChecksumBytes);
}

/// What a tensor's entry says, with its bytes.
struct Entry {
  std::int64_t rows = 0;
  ByteView bytes;
};

Entry read_entry(Reader& in, const TensorSpec& spec) {
  Entry entry;
  entry.rows = in.number<std::int64_t>();
  const std::int64_t capacity = spec.shape.empty() ? 1 : spec.shape[0];
  const bool fits =
      entry.rows == capacity || (spec.varies && entry.rows >= 0 && entry.rows < capacity);
  if (in.ok() && !fits) in.fail(fmt::format("{} rows for {}", entry.rows, spec.describe()));
  if (!in.ok()) return entry;
  const std::int64_t row_bytes = spec.size_bytes() / capacity;
  entry.bytes = in.raw(static_cast<std::uint64_t>(entry.rows * row_bytes), spec.name);
  return entry;
}

void fill(Tensor& tensor, const Entry& entry) {
  if (tensor.spec().varies) tensor.set_rows(entry.rows);
  if (!entry.bytes.empty()) std::memcpy(tensor.data(), entry.bytes.data(), entry.bytes.size());
}

/// All of them, or none and the problem.
std::string read_entries(ByteView bytes, std::span<const TensorSpec> specs,
                         std::vector<Entry>& entries) {
  Reader in(bytes);
  const std::size_t count = in.count();
  if (in.ok() && count != specs.size()) {
    in.fail(fmt::format("{} tensors, and {} are expected", count, specs.size()));
  }
  for (std::size_t i = 0; i < specs.size() && in.ok(); ++i) {
    entries.push_back(read_entry(in, specs[i]));
  }
  return in.finish();
}

void add_specs(Digester& digester, std::span<const TensorSpec> specs) {
  digester.add(std::uint64_t{specs.size()});
  for (const TensorSpec& spec : specs) {
    digester.add(static_cast<std::uint64_t>(spec.element)).add(std::uint64_t{spec.varies});
    digester.add(std::uint64_t{spec.shape.size()});
    for (const std::int64_t extent : spec.shape) digester.add(static_cast<std::uint64_t>(extent));
  }
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
  const auto kind = static_cast<Kind>(in.number<std::uint8_t>());
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

Bytes encode_tensors(std::span<const Tensor> tensors) {
  Writer out;
  std::size_t size = 4;
  for (const Tensor& tensor : tensors) size += 8 + tensor.used_bytes().size();
  out.reserve(size);
  out.number(static_cast<std::uint32_t>(tensors.size()));
  for (const Tensor& tensor : tensors) out.number(tensor.rows()).raw(tensor.used_bytes());
  return out.take();
}

Decoded<std::vector<Tensor>> decode_tensors(ByteView bytes, std::span<const TensorSpec> specs) {
  std::vector<Entry> entries;
  if (std::string problem = read_entries(bytes, specs, entries); !problem.empty()) {
    return {std::nullopt, std::move(problem)};
  }
  auto tensors = make_tensors(specs);
  for (std::size_t i = 0; i < tensors.size(); ++i) fill(tensors[i], entries[i]);
  return {std::move(tensors), ""};
}

std::string decode_tensors_into(ByteView bytes, std::span<Tensor> tensors) {
  std::vector<TensorSpec> specs;
  for (const Tensor& tensor : tensors) specs.push_back(tensor.spec());
  std::vector<Entry> entries;
  std::string problem = read_entries(bytes, specs, entries);
  for (std::size_t i = 0; problem.empty() && i < tensors.size(); ++i) fill(tensors[i], entries[i]);
  return problem;
}

Digest spec_digest(const Workload& workload) {
  Digester digester;
  digester.add(std::string_view(workload.kernel)).add(std::string_view(workload.variant));
  digester.add(static_cast<std::uint64_t>(workload.precision));
  digester.add(static_cast<std::uint64_t>(workload.batch));
  add_specs(digester, workload.inputs);
  add_specs(digester, workload.parameters);
  add_specs(digester, workload.outputs);
  return digester.value();
}

}  // namespace pirt::cloud
