// Pictures: generated ones, the user's files, and what is wrong with files.
#include "workloads/inputs/pictures/images.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <functional>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <set>

#include "tests/support/data.h"
#include "workloads/base/error.h"
#include "workloads/base/math/random.h"
#include "workloads/base/text/text.h"
#include "workloads/inputs/pictures/decoder.h"

namespace pirt {
namespace {

namespace fs = std::filesystem;
using testing::ElementsAre;
using testing::HasSubstr;

/// A folder of its own for each test.
class ImageFiles : public testing::Test {
 protected:
  ImageFiles() : folder_(fs::path(testing::TempDir()) / ("pirt_images_" + name())) {
    fs::remove_all(folder_);
    fs::create_directories(folder_);
  }
  ~ImageFiles() override { fs::remove_all(folder_); }

  static std::string name() {
    return testing::UnitTest::GetInstance()->current_test_info()->name() +
           std::to_string(::getpid());
  }
  fs::path path(const std::string& file) const { return folder_ / file; }

  fs::path save(const std::string& file, const cv::Mat& picture) const {
    std::vector<std::uint8_t> bytes;
    cv::imencode(fs::path(file).extension() == ".png" ? ".png" : ".jpg", picture, bytes);
    return write(file, {bytes.begin(), bytes.end()});
  }
  fs::path write(const std::string& file, const std::string& bytes) const {
    std::ofstream(path(file), std::ios::binary) << bytes;
    return path(file);
  }

  fs::path folder_;
};

/// Horizontal ramp, 3 x columns.
cv::Mat ramp(int width, int height) {
  cv::Mat picture(height, width, CV_8U);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x)
      picture.at<std::uint8_t>(y, x) = static_cast<std::uint8_t>(3 * x);
  }
  return picture;
}

std::vector<std::uint8_t> pixels(const Tensor& tensor) {
  const auto values = tensor.as<std::uint8_t>();
  return {values.begin(), values.end()};
}

/// The message of the Error{kBadInput} that @p use throws; what libraries print meanwhile must be
/// nothing.
std::string complaint(const std::function<void()>& use) {
  testing::internal::CaptureStderr();
  std::string message = "nothing was thrown";
  try {
    use();
  } catch (const Error& error) {
    message = error.what();
    EXPECT_EQ(error.code(), ErrorCode::kBadInput);
  }
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "");
  return message;
}

std::string complaint_about(const fs::path& path) {
  return complaint([&] { static_cast<void>(images_from(path)); });
}

std::uint32_t crc32(const std::string& bytes) {
  std::uint32_t crc = ~0U;
  for (const char c : bytes) {
    crc ^= static_cast<unsigned char>(c);
    for (int bit = 0; bit < 8; ++bit) crc = (crc >> 1) ^ ((crc & 1U) != 0 ? 0xedb88320U : 0U);
  }
  return ~crc;
}

std::string big_endian(std::uint32_t value) {
  std::string bytes;
  for (int shift = 24; shift >= 0; shift -= 8) bytes += static_cast<char>(value >> shift & 0xff);
  return bytes;
}

std::string png_chunk(const std::string& type, const std::string& data) {
  return big_endian(static_cast<std::uint32_t>(data.size())) + type + data +
         big_endian(crc32(type + data));
}

/// A PNG that is well-formed but for its pixels, of which there are none that decode.
std::string png(std::uint32_t width, std::uint32_t height) {
  return std::string("\x89PNG\r\n\x1a\n") +
         png_chunk("IHDR",
                   big_endian(width) + big_endian(height) + std::string("\x08\0\0\0\0", 5)) +
         png_chunk("IDAT", "no deflate stream") + png_chunk("IEND", "");
}

TEST(GeneratedImages, AreAFunctionOfSeedIndexAndSize) {
  const auto bytes = [](std::uint64_t seed, int index) {
    return pixels(generated_images(seed)->gray(index, 64, 48).pixels);
  };
  EXPECT_EQ(bytes(1, 0), bytes(1, 0));
  EXPECT_NE(bytes(1, 0), bytes(2, 0));
  EXPECT_NE(bytes(1, 0), bytes(1, 1));
  EXPECT_EQ(generated_images(1)->content_hash(), generated_images(1)->content_hash());
  EXPECT_NE(generated_images(1)->content_hash(), generated_images(2)->content_hash());
  EXPECT_EQ(generated_images(7)->describe(), "generated, seed 7");
}

