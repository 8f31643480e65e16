// Reading MCAP: by its index, or record by record where there is none, or the file is not whole.
#include <fmt/core.h>

#include <algorithm>
#include <map>
#include <optional>
#include <utility>

#include "workloads/base/error.h"
#include "workloads/inputs/recording/compression.h"
#include "workloads/inputs/recording/mcap_format.h"
#include "workloads/inputs/recording/random_file.h"
#include "workloads/inputs/recording/recording.h"

namespace pirt {
namespace mcap {
namespace {

/// The fields of a record, one after the other. False behind its end.
class Fields {
 public:
  explicit Fields(std::string_view bytes) : bytes_(bytes) {}

  template <typename T>
  T number() {
    T value{};
    const auto part = take(sizeof value);
    if (part.size() == sizeof value) std::memcpy(&value, part.data(), sizeof value);
    return value;
  }
  std::uint16_t u16() { return number<std::uint16_t>(); }
  std::uint32_t u32() { return number<std::uint32_t>(); }
  std::uint64_t u64() { return number<std::uint64_t>(); }
  std::string_view text() { return take(u32()); }
  std::string_view rest() { return bytes_; }
  [[nodiscard]] bool empty() const { return bytes_.empty(); }
  [[nodiscard]] bool is_whole() const { return is_whole_; }

 private:
  std::string_view take(std::size_t size) {
    is_whole_ = is_whole_ && size <= bytes_.size();
    const auto part = bytes_.substr(0, is_whole_ ? size : 0);
    bytes_.remove_prefix(is_whole_ ? size : bytes_.size());
    return part;
  }

  std::string_view bytes_;
  bool is_whole_ = true;
};

struct Chunk {
  std::uint64_t data_at = 0, packed = 0, size = 0;
  std::uint32_t crc = 0;  ///< 0 = there is none.
  std::string compression = {};
  bool is_file = false;  ///< The whole file, for messages between two chunks.
};

struct Message {
  std::uint16_t channel = 0;
  Nanos time{};
  std::string_view data = {};
};

class Mcap final : public Recording {
 public:
  Mcap(const std::filesystem::path& file, std::uint64_t checked_bytes, const Opening& as)
      : Recording(as.name.empty() ? file.string() : as.name),
        bytes_(file, file_),
        unpacked_(as.unpacked) {
    const auto magic = kMagic;
    if (bytes_.size() < magic.size() || bytes_.read(0, magic.size()) != magic) {
      fail("is no MCAP recording, version 0: its magic number is another one");
    }
    is_whole_ = read_footer();
    const bool is_indexed = is_whole_ && bytes_.size() > checked_bytes && read_index();
    if (!is_indexed) {
      attachments_ = metadata_ = 0;
      topics_.clear();
      chunks_.clear();
      schemas_.clear();
      channels_.clear();
      read_all();
    }
    finish();
  }

 private:
  using Place = Topic::Place;
  struct Schema {
    std::string name, definition;
  };

  [[noreturn]] void fail_at(std::uint64_t at, const std::string& problem) const {
    fail(fmt::format("is damaged at byte {}: {}; `mcap recover` saves what is whole", at, problem));
  }
  [[nodiscard]] Nanos time_of(std::uint64_t stamp, std::uint64_t at) const {
    if (stamp > static_cast<std::uint64_t>(Nanos::max().count())) {
      fail_at(at, "a message was recorded later than there are stamps for");
    }
    return Nanos(static_cast<std::int64_t>(stamp));
  }

  /// False if the file was cut off. Checks the summary.
  [[nodiscard]] bool read_footer() {
    const auto magic = kMagic;
    if (bytes_.size() < 2 * magic.size() + kFooterBytes) return false;
    const std::uint64_t at = bytes_.size() - magic.size() - kFooterBytes;
    const std::string end = bytes_.read(at, kFooterBytes + magic.size());
    Fields fields(std::string_view(end).substr(kRecordHead));
    if (!end.ends_with(magic) || end[0] != static_cast<char>(Op::kFooter)) return false;
    const auto summary_at = fields.u64();
    fields.u64();  // of offsets in the summary
    const auto crc = fields.u32();
    if (summary_at == 0) return true;
    if (summary_at < magic.size() || summary_at > at || at - summary_at > kMostChunkBytes) {
      fail_at(at, "its summary is nowhere");
    }
    summary_ = bytes_.read(summary_at, at - summary_at);
    const auto covered = summary_ + end.substr(0, kFooterBytes - sizeof crc);
    if (crc != 0 && crc_of(covered) != crc) {
      fail_at(summary_at, "the checksum of its summary is wrong");
    }
    return true;
  }

