// The user's own pictures: found, checked and decoded before anything is measured. OpenCV decodes
// and scales; nothing is computed with it.
#include "workloads/inputs/pictures/images.h"

#include <fmt/core.h>

#include <algorithm>
#include <atomic>
#include <cctype>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <system_error>
#include <utility>

#include "workloads/base/error.h"
#include "workloads/base/hash.h"
#include "workloads/base/math/random.h"
#include "workloads/base/text/text.h"
#include "workloads/inputs/pictures/decoder.h"
#include "workloads/inputs/pictures/image_format.h"
#include "workloads/inputs/pictures/recorded_picture.h"
#include "workloads/inputs/recording/recording.h"

namespace pirt {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMaxFileBytes = std::size_t{1} << 30;
constexpr std::string_view kRemedy =
    "; replace the file by a whole PNG or JPEG picture, or take it away";

[[noreturn]] void throw_unusable(const fs::path& file, const std::string& why) {
  throw_bad_input("cannot use the picture '" + file.string() + "': " + why + std::string(kRemedy));
}

/// The file's bytes. @throws Error{kBadInput} naming the file.
std::string read_bytes(const fs::path& file) {
  std::error_code failed;
  const auto size = fs::file_size(file, failed);
  if (failed) throw_unusable(file, failed.message());
  if (size > kMaxFileBytes) throw_unusable(file, fmt::format("it has {} bytes", size));
  return read_file(file, kMaxFileBytes);
}

/// B, G, R, 8 bits.
cv::Mat decode(const fs::path& file, const std::string& bytes) {
  const auto check = check_image(bytes);
  if (!check.header) throw_unusable(file, check.problem);
  DecodedPicture decoded = decode_picture(bytes);
  if (!decoded.error.empty()) throw_unusable(file, "it does not decode: " + decoded.error);
  if (decoded.pixels.empty()) {
    throw_unusable(file, "it is corrupt: its pixels do not decode");
  }
  return decoded.pixels;
}

struct Fitted {
  cv::Mat pixels;
  std::vector<std::string> notes;
};

/// Scaled to cover @p width x @p height, keeping the aspect, and centre-cropped; cropped first,
/// which is the same picture with less work.
Fitted fit(const cv::Mat& picture, int width, int height) {
  const double scale = std::max(static_cast<double>(width) / picture.cols,
                                static_cast<double>(height) / picture.rows);
  const auto part = [scale](int wished, int have) {
    return std::clamp(static_cast<int>(std::lround(wished / scale)), 1, have);
  };
  const cv::Size kept(part(width, picture.cols), part(height, picture.rows));
  const cv::Rect centre({(picture.cols - kept.width) / 2, (picture.rows - kept.height) / 2}, kept);
  Fitted fitted{picture(centre), {}};
  if (kept != cv::Size(width, height)) {
    cv::Mat resized;
    cv::resize(fitted.pixels, resized, {width, height}, 0, 0,
               scale < 1.0 ? cv::INTER_AREA : cv::INTER_LINEAR);
    fitted.pixels = resized;
    fitted.notes.emplace_back("input_resized");
  }
  if (kept != picture.size()) fitted.notes.emplace_back("input_cropped");
  return fitted;
}

Picture gray_picture(const cv::Mat& picture, int width, int height) {
  auto fitted = fit(picture, width, height);
  Picture result{Tensor({"image", Element::kU8, {height, width}}), std::move(fitted.notes)};
  cv::Mat target(height, width, CV_8U, result.pixels.data());
  cv::cvtColor(fitted.pixels, target, cv::COLOR_BGR2GRAY);
  return result;
}

/// Planar R, G, B and, if there is one, alpha, of B, G, R, alpha.
Tensor planes_of(const cv::Mat& pixels) {
  const int channels = pixels.channels();
  Tensor planes({"image", Element::kU8, {channels, pixels.rows, pixels.cols}});
  for (int channel = 0; channel < channels; ++channel) {
    auto* plane = planes.data() + std::ptrdiff_t{channel} * pixels.rows * pixels.cols;
    cv::Mat target(pixels.rows, pixels.cols, CV_8U, plane);
    cv::extractChannel(pixels, target, channel < 3 ? 2 - channel : channel);
  }
  return planes;
}

/// B, G, R, alpha of a PNG: of any kind that has 8 bits or less.
cv::Mat with_alpha(const fs::path& file, const std::string& bytes, const ImageHeader& header) {
  const cv::Mat pixels = decode_unchanged(bytes);
  if (pixels.empty() || pixels.depth() != CV_8U) {
    throw_unusable(file, "it is corrupt: its pixels do not decode");
  }
  cv::Mat all = pixels;
  if (pixels.channels() == 1) cv::cvtColor(pixels, all, cv::COLOR_GRAY2BGRA);
  if (pixels.channels() == 3) cv::cvtColor(pixels, all, cv::COLOR_BGR2BGRA);
  if (header.transparent_grey) {
    const double grey = *header.transparent_grey;
    all.setTo(cv::Scalar(grey, grey, grey, 0), pixels == grey);
  }
  return all;
}

Picture rgb_picture(const cv::Mat& picture, int width, int height) {
  auto fitted = fit(picture, width, height);
  return {planes_of(fitted.pixels), std::move(fitted.notes)};
}

bool has_image_extension(const fs::path& file) {
  std::string extension = file.extension().string();
  std::ranges::transform(extension, extension.begin(),
                         [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return extension == ".png" || extension == ".jpg" || extension == ".jpeg";
}

/// Hidden ones are none.
std::vector<fs::path> picture_files(const fs::path& folder) {
  std::error_code failed;
  fs::directory_iterator entries(folder, failed);
  if (failed) {
    throw_bad_input("cannot read the folder '" + folder.string() + "': " + failed.message());
  }
  std::vector<fs::path> files;
  for (const auto& entry : entries) {
    const auto& path = entry.path();
    if (path.filename().string().starts_with('.') || !has_image_extension(path)) continue;
    if (!entry.is_directory(failed)) files.push_back(path);
  }
  std::ranges::sort(files);
  return files;
}

/// Pictures in their order, loaded when they are asked for: all of them may be larger than memory.
class LoadedImages : public ImageSource {
 public:
  Picture gray(int index, int width, int height) const override {
    return gray_picture(at(index), width, height);
  }

  Picture rgb(int index, int width, int height) const override {
    return rgb_picture(at(index), width, height);
  }

  /// In their order, back from the last, and so on: n pictures have n - 1 beginnings, since the
  /// first does not follow the last. A single one slides to the right by a pixel a frame.
  Picture gray_frame(int index, int frame, int width, int height) const override {
    if (hashes_.size() == 1) return slid(gray(0, width, height), frame, width);
    const auto turns = static_cast<std::int64_t>(hashes_.size()) - 1;
    const std::int64_t at = (index % turns + frame) % (2 * turns);
    return gray(static_cast<int>(std::min(at, 2 * turns - at)), width, height);
  }

  std::uint64_t content_hash() const override {
    std::uint64_t hash = hashes_.size();
    for (const std::uint64_t each : hashes_) hash = hash_u64(hash, each);
    return hash;
  }

 protected:
  /// B, G, R, 8 bits.
  [[nodiscard]] virtual cv::Mat load(std::size_t index) const = 0;

  std::vector<std::uint64_t> hashes_;  ///< Of the bytes of each.

 private:
  [[nodiscard]] cv::Mat at(int index) const {
    return load(static_cast<std::size_t>(index) % hashes_.size());
  }

  /// Moved right by @p frame pixels; the left edge is repeated.
  static Picture slid(Picture picture, int frame, int width) {
    if (frame == 0) return picture;
    Picture moved{Tensor(picture.pixels.spec()), picture.notes};
    const auto from = picture.pixels.as<std::uint8_t>();
    const auto to = moved.pixels.as<std::uint8_t>();
    for (std::size_t i = 0; i < from.size(); ++i) {
      const std::size_t x = i % static_cast<std::size_t>(width);
      to[i] = from[i - std::min(x, static_cast<std::size_t>(frame))];
    }
    return moved;
  }
};

class RecordedImages final : public LoadedImages {
 public:
  RecordedImages(const fs::path& path, const std::string& topic)
      : recording_(open_recording(path)), topic_(picture_topic(*recording_, topic)) {
    const std::size_t count = recording_->topics()[topic_].messages;
    std::vector<std::size_t> failed;
    std::string problem;
    for (std::size_t i = 0; i < count; ++i) use(i, failed, problem);
    // A dark one is known to be of 16 bits once a brighter one was seen.
    problem.clear();
    for (const std::size_t i : std::exchange(failed, {})) use(i, failed, problem);
    left_out_ = failed.size();
    if (static_cast<double>(left_out_) > kMostBadPart * static_cast<double>(count)) {
      throw_bad_input(problem);
    }
    std::ranges::sort(messages_);
    for (const std::size_t i : messages_) {
      hashes_.push_back(Hash64().add(recording_->message(topic_, i)).value());
    }
  }

  std::string describe() const override {
    return fmt::format("{} images of {} in {}{}", hashes_.size(), recording_->topics()[topic_].name,
                       recording_->file(),
                       left_out_ > 0 ? fmt::format(", {} left out", left_out_) : "");
  }

 private:
  /// Takes a message for a picture, or notes why it is none.
  void use(std::size_t message, std::vector<std::size_t>& failed, std::string& problem) {
    try {
      static_cast<void>(recorded_picture(*recording_, topic_, message, &is_deep_));
      messages_.push_back(message);
    } catch (const Error& error) {
      if (error.code() != ErrorCode::kBadInput) throw;
      failed.push_back(message);
      if (problem.empty()) problem = error.what();
    }
  }

  cv::Mat load(std::size_t index) const override {
    cv::Mat pixels = recorded_picture(*recording_, topic_, messages_[index], &is_deep_);
    if (pixels.channels() == 3) return pixels;
    cv::Mat coloured;
    cv::cvtColor(pixels, coloured, cv::COLOR_GRAY2BGR);
    return coloured;
  }

  std::unique_ptr<Recording> recording_;
  std::size_t topic_;
  std::vector<std::size_t> messages_;  ///< Of each picture.
  std::size_t left_out_ = 0;
  mutable std::atomic<bool> is_deep_ = false;
};

/// Keeps the paths.
class FileImages final : public LoadedImages {
 public:
  explicit FileImages(const fs::path& path) : path_(path) {
    std::error_code failed;
    const auto status = fs::status(path, failed);
    if (!fs::exists(status)) {
      throw_bad_input("cannot use '" + path.string() +
                      "' as pictures: " + (failed ? failed.message() : "no such file or folder"));
    }
    const auto files = fs::is_directory(status) ? pictures_of(path) : std::vector{path};
    for (const auto& file : files) {
      if (!fs::is_regular_file(file, failed)) throw_unusable(file, "it is not a regular file");
      const std::string bytes = read_bytes(file);
      static_cast<void>(decode(file, bytes));
      files_.push_back(file);
      hashes_.push_back(Hash64().add(bytes).value());
    }
  }

  std::string describe() const override {
    return fs::is_directory(path_) ? fmt::format("{} images of {}", files_.size(), path_.string())
                                   : "image " + path_.string();
  }

 private:
  cv::Mat load(std::size_t index) const override {
    const fs::path& file = files_[index];
    const std::string bytes = read_bytes(file);
    if (Hash64().add(bytes).value() != hashes_[index])
      throw_unusable(file, "it changed while in use");
    return decode(file, bytes);
  }

  fs::path path_;
  std::vector<fs::path> files_;
};

}  // namespace

std::vector<fs::path> pictures_of(const fs::path& folder) {
  auto files = picture_files(folder);
  if (files.empty()) {
    throw_bad_input("there are no PNG or JPEG files in '" + folder.string() +
                    "'; name a folder that has some, or one file");
  }
  return files;
}

Tensor rgb_pixels(const fs::path& file, bool alpha) {
  const std::string bytes = read_bytes(file);
  const auto header = check_image(bytes).header;
  if (header && header->bits > 8) {
    throw_bad_input(
        fmt::format("cannot use the picture '{}': it has {} bits a channel; convert it to 8 bits",
                    file.string(), header->bits));
  }
  const bool has_alpha = alpha && header && header->format == ImageFormat::kPng;
  return planes_of(has_alpha ? with_alpha(file, bytes, *header) : decode(file, bytes));
}

std::unique_ptr<ImageSource> images_from(const fs::path& path, const std::string& topic) {
  // As of a sequence: a recording beside pictures is what was made of them, or they of it.
  std::error_code failed;
  const bool is_pictures = topic.empty() && fs::is_directory(path, failed) &&
                           !fs::exists(path / "metadata.yaml", failed) &&
                           !picture_files(path).empty();
  if (!is_pictures && names_a_recording(path)) {
    return std::make_unique<RecordedImages>(path, topic);
  }
  if (!topic.empty()) {
    throw_bad_input("'" + path.string() + "' is no recording, and has no topic " + topic);
  }
  return std::make_unique<FileImages>(path);
}

}  // namespace pirt