// Pinned: g++ and clang, Debug and Release, must make the same pictures, or stored profiles stop
// being comparable.
TEST(GeneratedImages, AreTheSameWithEveryCompiler) {
  std::uint64_t hash = 0;
  for (const auto pixel : pixels(generated_images(1)->rgb(0, 161, 97).pixels)) {
    hash = hash_u64(hash, pixel);
  }
  EXPECT_EQ(hash, 12762453047195525606ULL);
}

TEST(GeneratedImages, AreTexturedInAllParts) {
  const auto picture = generated_images(3)->gray(0, 640, 480);
  const auto values = picture.pixels.as<std::uint8_t>();
  for (std::size_t block = 0; block < 48; ++block) {  // 80x80 pixels each
    std::set<int> levels;
    for (std::size_t i = 0; i < 6400; ++i) {
      levels.insert(values[(block / 8 * 80 + i / 80) * 640 + block % 8 * 80 + i % 80]);
    }
    EXPECT_GE(levels.size(), 16U) << "block " << block;
  }
}

TEST(GeneratedImages, ExistFromOnePixelOn) {
  const auto images = generated_images(1);
  EXPECT_EQ(images->gray(0, 1, 1).pixels.count(), 1);
  EXPECT_EQ(images->rgb(5, 3, 2).pixels.spec().shape, (std::vector<std::int64_t>{3, 2, 3}));
}

// The second frame is the first one moved right by 6/8 and up by 4/8 of a pixel: away from
// rectangles and octaves' kinks it is the bilinear interpolation of the first, next(x, y) =
// previous(x - 0.75, y + 0.5). Rounding and the kinks move single pixels by a few levels, so the
// mean difference is asked to be far below that of the unmoved pair.
TEST(GeneratedImages, PairMovesByAFractionOfAPixel) {
  const auto [previous, next] = generated_images(1)->gray_pair(0, 320, 240);
  EXPECT_EQ(pixels(previous.pixels), pixels(generated_images(1)->gray(0, 320, 240).pixels));
  const auto a = previous.pixels.as<std::uint8_t>();
  const auto b = next.pixels.as<std::uint8_t>();
  double moved = 0.0, unmoved = 0.0;
  for (std::size_t y = 1; y + 1 < 240; ++y) {
    for (std::size_t x = 1; x + 1 < 320; ++x) {
      const auto at = [&](std::size_t dy, std::size_t dx) {
        return 1.0 * a[(y + dy) * 320 + x - 1 + dx];
      };
      const double interpolated =
          0.5 * (0.75 * at(0, 0) + 0.25 * at(0, 1)) + 0.5 * (0.75 * at(1, 0) + 0.25 * at(1, 1));
      moved += std::abs(b[y * 320 + x] - interpolated);
      unmoved += std::abs(b[y * 320 + x] - 1.0 * a[y * 320 + x]);
    }
  }
  EXPECT_LT(moved, unmoved / 4.0);
}

TEST(PictureIndex, SeedOneTakesTheFirst) {
  EXPECT_EQ(picture_index(1), 0);
  EXPECT_EQ(picture_index(2), 1);
  EXPECT_GE(picture_index(0), 0);
  EXPECT_GE(picture_index(~std::uint64_t{0}), 0);
}

TEST_F(ImageFiles, PictureOfTheRightSizeIsUsedAsItIs) {
  save("a.png", ramp(8, 4));
  const auto picture = images_from(folder_)->gray(0, 8, 4);
  EXPECT_TRUE(picture.notes.empty());
  auto row = pixels(picture.pixels);
  row.resize(8);
  EXPECT_THAT(row, ElementsAre(0, 3, 6, 9, 12, 15, 18, 21));
}