  [[nodiscard]] std::vector<std::pair<Op, std::string_view>> summary_records() const {
    std::vector<std::pair<Op, std::string_view>> records;
    for (std::string_view rest = summary_; rest.size() >= kRecordHead;) {
      const auto size = Fields(rest.substr(1)).u64();
      if (size > rest.size() - kRecordHead) break;
      records.emplace_back(static_cast<Op>(rest[0]), rest.substr(kRecordHead, size));
      rest.remove_prefix(kRecordHead + size);
    }
    return records;
  }

  /// False if the index does not lead to all that there is.
  [[nodiscard]] bool read_index() {
    std::optional<std::uint64_t> messages, counted_chunks;
    std::vector<std::string_view> indices;
    for (const auto& [op, content] : summary_records()) {
      Fields fields(content);
      if (op == Op::kChunkIndex) indices.push_back(content);
      if ((op == Op::kSchema || op == Op::kChannel) && !describe(op, content, 0)) return false;
      if (op != Op::kStatistics) continue;
      messages = fields.u64();
      fields.u16();  // schemas
      fields.u32();  // channels
      attachments_ = fields.u32();
      metadata_ = fields.u32();
      counted_chunks = fields.u32();
    }
    if (!messages || indices.empty() || *counted_chunks != indices.size()) return false;
    std::uint64_t found = 0;
    for (const auto each : indices) {
      if (!index_chunk(Fields(each), found)) return false;
    }
    return found == *messages;
  }

  [[nodiscard]] bool index_chunk(Fields fields, std::uint64_t& found) {
    fields.u64();  // times of its first and last message
    fields.u64();
    const auto start = fields.u64();
    const auto length = fields.u64();
    fields.text();  // where each channel's index is: they follow each other
    const auto index_size = fields.u64();
    if (!fields.is_whole() || start > bytes_.size() || length > bytes_.size() - start) return false;
    const std::uint64_t at = start + kRecordHead;
    if (length < kRecordHead || index_size > bytes_.size() - start - length) return false;
    const auto head = bytes_.read(start, std::min<std::uint64_t>(length, kMostChunkHead));
    if (head[0] != static_cast<char>(Op::kChunk)) return false;
    const auto chunk =
        chunk_of(std::string_view(head).substr(kRecordHead), at, length - kRecordHead);
    if (!chunk) return false;
    const std::uint64_t number = chunks_.size();
    chunks_.push_back(*chunk);
    const std::string index = bytes_.read(start + length, index_size);
    for (Fields records(index); !records.empty();) {
      const auto op = records.number<std::uint8_t>();
      const auto size = records.u64();
      if (size > records.rest().size()) return false;
      Fields of(records.rest().substr(0, size));
      records = Fields(records.rest().substr(size));
      if (op != static_cast<std::uint8_t>(Op::kMessageIndex)) continue;
      const auto channel = channels_.find(of.u16());
      for (Fields entries(of.text()); !entries.empty(); ++found) {
        const auto time = entries.u64();
        const auto offset = entries.u64();
        if (!entries.is_whole() || channel == channels_.end()) return false;
        topics_[channel->second].places.push_back({time_of(time, at), number, offset});
      }
      if (!of.is_whole()) return false;
    }
    return true;
  }

