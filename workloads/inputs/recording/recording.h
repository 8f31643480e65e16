// What a robot's computer has recorded of its topics: a bag of ROS 1 (.bag), ROS 2's database
// (.db3) or MCAP, by themselves or in the folder that `ros2 bag record` makes. What the messages
// say is read elsewhere (messages.h, sequence/).
#pragma once

#include <cstdint>
#include <deque>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "workloads/base/system/temporary.h"
#include "workloads/base/time.h"
#include "workloads/inputs/recording/random_file.h"
#include "workloads/inputs/recording/wire.h"

namespace pirt {

struct Topic {
  std::string name;       ///< "/cam0/image_raw"
  std::string type = {};  ///< Of ROS 1, "sensor_msgs/Image", also where ROS 2 wrote it.
  std::size_t messages = 0;
  std::string encoding = "cdr";  ///< Of its messages; "ros1" is the other one that is read.
  /// Whether heads of messages count, as those of ROS 1 do.
  bool has_seq = false;

  /// In order of time. What the numbers mean is the format's; `at`, then `part`, say how messages
  /// lie in the file.
  struct Place {
    Nanos time{};  ///< Of recording, without what the recorder's clock was set back by.
    std::uint64_t at = 0, part = 0;
  };
  std::deque<Place> places = {};  ///< Of millions none is copied when it grows.
  /// By its encoding.
  [[nodiscard]] bool is_readable() const { return encoding == "cdr" || encoding == "ros1"; }
  /// "/imu (sensor_msgs/Imu, 800)"
  [[nodiscard]] std::string describe() const;
};
/// "sensor_msgs/msg/Image" as "sensor_msgs/Image".
[[nodiscard]] std::string ros1_type(const std::string& type);
[[nodiscard]] std::string ros2_type(std::string_view type);

/// Any thread may read.
class Recording {
 public:
  virtual ~Recording() = default;
  Recording(const Recording&) = delete;
  Recording& operator=(const Recording&) = delete;

  [[nodiscard]] const std::string& file() const { return file_; }
  /// By name.
  [[nodiscard]] const std::vector<Topic>& topics() const { return topics_; }
  /// Position in topics() of the one of that name whose type is among @p types, or that has
  /// another.
  /// @throws Error{kBadInput} with all that there are.
  [[nodiscard]] std::size_t topic(const std::string& name,
                                  const std::vector<std::string_view>& types = {}) const;
  /// Positions of the topics of a type that have messages which can be read.
  [[nodiscard]] std::vector<std::size_t> of_type(std::string_view type) const;
  /// All topics, for messages.
  [[nodiscard]] std::string describe() const;
  /// What a user should know of it: what is damaged and left out.
  [[nodiscard]] const std::vector<std::string>& warnings() const { return warnings_; }
  void warn(std::string warning) { warnings_.push_back(std::move(warning)); }
  /// What MCAP holds besides messages.
  [[nodiscard]] std::size_t attachments() const { return attachments_; }
  [[nodiscard]] std::size_t metadata() const { return metadata_; }
  static constexpr std::uint64_t kWhole = UINT64_MAX;
  /// The bytes of a message, in the order in which they were recorded; unpacked, where ROS 2's
  /// recorder packed each.
  /// @param most  Only its first so many bytes.
  /// @throws Error{kBadInput} if they are damaged.
  [[nodiscard]] std::string message(std::size_t topic, std::size_t index,
                                    std::uint64_t most = kWhole) const;
  /// Which topic's messages, and how many bytes of each.
  struct Wanted {
    std::size_t topic = 0;
    std::uint64_t most = kWhole;
  };
  /// The bytes of a message. @throws Error{kBadInput} if they are damaged.
  using Load = std::function<std::string()>;
  using Take = std::function<void(std::size_t topic, std::size_t index, const Load& load)>;
  /// All messages of several topics in order of time, so that each chunk is unpacked once.
  void walk(const std::vector<Wanted>& topics, const Take& take) const;
  /// When it was recorded.
  [[nodiscard]] Nanos time(std::size_t topic, std::size_t index) const {
    return topics_[topic].places[index].time;
  }
  /// What it lies in goes with it.
  void own(std::unique_ptr<TemporaryFolder> folder) { folder_ = std::move(folder); }
  /// Reads a message; @p bytes, which message() gave, has to stay.
  [[nodiscard]] WireReader reader(std::size_t topic, std::size_t index,
                                  std::string_view bytes) const;

