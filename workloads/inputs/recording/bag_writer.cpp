// Writing a bag of ROS 1, in chunks that are not compressed.
#include <algorithm>
#include <map>
#include <utility>

#include "workloads/base/system/temporary.h"
#include "workloads/base/text/text.h"
#include "workloads/inputs/recording/bag_format.h"
#include "workloads/inputs/recording/messages.h"
#include "workloads/inputs/recording/recording.h"

namespace pirt {
namespace {

using bag::field;
using bag::Op;
using bag::op_field;
using bag::raw;
using bag::raw_time;
using bag::record;

constexpr std::size_t kChunkBytes = std::size_t{768} << 10;  // as rosbag's own

/// Chunks go into a file of their own, since the first record says what follows them.
class BagWriter final : public RecordingWriter {
 public:
  explicit BagWriter(const std::filesystem::path& file)
      : target_(follow_links(file)), chunks_(target_) {}

  [[nodiscard]] WireFormat format() const override { return WireFormat::kRos1; }

  void write(const std::string& topic, std::string_view type, Nanos time,
             const std::string& message) override {
    const auto [known, is_new] =
        connections_.try_emplace(topic, static_cast<std::uint32_t>(connections_.size()), "");
    auto& [connection, text] = known->second;
    if (is_new) {
      const MessageDefinition& definition = definition_of(type);
      text =
          record(op_field(Op::kConnection) + field("conn", raw(connection)) + field("topic", topic),
                 field("topic", topic) + field("type", std::string(type)) +
                     field("md5sum", std::string(definition.md5)) +
                     field("message_definition", std::string(definition.text)));
      chunk_ += text;
    }
    if (chunk_times_.empty()) first_ = last_ = time;
    first_ = std::min(first_, time);
    last_ = std::max(last_, time);
    chunk_times_[connection].emplace_back(time, static_cast<std::uint32_t>(chunk_.size()));
    chunk_ += record(
        op_field(Op::kMessage) + field("conn", raw(connection)) + field("time", raw_time(time)),
        message);
    if (chunk_.size() >= kChunkBytes) end_chunk();
  }

  void publish() override {
    end_chunk();
    TemporaryFile file(target_);
    std::string head = op_field(Op::kBagHeader) +
                       field("index_pos", raw(std::uint64_t{kBegin + written_})) +
                       field("conn_count", raw(static_cast<std::uint32_t>(connections_.size()))) +
                       field("chunk_count", raw(count_));
    const std::string padding(bag::kHeadBytes - 8 - head.size(), ' ');
    file.write(bag::kVersion);
    file.write(record(head, padding));
    file.append(chunks_);
    for (const auto& [topic, connection] : connections_) file.write(connection.second);
    file.write(infos_);
    file.publish();
  }

 private:
  static constexpr std::uint64_t kBegin = bag::kVersion.size() + bag::kHeadBytes;

  void end_chunk() {
    if (chunk_.empty()) return;
    std::string text = record(op_field(Op::kChunk) + field("compression", "none") +
                                  field("size", raw(static_cast<std::uint32_t>(chunk_.size()))),
                              chunk_);
    std::string counts;
    for (const auto& [connection, times] : chunk_times_) {
      std::string entries;
      for (const auto& [time, offset] : times) entries += raw_time(time) + raw(offset);
      const auto count = static_cast<std::uint32_t>(times.size());
      text += record(op_field(Op::kIndex) + field("ver", raw(std::uint32_t{1})) +
                         field("conn", raw(connection)) + field("count", raw(count)),
                     entries);
      counts += raw(connection) + raw(count);
    }
    infos_ +=
        record(op_field(Op::kChunkInfo) + field("ver", raw(std::uint32_t{1})) +
                   field("chunk_pos", raw(std::uint64_t{kBegin + written_})) +
                   field("start_time", raw_time(first_)) + field("end_time", raw_time(last_)) +
                   field("count", raw(static_cast<std::uint32_t>(chunk_times_.size()))),
               counts);
    chunks_.write(text);
    written_ += text.size();
    ++count_;
    chunk_.clear();
    chunk_times_.clear();
  }

  std::filesystem::path target_;
  TemporaryFile chunks_;
  std::map<std::string, std::pair<std::uint32_t, std::string>> connections_;
  std::string chunk_, infos_;
  std::map<std::uint32_t, std::vector<std::pair<Nanos, std::uint32_t>>> chunk_times_;
  Nanos first_{}, last_{};
  std::uint64_t written_ = 0;
  std::uint32_t count_ = 0;
};

}  // namespace

std::unique_ptr<RecordingWriter> make_bag(const std::filesystem::path& file) {
  return std::make_unique<BagWriter>(file);
}

}  // namespace pirt