  /// Of the fields of a chunk's record, of which @p head is the beginning. None if they are
  /// damaged.
  [[nodiscard]] static std::optional<Chunk> chunk_of(std::string_view head, std::uint64_t at,
                                                     std::uint64_t size) {
    Fields fields(head);
    fields.u64();  // times of its first and last message
    fields.u64();
    Chunk chunk;
    chunk.size = fields.u64();
    chunk.crc = fields.u32();
    chunk.compression = fields.text();
    chunk.packed = fields.u64();
    if (chunk.compression.empty()) chunk.compression = "none";
    chunk.data_at = at + (head.size() - fields.rest().size());
    if (!fields.is_whole() || chunk.packed > at + size - chunk.data_at ||
        chunk.packed > kMostChunkBytes || chunk.size > kMostChunkBytes) {
      return std::nullopt;
    }
    return chunk;
  }

  [[nodiscard]] ChunkCache::Content unpacked(std::uint64_t number) const {
    const Chunk& chunk = chunks_[number];
    check_compression(chunk.compression, file_);
    const bool is_packed = chunk.compression != "none";
    return unpacked_->get(this, chunk.data_at, is_packed ? chunk.size : chunk.packed, [&] {
      std::string content =
          is_packed ? unpack(chunk.compression, bytes_.pieces(chunk.data_at, chunk.packed),
                             chunk.size, file_)
                    : bytes_.read(chunk.data_at, chunk.packed);
      if (chunk.crc != 0 && crc_of(content) != chunk.crc) {
        fail_at(chunk.data_at, "the checksum of a chunk is wrong");
      }
      return content;
    });
  }

  /// False if a channel's schema is not known.
  bool describe(Op op, std::string_view content, std::uint64_t at) {
    Fields fields(content);
    const auto id = fields.u16();
    if (op == Op::kSchema) {
      Schema schema{std::string(fields.text()), ""};
      fields.text();  // in which language it is defined
      schema.definition = fields.text();
      if (!fields.is_whole()) fail_at(at, "a schema ends within a field");
      schemas_[id] = std::move(schema);
      return true;
    }
    const auto schema_id = fields.u16();
    const auto schema = schemas_.find(schema_id);
    Topic topic{.name = std::string(fields.text())};
    topic.encoding = fields.text();
    if (!fields.is_whole()) fail_at(at, "a channel ends within a field");
    if (schema != schemas_.end()) {
      topic.type = ros1_type(schema->second.name);
      topic.has_seq = defines_seq(schema->second.definition, topic.encoding == "ros1");
    }
    if (schema_id != 0 && schema == schemas_.end()) return false;
    channels_[id] = add(std::move(topic));
    return true;
  }

  void describe_here(Op op, std::string_view content, std::uint64_t at) {
    if (!describe(op, content, at) && warnings_.empty()) fail_at(at, "a channel is of no schema");
  }

  [[nodiscard]] Message message_of(std::string_view content, std::uint64_t at) const {
    Fields fields(content);
    Message message{.channel = fields.u16()};
    fields.u32();  // sequence
    message.time = time_of(fields.u64(), at);
    fields.u64();  // when it was published
    message.data = fields.rest();
    if (!fields.is_whole()) fail_at(at, "a message ends within a field");
    return message;
  }

  void place(const Message& message, std::uint64_t chunk, std::uint64_t offset, std::uint64_t at) {
    const auto channel = channels_.find(message.channel);
    if (channel == channels_.end()) {
      if (is_whole_ && warnings_.empty()) fail_at(at, "a message is of no channel");
      ++undescribed_;  // by a chunk that is damaged
      return;
    }
    topics_[channel->second].places.push_back({message.time, chunk, offset});
  }