 protected:
  explicit Recording(std::string file) : file_(std::move(file)) {}
  [[noreturn]] void fail(const std::string& problem) const;
  [[nodiscard]] virtual std::string load(const Topic::Place& place, std::uint64_t most) const = 0;
  /// Position of the one with the same name, type and encoding, added if there is none.
  std::size_t add(Topic topic);
  /// When all places are known: puts everything in order of time. Of a clock that begins anew the
  /// longest run is kept; where that of the recorder alone was set back, all is. Either is said. Of
  /// recordings that were put together one behind the other all is kept.
  void finish();

  std::string file_;
  std::vector<Topic> topics_;
  std::vector<std::string> warnings_;
  std::size_t attachments_ = 0, metadata_ = 0;
  bool was_set_back_ = false;  ///< Places have other times than the file.

 private:
  void keep_longest_run();

  std::unique_ptr<TemporaryFolder> folder_;
};

/// In TMPDIR, for what is unpacked or copied to be read. What processes that were killed left there
/// goes.
[[nodiscard]] std::unique_ptr<TemporaryFolder> recording_folder();

/// Whether a definition's std_msgs/Header counts; what has none is as @p otherwise says.
[[nodiscard]] bool defines_seq(std::string_view definition, bool otherwise);

/// Whether a file's name, or what is in a folder, is that of a recording: .bag, .db3, .mcap, and
/// the last two with .zstd behind.
[[nodiscard]] bool names_a_recording(const std::filesystem::path& path);

/// @param path  A file, or a folder of ROS 2: the parts that its metadata.yaml names, which are one
/// recording, or the only file that is there. What is packed as a whole is unpacked to TMPDIR.
/// @throws Error{kBadInput} if it is damaged, was not closed, or is packed in a way that is not
/// known.
[[nodiscard]] std::unique_ptr<Recording> open_recording(const std::filesystem::path& path);

/// Of each kind, as open_recording.
[[nodiscard]] std::unique_ptr<Recording> open_bag(const std::filesystem::path& file,
                                                  const Opening& as = {});
[[nodiscard]] std::unique_ptr<Recording> open_db3(const std::filesystem::path& file,
                                                  const Opening& as = {});
inline constexpr std::uint64_t kCheckedBytes = std::uint64_t{64} << 20;
/// @param checked_bytes  Up to this size all checksums are verified, and what is not whole is found
/// when it is opened; of larger ones with an index each chunk's when it is read.
[[nodiscard]] std::unique_ptr<Recording> open_mcap(const std::filesystem::path& file,
                                                   std::uint64_t checked_bytes = kCheckedBytes,
                                                   const Opening& as = {});

/// Makes a recording, which has its name when it is complete.
class RecordingWriter {
 public:
  virtual ~RecordingWriter() = default;
  /// @param type  One of messages.h.
  virtual void write(const std::string& topic, std::string_view type, Nanos time,
                     const std::string& message) = 0;
  [[nodiscard]] virtual WireFormat format() const = 0;
  /// @throws Error{kBadInput} if something could not be written.
  virtual void publish() = 0;
};
[[nodiscard]] std::unique_ptr<RecordingWriter> make_bag(const std::filesystem::path& file);
[[nodiscard]] std::unique_ptr<RecordingWriter> make_db3(const std::filesystem::path& file);
/// @param compression  Of chunks: "none", "lz4" or "zstd".
[[nodiscard]] std::unique_ptr<RecordingWriter> make_mcap(const std::filesystem::path& file,
                                                         std::string_view compression = "none");

}  // namespace pirt
