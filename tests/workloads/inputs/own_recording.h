// A recording that a test makes message by message.
#pragma once

#include <gtest/gtest.h>

#include <cstdint>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "tests/support/errors.h"
#include "tests/workloads/inputs/sequence_support.h"
#include "workloads/inputs/recording/messages.h"
#include "workloads/inputs/recording/recording.h"

namespace pirt::test {

class OwnRecording : public testing::Test {
 protected:
  void add(const std::string& topic, std::string_view type, const std::string& message) {
    writer_->write(topic, type, Nanos(++written_), message);
  }
  void add_picture(const std::string& topic, const std::string& encoding, int width, int height,
                   const std::string& data) {
    add(topic, ImageMessage::kType,
        written(ImageMessage{.head = {Nanos(written_ + 1), frame_},
                             .compressed = false,
                             .width = width,
                             .height = height,
                             .encoding = encoding,
                             .step = data.size() / static_cast<std::size_t>(height),
                             .data = data},
                writer_->format()));
  }
  /// @param encoding  Of @p data: "png", "jpeg".
  void add_compressed(const std::string& topic, const std::string& encoding,
                      const std::string& data) {
    add(topic, ImageMessage::kCompressedType,
        written(ImageMessage{.head = {Nanos(written_ + 1), frame_},
                             .compressed = true,
                             .encoding = encoding,
                             .data = data},
                writer_->format()));
  }
  /// Of 16x16 pixels.
  [[nodiscard]] static CameraInfoMessage info() {
    CameraInfoMessage message;
    message.width = message.height = 16;
    message.distortion_model = "plumb_bob";
    message.d = {0};
    message.k = {20, 0, 8, 0, 20, 8, 0, 0, 1};
    message.p = {20, 0, 8, 0, 0, 20, 8, 0, 0, 0, 1, 0};
    return message;
  }
  void add_info(const std::string& topic, const CameraInfoMessage& message = info()) {
    add(topic, CameraInfoMessage::kType, written(message, writer_->format()));
  }
  void add_info(const std::string& topic, const std::string& lens, std::vector<double> d) {
    CameraInfoMessage message = info();
    message.distortion_model = lens;
    message.d = std::move(d);
    add_info(topic, message);
  }
  [[nodiscard]] Sequence read(const ReadOptions& options = {}) {
    writer_->publish();
    return read_sequence(file_, options);
  }
  [[nodiscard]] std::string problem() {
    return bad_input([&] {
      const Sequence sequence = read();
      static_cast<void>(sequence.image(0, 0));
    });
  }

  const ScratchFolder scratch_;
  std::filesystem::path file_ = scratch_.path() / "own.bag";
  std::unique_ptr<RecordingWriter> writer_ = make_bag(file_);
  std::int64_t written_ = 0;
  std::string frame_ = "camera";  ///< Of the pictures.
};

}  // namespace pirt::test
