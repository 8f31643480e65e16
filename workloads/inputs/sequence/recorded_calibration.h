// What a recording, or a file that is given beside it, says of a topic's pictures.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "workloads/inputs/recording/recording.h"
#include "workloads/inputs/sequence/calibration_file.h"
#include "workloads/inputs/sequence/camera_info.h"

namespace pirt {

/// Of a topic; empty for one that is in none.
[[nodiscard]] std::string folder_of(const std::string& topic);
/// Without image_transport's part: "/cam0/image_raw" of "/cam0/image_raw/compressed".
[[nodiscard]] std::string base_topic(const std::string& topic);
/// Whether @p other shows nothing that @p topic does not.
[[nodiscard]] bool is_same_camera(const std::string& topic, const std::string& other);

struct RecordedCalibration {
  InfoCamera camera = {};
  std::optional<GivenCamera> given = {};  ///< What a file says instead.
};

class RecordedCalibrations {
 public:
  /// @param recording  Outlives this.
  /// @param file       Taken in place of all CameraInfo; empty = there is none.
  RecordedCalibrations(const Recording& recording, const std::filesystem::path& file);

  [[nodiscard]] bool are_given() const { return !given_.empty(); }
  /// The topic with a camera's CameraInfo. image_transport has the compressed one a level below.
  [[nodiscard]] std::optional<std::size_t> info_of(const std::string& name) const;
  /// @param name   Of the topic with its pictures.
  /// @param place  Among the cameras that are read, for files that name no topics.
  /// @throws Error{kBadInput} if there is none.
  [[nodiscard]] RecordedCalibration of(const std::string& name, std::size_t place,
                                       std::vector<std::string>& warnings) const;

 private:
  [[noreturn]] void fail(const std::string& problem) const;
  [[nodiscard]] const GivenCamera& given(const std::string& name, std::size_t place,
                                         std::vector<std::string>& warnings) const;

  const Recording& recording_;
  std::vector<GivenCamera> given_;
};

}  // namespace pirt
