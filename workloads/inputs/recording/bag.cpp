// Reading a bag of ROS 1 by its index. Of a chunk that is not compressed only the message is read.
#include <fmt/core.h>

#include <algorithm>
#include <cstring>
#include <map>

#include "workloads/base/error.h"
#include "workloads/inputs/recording/bag_format.h"
#include "workloads/inputs/recording/compression.h"
#include "workloads/inputs/recording/random_file.h"
#include "workloads/inputs/recording/recording.h"

namespace pirt {
namespace {

using bag::Op;

constexpr const char* kCut =
    "is not whole: it ends within a record. Copy it again, or repair it with `rosbag reindex`";

using Fields = std::map<std::string, std::string, std::less<>>;

struct Record {
  Fields head;
  std::uint64_t data_at = 0;
  std::uint32_t data_size = 0;
  [[nodiscard]] std::uint64_t end() const { return data_at + data_size; }
};

struct Chunk {
  std::uint64_t data_at = 0;
  std::uint32_t packed = 0, size = 0;
  std::string compression;
};

/// Positions of topics.
using Connections = std::map<std::uint32_t, std::size_t>;

class Bag final : public Recording {
 public:
  Bag(const std::filesystem::path& file, const Opening& as)
      : Recording(as.name.empty() ? file.string() : as.name),
        bytes_(file, file_),
        unpacked_(as.unpacked) {
    read_index();
  }

 private:
  [[nodiscard]] std::string load(const Topic::Place& place, std::uint64_t most) const override {
    const Chunk& chunk = chunks_[place.at];
    if (chunk.compression == "none") {
      const Record record = read_record(chunk.data_at + place.part);
      check_message(record);
      return bytes_.read(record.data_at, std::min<std::uint64_t>(record.data_size, most));
    }
    const auto content = unpacked_->get(this, place.at, chunk.size, [&] {
      return unpack(chunk.compression, bytes_.pieces(chunk.data_at, chunk.packed), chunk.size,
                    file_);
    });
    const Record record =
        record_at(place.part, content->size(), [&](std::uint64_t from, std::uint64_t count) {
          return from > content->size() ? std::string() : content->substr(from, count);
        });
    check_message(record);
    return content->substr(record.data_at, std::min<std::uint64_t>(record.data_size, most));
  }

  void check_message(const Record& record) const {
    if (op_of(record) != Op::kMessage) fail("is damaged: its index leads to no message");
  }

  [[nodiscard]] std::uint32_t number(const std::string& bytes, std::size_t at) const {
    std::uint32_t value = 0;
    if (at > bytes.size() || bytes.size() - at < sizeof value) fail(kCut);
    std::memcpy(&value, bytes.data() + at, sizeof value);
    return value;
  }

  [[nodiscard]] Fields fields_of(const std::string& head) const {
    Fields fields;
    for (std::size_t at = 0; at < head.size();) {
      const std::uint32_t length = number(head, at);
      at += 4;
      if (length > head.size() - at) fail("is damaged: a field is longer than its record's head");
      const std::string text = head.substr(at, length);
      const auto equals = text.find('=');
      if (equals == std::string::npos) fail("is damaged: a field of a record has no value");
      fields[text.substr(0, equals)] = text.substr(equals + 1);
      at += length;
    }
    return fields;
  }

  /// @param read  As RandomFile's, of @p size bytes.
  template <typename Read>
  [[nodiscard]] Record record_at(std::uint64_t at, std::uint64_t size, const Read& read) const {
    const std::uint32_t head_size = number(read(at, 4), 0);
    if (head_size > kMostChunkBytes) fail("is damaged: a record has no end");
    const std::string head = read(at + 4, head_size + 4U);
    Record record;
    record.head = fields_of(head.substr(0, head_size));
    record.data_at = at + 8 + head_size;
    record.data_size = number(head, head_size);
    if (record.data_size > size - record.data_at) fail(kCut);
    return record;
  }
  [[nodiscard]] Record read_record(std::uint64_t at) const {
    return record_at(at, bytes_.size(), [this](std::uint64_t from, std::uint64_t count) {
      return bytes_.read(from, count);
    });
  }