// 8x4 to 4x4: the height fits, so that the scale is 1 and columns 2 .. 5 stay. 8x4 to 4x2: halved,
// each pixel the mean of 2x2: (0 + 3) / 2 = 1.5 -> 2, (6 + 9) / 2 = 7.5 -> 8, 13.5 -> 14, 19.5
// -> 20. 8x4 to 8x8: scaled by 2, of which columns 2 .. 5 are seen.
TEST_F(ImageFiles, AreScaledToCoverAndCroppedInTheMiddle) {
  save("a.png", ramp(8, 4));
  const auto images = images_from(path("a.png"));
  const auto cropped = images->gray(0, 4, 4);
  EXPECT_THAT(cropped.notes, ElementsAre("input_cropped"));
  EXPECT_EQ(pixels(cropped.pixels)[0], 6);
  EXPECT_EQ(pixels(cropped.pixels)[3], 15);
  const auto resized = images->gray(0, 4, 2);
  EXPECT_THAT(resized.notes, ElementsAre("input_resized"));
  EXPECT_THAT(pixels(resized.pixels), ElementsAre(2, 8, 14, 20, 2, 8, 14, 20));
  const auto both = images->gray(0, 8, 8);
  EXPECT_THAT(both.notes, ElementsAre("input_resized", "input_cropped"));
  EXPECT_EQ(both.pixels.spec().shape, (std::vector<std::int64_t>{8, 8}));
}

TEST_F(ImageFiles, ExtremeAspectsNeedNoExtremeMemory) {
  save("line.png", ramp(1, 3000));
  const auto images = images_from(folder_);
  EXPECT_EQ(images->gray(0, 640, 480).pixels.count(), 640 * 480);
  EXPECT_EQ(images->gray(0, 1, 1).pixels.count(), 1);
}

// Grey = (4899 R + 9617 G + 1868 B + 8192) >> 14 (OpenCV): 200, 100, 50 gives 2 035 100 / 16384 =
// 124.2 -> 124.
TEST_F(ImageFiles, ColourHasOpenCvsGreyAndPlanesInOrderRgb) {
  save("a.png", cv::Mat(2, 2, CV_8UC3, cv::Scalar(50, 100, 200)));  // B, G, R
  const auto images = images_from(folder_);
  EXPECT_THAT(pixels(images->gray(0, 2, 2).pixels), ElementsAre(124, 124, 124, 124));
  const auto rgb = images->rgb(0, 2, 1);
  EXPECT_EQ(rgb.pixels.spec().shape, (std::vector<std::int64_t>{3, 1, 2}));
  EXPECT_THAT(pixels(rgb.pixels), ElementsAre(200, 200, 100, 100, 50, 50));
}

TEST_F(ImageFiles, SixteenBitsAlphaAndGreyAreAccepted) {
  save("a.png", cv::Mat(2, 2, CV_16U, cv::Scalar(0x8000)));
  save("b.png", cv::Mat(2, 2, CV_8UC4, cv::Scalar(90, 90, 90, 17)));
  save("c.png", cv::Mat(2, 2, CV_8U, cv::Scalar(33)));
  save("d.png", cv::Mat(2, 2, CV_16UC4, cv::Scalar(0x4000, 0x4000, 0x4000, 0x1000)));
  const auto images = images_from(folder_);
  const std::vector<int> expected = {0x80, 90, 33, 0x40};
  for (int i = 0; i < 4; ++i) {
    EXPECT_EQ(pixels(images->gray(i, 2, 2).pixels)[0], expected[static_cast<std::size_t>(i)]) << i;
  }
}

TEST_F(ImageFiles, ComeInNameOrderAndOtherFilesAreIgnored) {
  save("b.JPG", cv::Mat(8, 8, CV_8U, cv::Scalar(20)));
  save("a.png", cv::Mat(8, 8, CV_8U, cv::Scalar(10)));
  save("c.Jpeg", cv::Mat(8, 8, CV_8U, cv::Scalar(30)));
  write("notes.txt", "no picture");
  write("._a.png", "left by a Mac");
  fs::create_directories(path("folder.png"));
  const auto images = images_from(folder_);
  EXPECT_EQ(images->describe(), "3 images of " + folder_.string());
  std::vector<int> levels;
  for (int i = 0; i < 4; ++i) levels.push_back(pixels(images->gray(i, 8, 8).pixels)[0]);
  EXPECT_THAT(levels, ElementsAre(10, 20, 30, 10));  // wraps around
}