  /// Record by record. What of a file that was cut off is whole is read, and said.
  void read_all() {
    for (const auto& [op, content] : summary_records()) {
      if (op == Op::kSchema || op == Op::kChannel) static_cast<void>(describe(op, content, 0));
    }
    std::uint64_t at = kMagic.size();
    bool has_ended = false;
    while (!has_ended && bytes_.size() - at >= kRecordHead) {
      const std::string head = bytes_.read(at, kRecordHead);
      const auto op = static_cast<Op>(head[0]);
      const auto size = Fields(std::string_view(head).substr(1)).u64();
      const bool is_none = head[0] == 0;  // as what was not written before power was lost
      if (is_none || size > bytes_.size() - at - kRecordHead) {
        if (!is_whole_) break;
        fail_at(at, is_none ? "a record is of no kind" : "a record is longer than the file");
      }
      if (op == Op::kFooter) break;
      read_record(op, at + kRecordHead, size);
      has_ended = op == Op::kDataEnd;
      at += kRecordHead + size;
    }
    if (undescribed_ > 0) {
      warnings_.push_back(fmt::format(
          "'{}': {} messages are left out: what their topic is was in a chunk that is damaged",
          file_, undescribed_));
    }
    if (has_ended && is_whole_) return;
    if (is_whole_) fail_at(at, "the end of its data is missing");
    std::uint64_t messages = 0;
    for (const Topic& topic : topics_) messages += topic.places.size();
    warnings_.push_back(fmt::format(
        "'{}' is not whole: it was cut off, or not closed, and is read up to byte {} of "
        "{} ({} messages)",
        file_, at, bytes_.size(), messages));
  }

  void read_record(Op op, std::uint64_t at, std::uint64_t size) {
    if (op == Op::kChunk) return read_chunk(at, size);
    if (op == Op::kAttachment) return read_attachment(at, size);
    if (op == Op::kMetadata) ++metadata_;
    const bool is_known =
        op == Op::kSchema || op == Op::kChannel || op == Op::kMessage || op == Op::kDataEnd;
    if (!is_known) return;
    if (size > kMostChunkBytes) fail_at(at, "a record has no end");
    const std::string content = bytes_.read(at, size);
    if (op == Op::kMessage) {
      if (chunks_.empty() || !chunks_.back().is_file) {
        chunks_.push_back(Chunk{.size = bytes_.size(), .compression = "none", .is_file = true});
      }
      place(message_of(content, at), chunks_.size() - 1, at - kRecordHead, at);
    }
    if (op == Op::kSchema || op == Op::kChannel) describe_here(op, content, at);
    if (op != Op::kDataEnd) return;
    const auto crc = Fields(content).u32();
    // A chunk that is damaged has been said.
    if (crc != 0 && warnings_.empty() && crc_up_to(at - kRecordHead) != crc) {
      fail_at(at, "the checksum of its messages is wrong");
    }
  }

  [[nodiscard]] std::uint32_t crc_up_to(std::uint64_t end) const {
    constexpr std::uint64_t kPiece = std::uint64_t{1} << 20;
    std::uint32_t crc = 0;
    for (std::uint64_t at = 0; at < end; at += kPiece) {
      crc = crc_of(bytes_.read(at, std::min(kPiece, end - at)), crc);
    }
    return crc;
  }

  /// One that is damaged is left out, and said.
  void read_chunk(std::uint64_t at, std::uint64_t size) {
    const auto chunk = chunk_of(bytes_.read(at, std::min(size, kMostChunkHead)), at, size);
    if (!chunk) fail_at(at, "a chunk ends within a field, or is larger than 96 MiB");
    const std::uint64_t number = chunks_.size();
    chunks_.push_back(*chunk);
    ChunkCache::Content kept;
    try {
      kept = unpacked(number);
    } catch (const Error& error) {
      chunks_.pop_back();
      if (error.code() != ErrorCode::kBadInput) throw;
      warnings_.push_back(fmt::format("a chunk of {} bytes at byte {} is left out: {}",
                                      chunk->packed, at, error.what()));
      return;
    }
    const std::string_view content = *kept;
    for (std::uint64_t offset = 0; offset < content.size();) {
      const auto rest = content.substr(offset);
      const auto inner = rest.size() < kRecordHead ? 0 : Fields(rest.substr(1)).u64();
      if (rest.size() < kRecordHead || inner > rest.size() - kRecordHead) {
        if (is_whole_) fail_at(at, "a chunk ends within a record");
        warnings_.push_back(fmt::format(
            "'{}': of a chunk at byte {} what is left of {} bytes is no record, and is left out",
            file_, at, rest.size()));
        return;
      }
      const auto op = static_cast<Op>(rest[0]);
      const auto fields = rest.substr(kRecordHead, inner);
      if (op == Op::kMessage) place(message_of(fields, at), number, offset, at);
      if (op == Op::kSchema || op == Op::kChannel) describe_here(op, fields, at);
      offset += kRecordHead + inner;
    }
  }