  [[nodiscard]] const std::string& at(const Fields& fields, std::string_view name,
                                      std::size_t size = 0) const {
    const auto found = fields.find(name);
    if (found == fields.end() || found->second.size() < size) {
      fail(fmt::format("is damaged: a record has no field '{}'", name));
    }
    return found->second;
  }

  template <typename T>
  [[nodiscard]] T value(const Fields& fields, std::string_view name) const {
    T number = 0;
    std::memcpy(&number, at(fields, name, sizeof number).data(), sizeof number);
    return number;
  }

  [[nodiscard]] Op op_of(const Record& record) const {
    return static_cast<Op>(value<std::uint8_t>(record.head, "op"));
  }

  void read_index() {
    if (bytes_.size() < bag::kVersion.size() ||
        bytes_.read(0, bag::kVersion.size()) != bag::kVersion) {
      fail("is no bag of ROS 1, version 2.0");
    }
    const Record head = read_record(bag::kVersion.size());
    if (op_of(head) != Op::kBagHeader) fail("is damaged: its first record is no bag header");
    const auto index_at = value<std::uint64_t>(head.head, "index_pos");
    if (index_at == 0) {
      fail(
          "was not closed when it was recorded, and has no index; repair it with `rosbag reindex`");
    }
    const auto connections = value<std::uint32_t>(head.head, "conn_count");
    const auto chunks = value<std::uint32_t>(head.head, "chunk_count");
    std::uint64_t next = index_at;
    Connections topics;
    for (std::uint32_t i = 0; i < connections; ++i) {
      const Record record = read_record(next);
      next = record.end();
      const Fields about = fields_of(bytes_.read(record.data_at, record.data_size));
      const auto text = about.find("message_definition");
      topics[value<std::uint32_t>(record.head, "conn")] =
          add({.name = at(record.head, "topic"),
               .type = at(about, "type"),
               .encoding = "ros1",
               .has_seq = defines_seq(text == about.end() ? "" : text->second, true)});
    }
    for (std::uint32_t i = 0; i < chunks; ++i) {
      const Record record = read_record(next);
      next = record.end();
      read_chunk(value<std::uint64_t>(record.head, "chunk_pos"),
                 value<std::uint32_t>(record.head, "count"), topics);
    }
    finish();
  }

  /// @param indices  How many index records follow it.
  void read_chunk(std::uint64_t position, std::uint32_t indices, const Connections& topics) {
    const Record record = read_record(position);
    Chunk chunk{.data_at = record.data_at,
                .packed = record.data_size,
                .size = value<std::uint32_t>(record.head, "size"),
                .compression = at(record.head, "compression")};
    check_compression(chunk.compression, file_);
    if (chunk.size > kMostChunkBytes) fail("is damaged: a chunk is larger than 96 MiB");
    std::uint64_t next = record.end();
    for (std::uint32_t i = 0; i < indices; ++i) {
      const Record index = read_record(next);
      next = index.end();
      if (op_of(index) != Op::kIndex) fail("is damaged: a chunk has no index behind it");
      const auto topic = topics.find(value<std::uint32_t>(index.head, "conn"));
      if (topic == topics.end()) fail("is damaged: an index is of no connection");
      const auto count = value<std::uint32_t>(index.head, "count");
      const std::string data = bytes_.read(index.data_at, index.data_size);
      constexpr std::size_t kEntry = 12;
      if (data.size() < kEntry * count) fail("is damaged: an index is shorter than it says");
      auto& places = topics_[topic->second].places;
      for (std::size_t k = 0; k < count; ++k) {
        const std::size_t entry = kEntry * k;
        places.push_back({.time = Nanos(std::int64_t{number(data, entry)} * 1'000'000'000 +
                                        number(data, entry + 4)),
                          .at = chunks_.size(),
                          .part = number(data, entry + 8)});
      }
    }
    chunks_.push_back(std::move(chunk));
  }

  RandomFile bytes_;
  std::vector<Chunk> chunks_;
  std::shared_ptr<ChunkCache> unpacked_;
};

}  // namespace

std::unique_ptr<Recording> open_bag(const std::filesystem::path& file, const Opening& as) {
  return std::make_unique<Bag>(file, as);
}

}  // namespace pirt