TEST_F(ImageFiles, AreTakenWhereRecordingsLieBesideThem) {
  save("a.png", ramp(8, 4));
  for (const char* recording : {"a.bag", "b.bag"}) {
    write(recording, "not even one");
    EXPECT_EQ(images_from(folder_)->describe(), "1 images of " + folder_.string());
  }
}

TEST_F(ImageFiles, PairIsConsecutiveFilesAndNeverLastToFirst) {
  for (int i = 0; i < 3; ++i) {
    save(std::to_string(i) + ".png", cv::Mat(4, 4, CV_8U, cv::Scalar(10.0 * i)));
  }
  const auto images = images_from(folder_);
  const auto levels = [&](int index) {
    const auto [previous, next] = images->gray_pair(index, 4, 4);
    return std::pair<int, int>(pixels(previous.pixels)[0], pixels(next.pixels)[0]);
  };
  EXPECT_EQ(levels(0), std::pair(0, 10));
  EXPECT_EQ(levels(1), std::pair(10, 20));
  EXPECT_EQ(levels(2), std::pair(0, 10));
}

TEST_F(ImageFiles, PairOfOnePictureIsMovedByAPixel) {
  save("a.png", ramp(4, 1));
  const auto [previous, next] = images_from(folder_)->gray_pair(0, 4, 1);
  EXPECT_THAT(pixels(previous.pixels), ElementsAre(0, 3, 6, 9));
  EXPECT_THAT(pixels(next.pixels), ElementsAre(0, 0, 3, 6));
}

TEST_F(ImageFiles, ContentHashIsThatOfTheBytes) {
  save("a.png", ramp(8, 4));
  const auto before = images_from(folder_)->content_hash();
  EXPECT_EQ(images_from(folder_)->content_hash(), before);
  save("a.png", ramp(8, 5));
  EXPECT_NE(images_from(folder_)->content_hash(), before);
}

TEST_F(ImageFiles, FileThatChangesWhileInUseIsAnError) {
  save("a.png", ramp(8, 4));
  const auto images = images_from(folder_);
  save("a.png", ramp(8, 5));
  EXPECT_THAT(complaint([&] { static_cast<void>(images->gray(0, 8, 4)); }), HasSubstr("changed"));
  fs::remove(path("a.png"));
  EXPECT_THAT(complaint([&] { static_cast<void>(images->gray(0, 8, 4)); }), HasSubstr("a.png"));
}

TEST_F(ImageFiles, UnusablePathsAreNamed) {
  EXPECT_THAT(complaint_about(path("missing")), HasSubstr("missing"));
  EXPECT_THAT(complaint_about(folder_), HasSubstr("no PNG or JPEG files"));
  EXPECT_THAT(complaint_about(write("notes.txt", "text")), HasSubstr("neither a PNG nor a JPEG"));
  EXPECT_THAT(complaint_about("/dev/zero"), HasSubstr("not a regular file"));
  fs::create_symlink(path("nowhere"), path("link.png"));
  EXPECT_THAT(complaint_about(folder_), HasSubstr("link.png"));
}

