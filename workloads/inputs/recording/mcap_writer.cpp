#include "workloads/inputs/recording/mcap_writer.h"

#include <algorithm>
#include <utility>

#include "workloads/base/system/temporary.h"
#include "workloads/base/text/text.h"
#include "workloads/inputs/recording/compression.h"
#include "workloads/inputs/recording/mcap_format.h"
#include "workloads/inputs/recording/messages.h"
#include "workloads/inputs/recording/recording.h"

namespace pirt {
namespace mcap {
namespace {

std::string raw_span(Nanos first, Nanos last) {
  return raw(static_cast<std::uint64_t>(first.count())) +
         raw(static_cast<std::uint64_t>(last.count()));
}

/// A recording of ROS 2.
class McapFile final : public RecordingWriter {
 public:
  McapFile(const std::filesystem::path& file, std::string_view compression)
      : file_(follow_links(file)),
        writer_([this](std::string_view bytes) { file_.write(bytes); }, "ros2", compression) {}

  [[nodiscard]] WireFormat format() const override { return WireFormat::kCdr; }
  void write(const std::string& topic, std::string_view type, Nanos time,
             const std::string& message) override {
    const std::string name = ros2_type(type);
    writer_.write(topic, {name, "ros2msg", "cdr", [type] { return ros2_definition(type); }}, time,
                  message);
  }
  void publish() override {
    writer_.finish();
    file_.publish();
  }

 private:
  TemporaryFile file_;
  McapWriter writer_;
};

}  // namespace

McapWriter::McapWriter(Put put_bytes, std::string_view profile, std::string_view compression)
    : put_(std::move(put_bytes)), compression_(compression) {
  check_compression(compression_, "the recording to write");
  put(kMagic);
  put(record(Op::kHeader, sized(profile) + sized("pirt")));
}

void McapWriter::write(const std::string& topic, const MessageSchema& schema, Nanos time,
                       std::string_view message) {
  const auto [known, is_new] =
      channels_.try_emplace(topic, Channel{static_cast<std::uint16_t>(channels_.size() + 1), 0});
  Channel& channel = known->second;
  if (is_new) {
    // A schema a channel, of the same number.
    const std::string number = raw(channel.id);
    described_.push_back(record(Op::kSchema, number + sized(schema.name) + sized(schema.language) +
                                                 sized(schema.definition())));
    described_.push_back(
        record(Op::kChannel, number + number + sized(topic) + sized(schema.encoding) + sized("")));
    chunk_ += described_[described_.size() - 2] + described_.back();
  }
  if (index_.empty()) first_ = last_ = time;
  first_ = std::min(first_, time);
  last_ = std::max(last_, time);
  const auto stamp = raw(static_cast<std::uint64_t>(time.count()));
  index_[channel.id] += stamp + raw(std::uint64_t{chunk_.size()});
  chunk_ += record(Op::kMessage, raw(channel.id) + raw(channel.messages++) + stamp + stamp +
                                     std::string(message));
  if (messages_++ == 0) begin_ = end_ = time;
  begin_ = std::min(begin_, time);
  end_ = std::max(end_, time);
  constexpr std::size_t kChunkBytes = std::size_t{768} << 10;  // as mcap's own
  if (chunk_.size() >= kChunkBytes) end_chunk();
}

void McapWriter::finish() {
  end_chunk();
  put(record(Op::kDataEnd, raw(crc_)));
  const std::uint64_t summary_at = written_;
  std::string summary;
  for (const std::string& each : described_) summary += each;
  std::string counts;
  for (const auto& [topic, channel] : channels_) {
    counts += raw(channel.id) + raw(std::uint64_t{channel.messages});
  }
  const auto count = static_cast<std::uint32_t>(channels_.size());
  summary +=
      record(Op::kStatistics, raw(messages_) + raw(static_cast<std::uint16_t>(count)) + raw(count) +
                                  raw(std::uint32_t{0}) + raw(std::uint32_t{0}) +
                                  raw(chunk_count_) + raw_span(begin_, end_) + sized(counts));
  summary += chunk_indices_;
  const std::string footer = raw(static_cast<std::uint8_t>(Op::kFooter)) +
                             raw(std::uint64_t{kFooterBytes - kRecordHead}) + raw(summary_at) +
                             raw(std::uint64_t{0});
  put(summary + footer + raw(crc_of(summary + footer)));
  put(kMagic);
}

void McapWriter::put(std::string_view bytes) {
  put_(bytes);
  crc_ = crc_of(bytes, crc_);
  written_ += bytes.size();
}

void McapWriter::end_chunk() {
  if (chunk_.empty()) return;
  const std::uint64_t at = written_;
  const std::string packed = pack(compression_, chunk_, "the recording to write");
  const std::string name = sized(compression_ == "none" ? "" : compression_);
  const auto size = raw(std::uint64_t{chunk_.size()});
  const auto packed_size = raw(std::uint64_t{packed.size()});
  const std::string chunk =
      record(Op::kChunk,
             raw_span(first_, last_) + size + raw(crc_of(chunk_)) + name + packed_size + packed);
  put(chunk);
  std::string offsets, indices;
  for (const auto& [channel, entries] : index_) {
    offsets += raw(channel) + raw(std::uint64_t{written_ + indices.size()});
    indices += record(Op::kMessageIndex, raw(channel) + sized(entries));
  }
  put(indices);
  chunk_indices_ +=
      record(Op::kChunkIndex, raw_span(first_, last_) + raw(at) + raw(std::uint64_t{chunk.size()}) +
                                  sized(offsets) + raw(std::uint64_t{indices.size()}) + name +
                                  packed_size + size);
  ++chunk_count_;
  chunk_.clear();
  index_.clear();
}

}  // namespace mcap

std::unique_ptr<RecordingWriter> make_mcap(const std::filesystem::path& file,
                                           std::string_view compression) {
  return std::make_unique<mcap::McapFile>(file, compression);
}

}  // namespace pirt
