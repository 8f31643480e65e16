// Small sequences for tests: generated ones, and folders of EuRoC's layout that a test may damage.
#pragma once

#include <gtest/gtest.h>

#include <array>
#include <filesystem>
#include <fstream>
#include <memory>
#include <sstream>
#include <string>
#include <vector>

#include "workloads/inputs/scene/generator.h"
#include "workloads/inputs/sequence/sequence.h"

namespace pirt::test {

/// A folder that is gone when the test ends.
class ScratchFolder {
 public:
  ScratchFolder() {
    std::string name = (std::filesystem::temp_directory_path() / "pirt-seq-XXXXXX").string();
    if (::mkdtemp(name.data()) == nullptr) std::abort();
    path_ = name;
  }
  ~ScratchFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  ScratchFolder(const ScratchFolder&) = delete;
  ScratchFolder& operator=(const ScratchFolder&) = delete;
  [[nodiscard]] const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

inline SceneOptions scene(std::uint64_t seed, double duration_s, bool stereo = true) {
  SceneOptions options;
  options.path.seed = seed;
  options.path.duration_s = duration_s;
  if (duration_s <= options.path.rest_s) options.path.rest_s = 0.2 * duration_s;
  options.stereo = stereo;
  return options;
}

/// Renders each picture once, for tests that run a sequence several times; of one thread at a time.
inline Sequence remembering(Sequence sequence) {
  auto pictures = std::make_shared<std::vector<std::array<GreyImage, 2>>>(sequence.frames.size());
  sequence.image = [pictures, render = sequence.image](std::size_t frame, std::size_t camera) {
    GreyImage& picture = (*pictures)[frame][camera];
    if (picture.empty()) picture = render(frame, camera);
    return picture;
  };
  return sequence;
}

inline Sequence mono(Sequence sequence) {
  sequence.cameras.resize(1);
  for (auto& frame : sequence.frames) frame.present.resize(1);
  return sequence;
}

/// A folder of a second of small pictures.
inline void write_small_sequence(const std::filesystem::path& folder) {
  SceneOptions options = scene(3, 1.0);
  options.path.rest_s = 0.2;
  options.width = 160;
  options.height = 120;
  options.camera_rate_hz = 10;
  write_euroc(generate_sequence(options), folder, 1);
}

inline std::string text_of(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  std::ostringstream text;
  text << in.rdbuf();
  return text.str();
}

inline void put(const std::filesystem::path& file, const std::string& text) {
  std::ofstream(file, std::ios::binary) << text;
}

/// @p text with the first @p from replaced.
inline std::string replaced(std::string text, const std::string& from, const std::string& to) {
  const auto at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return at == std::string::npos ? text : text.replace(at, from.size(), to);
}

/// Line @p number (from 0) of a text, without its newline.
inline std::string line_of(const std::string& text, int number) {
  std::istringstream in(text);
  std::string line;
  for (int i = 0; i <= number; ++i) std::getline(in, line);
  return line;
}

}  // namespace pirt::test