  void read_attachment(std::uint64_t at, std::uint64_t size) {
    ++attachments_;
    constexpr std::uint64_t kCrc = sizeof(std::uint32_t);
    if (size < kCrc || size > kMostChunkBytes) return;  // it is none that anybody reads here
    const std::string content = bytes_.read(at, size);
    Fields fields(content);
    fields.u64(), fields.u64();  // times
    fields.text(), fields.text();
    const auto data = fields.u64();
    if (!fields.is_whole() || data > fields.rest().size() - std::min(kCrc, fields.rest().size())) {
      fail_at(at, "an attachment ends within a field");
    }
    const auto covered = content.size() - fields.rest().size() + data;
    const auto crc = Fields(std::string_view(content).substr(covered)).u32();
    if (crc != 0 && crc_of(std::string_view(content).substr(0, covered)) != crc) {
      fail_at(at, "the checksum of an attachment is wrong");
    }
  }

  /// @param rest  Of the file or of the chunk, from where the message should be.
  /// @param room  How many bytes there are.
  [[nodiscard]] std::uint64_t message_size(std::string_view rest, std::uint64_t room,
                                           std::uint64_t at) const {
    const auto size = rest.size() < kRecordHead ? 0 : Fields(rest.substr(1)).u64();
    if (rest.size() < kRecordHead || rest[0] != static_cast<char>(Op::kMessage) ||
        room < kRecordHead || size > std::min(room - kRecordHead, kMostChunkBytes)) {
      fail_at(at, "its index leads to no message");
    }
    return size;
  }

  [[nodiscard]] std::string load(const Place& place, std::uint64_t most) const override {
    const auto data_of = [&](std::string_view content, std::uint64_t at) {
      const auto message = message_of(content, at);
      if (message.time != place.time && !was_set_back_) {
        fail_at(at, "its index leads to another message");
      }
      return std::string(message.data.substr(0, most));
    };
    const bool is_head = most < kWhole;
    const Chunk& chunk = chunks_[place.at];
    // Where the first bytes are enough and nothing is packed, a chunk is not read for them.
    if (chunk.is_file || (is_head && chunk.compression == "none")) {
      const auto at = chunk.data_at + std::min(place.part, chunk.size);
      const auto room = std::min(chunk.data_at + chunk.size, bytes_.size()) - at;
      const auto head = bytes_.read(at, std::min<std::uint64_t>(room, kRecordHead));
      const auto size = message_size(head, room, at);
      const auto wanted = std::min(size, is_head ? kMessageHead + most : size);
      return data_of(bytes_.read(at + kRecordHead, wanted), at);
    }
    const auto content = unpacked(place.at);
    const auto rest = std::string_view(*content).substr(std::min(place.part, content->size()));
    const auto size = message_size(rest, rest.size(), chunk.data_at);
    return data_of(rest.substr(kRecordHead, size), chunk.data_at);
  }

  static constexpr std::uint64_t kMessageHead = 2 + 4 + 8 + 8;
  /// Its fields in front of what it holds: the name of the compression is the only one that varies.
  static constexpr std::uint64_t kMostChunkHead = 256;

  RandomFile bytes_;
  bool is_whole_ = false;  ///< It has its end.
  std::string summary_;
  std::map<std::uint16_t, Schema> schemas_;
  std::map<std::uint16_t, std::size_t> channels_;  ///< Positions of topics.
  std::vector<Chunk> chunks_;
  std::uint64_t undescribed_ = 0;  ///< Messages.
  std::shared_ptr<ChunkCache> unpacked_;
};

}  // namespace
}  // namespace mcap

std::unique_ptr<Recording> open_mcap(const std::filesystem::path& file, std::uint64_t checked_bytes,
                                     const Opening& as) {
  return std::make_unique<mcap::Mcap>(file, checked_bytes, as);
}

}  // namespace pirt
