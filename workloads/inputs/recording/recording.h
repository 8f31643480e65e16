// What a robot's computer has recorded of its topics: a bag of ROS 1 (.bag) or ROS 2's database
// (.db3). What the messages say is read elsewhere (messages.h, sequence/).
#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "workloads/base/time.h"
#include "workloads/inputs/recording/wire.h"

namespace pirt {

struct Topic {
  std::string name;  ///< "/cam0/image_raw"
  std::string type;  ///< Of ROS 1, "sensor_msgs/Image", also where ROS 2 wrote it.
  std::size_t messages = 0;
};

/// Any thread may read.
class Recording {
 public:
  virtual ~Recording() = default;
  Recording(const Recording&) = delete;
  Recording& operator=(const Recording&) = delete;

  [[nodiscard]] const std::string& file() const { return file_; }
  /// By name.
  [[nodiscard]] const std::vector<Topic>& topics() const { return topics_; }
  /// Position in topics(). @throws Error{kBadInput} with all that there are.
  [[nodiscard]] std::size_t topic(const std::string& name) const;
  /// Positions of the topics of a type that have messages.
  [[nodiscard]] std::vector<std::size_t> of_type(std::string_view type) const;
  /// The bytes of a message, in the order in which they were recorded.
  /// @throws Error{kBadInput} if they are damaged.
  [[nodiscard]] virtual std::string message(std::size_t topic, std::size_t index) const = 0;
  [[nodiscard]] virtual WireFormat format() const = 0;
  /// Reads a message; @p bytes, which message() gave, has to stay.
  [[nodiscard]] WireReader reader(std::size_t topic, std::size_t index,
                                  std::string_view bytes) const;

 protected:
  explicit Recording(std::string file) : file_(std::move(file)) {}
  [[noreturn]] void fail(const std::string& problem) const;

  std::string file_;
  std::vector<Topic> topics_;
};

/// Whether a file's name, or what is in a folder, is that of a recording: .bag, .db3.
[[nodiscard]] bool names_a_recording(const std::filesystem::path& path);

/// @param path  A .bag, a .db3, or a folder of ROS 2 with one .db3.
/// @throws Error{kBadInput} if it is damaged, was not closed, or is packed in a way that is not
/// known.
[[nodiscard]] std::unique_ptr<Recording> open_recording(const std::filesystem::path& path);

/// Of each kind, as open_recording.
[[nodiscard]] std::unique_ptr<Recording> open_bag(const std::filesystem::path& file);
[[nodiscard]] std::unique_ptr<Recording> open_db3(const std::filesystem::path& file);

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

}  // namespace pirt