TEST_F(ImageFiles, WhatIsNoWholePictureIsRefusedWithItsName) {
  const std::string whole_png = read_file(save("w.png", ramp(64, 48)));
  cv::Mat noise(48, 64, CV_8UC3);
  cv::randu(noise, 0, 255);
  const std::string whole_jpg = read_file(save("w.jpg", noise));
  std::string flipped = whole_png;
  flipped[whole_png.size() / 2] = static_cast<char>(flipped[whole_png.size() / 2] ^ 1);
  // The second half of the pixels is gone, the end marker is there: only the decoder can tell.
  const std::string hollow = whole_jpg.substr(0, whole_jpg.size() / 2) + "\xff\xd9";
  const std::vector<std::pair<std::string, std::string>> cases = {
      {"", "empty"},
      {"plain text", "neither a PNG nor a JPEG"},
      {"GIF89a", "neither a PNG nor a JPEG"},
      {whole_png.substr(0, whole_png.size() - 1), "cut off"},
      {whole_png.substr(0, whole_png.size() / 2), "cut off"},
      {whole_png.substr(0, 20), "cut off"},
      {whole_png.substr(0, 8), "cut off"},
      {flipped, "checksum"},
      {png(64, 48), "do not decode"},
      {png(100'000, 100'000), "too many"},
      {png(0x7fffffff, 0x7fffffff), "too many"},
      {png(0xffffffff, 1), "too many"},
      {png(0, 0), "do not decode"},
      {whole_jpg.substr(0, whole_jpg.size() - 2), "cut off"},
      {whole_jpg.substr(0, whole_jpg.size() / 2), "cut off"},
      {whole_jpg.substr(0, 3), "cut off"},
      {hollow, "corrupt"},
      {std::string("\xff\xd8\xff\xd9", 4), "no picture"},
  };
  for (std::size_t i = 0; i < cases.size(); ++i) {
    for (const std::string extension : {".png", ".jpg"}) {
      const std::string file = "case" + std::to_string(i) + extension;
      const std::string message = complaint_about(write(file, cases[i].first));
      EXPECT_THAT(message, HasSubstr(file));
      EXPECT_THAT(message, HasSubstr(cases[i].second)) << "case " << i;
      EXPECT_THAT(message, HasSubstr("replace the file"));
    }
  }
}

TEST_F(ImageFiles, AJpegIsDecodedAsByOpenCvUnlessItIsDamaged) {
  cv::Mat coloured(48, 64, CV_8UC3), grey;
  cv::randu(coloured, 0, 255);
  cv::cvtColor(coloured, grey, cv::COLOR_BGR2GRAY);
  for (const cv::Mat& picture : {coloured, grey}) {
    const std::string whole = read_file(save("a.jpg", picture));
    const cv::Mat expected =
        cv::imdecode(std::vector<std::uint8_t>(whole.begin(), whole.end()), cv::IMREAD_UNCHANGED);
    const cv::Mat decoded = decode_unchanged(whole);
    ASSERT_EQ(decoded.type(), picture.type());
    ASSERT_EQ(decoded.size(), picture.size());
    EXPECT_EQ(cv::norm(decoded, expected, cv::NORM_INF), 0);
    const std::string end = "\xff\xd9", body = whole.substr(0, whole.size() - end.size());
    testing::internal::CaptureStderr();
    EXPECT_TRUE(decode_unchanged(body.substr(0, body.size() / 2) + end).empty());
    EXPECT_FALSE(decode_unchanged(body + std::string(4, '\0') + end).empty()) << "which pads it";
    EXPECT_EQ(testing::internal::GetCapturedStderr(), "");
  }
}

// Seeded damage anywhere in a file: refused or decoded, never a crash, never noise.
TEST_F(ImageFiles, DamageNeverCrashes) {
  cv::Mat noise(32, 40, CV_8UC3);
  cv::randu(noise, 0, 255);
  Random random(11);
  for (const std::string file : {"a.png", "a.jpg"}) {
    const std::string whole = read_file(save(file, noise));
    for (int i = 0; i < 150; ++i) {
      std::string damaged = whole;
      for (int k = 0; k < 3; ++k)
        damaged[random.below(whole.size())] = static_cast<char>(random.next());
      if (i % 3 == 0) damaged.resize(random.below(whole.size()));
      write(file, damaged);
      complaint_about(path(file));
    }
  }
}

TEST_F(ImageFiles, RealFilesOfACameraAreRead) {
  PIRT_DATA_OR_SKIP(data, "euroc-v1_01-static-camera");
  const auto images = images_from(data / "cam0");
  EXPECT_THAT(images->describe(), HasSubstr("20 images of"));
  EXPECT_TRUE(images->gray(0, 752, 480).notes.empty());
  EXPECT_THAT(images->gray(0, 640, 480).notes, ElementsAre("input_cropped"));
  EXPECT_THAT(images->gray(0, 1920, 1080).notes, ElementsAre("input_resized", "input_cropped"));
  const auto [previous, next] = images->gray_pair(0, 752, 480);
  EXPECT_NE(pixels(previous.pixels), pixels(next.pixels));
}

}  // namespace
}  // namespace pirt
