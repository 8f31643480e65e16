// Maps of ROS's map_server: YAML and a picture.
#include <fmt/core.h>

#include <algorithm>
#include <cctype>
#include <numbers>
#include <string_view>

#include "workloads/base/text/numbers.h"
#include "workloads/base/text/text.h"
#include "workloads/base/text/yaml.h"
#include "workloads/inputs/pictures/image_format.h"
#include "workloads/inputs/pictures/images.h"
#include "workloads/model/grey_image.h"
#include "workloads/planning/map_files.h"

namespace pirt::planning {
namespace {

namespace fs = std::filesystem;

struct MapPicture {
  GreyImage grey;
  int white = 255;  ///< The value of white.
  /// Of each pixel, 0 = transparent; empty = none is.
  std::vector<std::uint8_t> alpha = {};
};

[[noreturn]] void throw_unusable(const fs::path& file, const std::string& why) {
  throw_bad_input(fmt::format("cannot use '{}' as a map: {}; export it as 8-bit grey PGM or PNG",
                              file.string(), why));
}

void check_size(const fs::path& file, std::int64_t width, std::int64_t height) {
  if (width <= kLongestSide && height <= kLongestSide && width * height <= kMostCells) return;
  throw_unusable(file, fmt::format("{}x{} pixels are too many (the limit is {}, at most {} a side)",
                                   width, height, kMostCells, kLongestSide));
}

/// Numbers of a PGM file's text: digits with blanks and comments between them.
class PgmText {
 public:
  PgmText(const fs::path& file, std::string_view bytes) : file_(file), bytes_(bytes) {}

  int number(int low, int high, std::string_view what) {
    skip_blanks();
    const std::size_t begin = at_;
    while (at_ < bytes_.size() && std::isdigit(static_cast<unsigned char>(bytes_[at_])) != 0) ++at_;
    const auto read = whole_number(bytes_.substr(begin, at_ - begin), low, high);
    if (!read.value) throw_unusable(file_, fmt::format("its {} {}", what, read.problem));
    return *read.value;
  }
  /// Whatever follows one blank.
  std::string_view rest() { return bytes_.substr(std::min(bytes_.size(), at_ + 1)); }
  bool at_end() {
    skip_blanks();
    return at_ == bytes_.size();
  }

 private:
  void skip_blanks() {
    while (at_ < bytes_.size()) {
      if (bytes_[at_] == '#') {
        at_ = std::min(bytes_.size(), bytes_.find('\n', at_));
      } else if (std::isspace(static_cast<unsigned char>(bytes_[at_])) != 0) {
        ++at_;
      } else {
        return;
      }
    }
  }

  const fs::path& file_;
  std::string_view bytes_;
  std::size_t at_ = 2;
};

/// @source netpbm, pgm(5)
MapPicture read_pgm(const fs::path& file, std::string_view bytes) {
  constexpr int kDeepest = 65'535;
  PgmText text(file, bytes);
  MapPicture picture;
  picture.grey.width = text.number(1, 1'000'000'000, "width");
  picture.grey.height = text.number(1, 1'000'000'000, "height");
  check_size(file, picture.grey.width, picture.grey.height);
  picture.white = text.number(1, kDeepest, "value of white");
  if (picture.white > 255) throw_unusable(file, "it has 16 bits a pixel");
  const auto count =
      static_cast<std::size_t>(picture.grey.width) * static_cast<std::size_t>(picture.grey.height);
  if (bytes[1] == '5') {
    std::string_view pixels = text.rest();
    // Some programs end it as they end a text.
    while (pixels.size() > count && std::isspace(static_cast<unsigned char>(pixels.back())) != 0) {
      pixels.remove_suffix(1);
    }
    if (pixels.size() != count) {
      throw_unusable(file, fmt::format("it has {} bytes of pixels where its header says {}",
                                       pixels.size(), count));
    }
    picture.grey.pixels.assign(pixels.begin(), pixels.end());
  } else {
    for (std::size_t i = 0; i < count; ++i) {
      if (text.at_end())
        throw_unusable(file, fmt::format("it ends after {} of {} pixels", i, count));
      picture.grey.pixels.push_back(
          static_cast<std::uint8_t>(text.number(0, picture.white, "pixel")));
    }
    if (!text.at_end()) throw_unusable(file, "there is more after its pixels");
  }
  const auto brightest = std::ranges::max(picture.grey.pixels);
  if (brightest > picture.white) {
    throw_unusable(file, fmt::format("a pixel is {} where white is {}", brightest, picture.white));
  }
  return picture;
}

MapPicture read_png(const fs::path& file, const std::string& bytes) {
  const auto checked = check_image(bytes);
  if (!checked.header) throw_unusable(file, checked.problem);
  check_size(file, checked.header->width, checked.header->height);
  if (checked.header->bits > 8) {
    throw_unusable(file, fmt::format("it has {} bits a channel", checked.header->bits));
  }
  const Tensor planes = rgb_pixels(file, true);
  MapPicture picture;
  picture.grey.height = static_cast<int>(planes.dim(1));
  picture.grey.width = static_cast<int>(planes.dim(2));
  const auto values = planes.as<std::uint8_t>();
  const std::size_t count = values.size() / static_cast<std::size_t>(planes.dim(0));
  picture.grey.pixels.resize(count);
  for (std::size_t i = 0; i < count; ++i) {
    const int sum = values[i] + values[i + count] + values[i + 2 * count];
    picture.grey.pixels[i] = static_cast<std::uint8_t>(sum / 3);
  }
  const auto alpha = values.subspan(3 * count);
  picture.alpha.assign(alpha.begin(), alpha.end());
  return picture;
}

MapPicture read_picture(const fs::path& file) {
  const std::string bytes = read_file(file);
  if (bytes.starts_with("P5") || bytes.starts_with("P2")) return read_pgm(file, bytes);
  // The rest of netpbm's family: bitmaps, and colour.
  if (bytes.size() > 1 && bytes[0] == 'P' && bytes[1] >= '1' && bytes[1] <= '7') {
    throw_unusable(file, "it is of netpbm's kind " + bytes.substr(0, 2) + ", not a grey map (P5)");
  }
  return read_png(file, bytes);
}

enum class Mode : std::uint8_t { kTrinary, kScale, kRaw };

struct Reading {
  Mode mode = Mode::kTrinary;
  bool negate = false;
  double occupied_above = 0.65;
  double free_below = 0.196;

  [[nodiscard]] CellState state_of(int pixel, int white, int alpha) const {
    constexpr int kOpaque = 255;
    if (mode == Mode::kRaw || alpha == kOpaque) return opaque_state(pixel, white);
    if (mode == Mode::kScale || alpha == 0) return CellState::kUnknown;
    // map_server takes the mean with alpha. Free is what is so with it and without.
    const CellState states[] = {opaque_state(pixel, white),
                                opaque_state((3 * pixel + alpha) / 4, white)};
    if (std::ranges::count(states, CellState::kOccupied) > 0) return CellState::kOccupied;
    return states[0] == states[1] ? states[0] : CellState::kUnknown;
  }

 private:
  [[nodiscard]] CellState opaque_state(int pixel, int white) const {
    constexpr int kSavedUnknown = 205;
    if (mode == Mode::kTrinary && (negate ? white - pixel : pixel) == kSavedUnknown &&
        white == 255) {
      return CellState::kUnknown;
    }
    if (mode == Mode::kRaw && pixel > 100) return CellState::kUnknown;
    const double bright = static_cast<double>(pixel) / (mode == Mode::kRaw ? 100 : white);
    const double occupancy = mode == Mode::kRaw || negate ? bright : 1 - bright;
    if (occupancy > occupied_above) return CellState::kOccupied;
    return occupancy < free_below ? CellState::kFree : CellState::kUnknown;
  }
};

Reading read_reading(const YamlNode& root) {
  Reading reading;
  if (root.has("mode")) {
    const std::string mode = root.at("mode").text();
    const std::vector<std::string> known = {"trinary", "scale", "raw"};
    const auto found = std::ranges::find(known, mode);
    if (found == known.end()) {
      root.at("mode").fail("'" + mode + "' is not a mode" + suggestion(mode, known));
    }
    reading.mode = static_cast<Mode>(found - known.begin());
  }
  if (root.has("negate")) {
    const YamlNode negate = root.at("negate");
    const std::string says = negate.text();
    const bool is_word = says == "true" || says == "false";
    reading.negate = is_word ? negate.boolean() : negate.integer(0, 1) == 1;
  }
  reading.occupied_above = root.at("occupied_thresh").number(0, 1);
  reading.free_below = root.at("free_thresh").number(0, 1);
  if (reading.free_below > reading.occupied_above) {
    root.at("free_thresh").fail("must not be above occupied_thresh");
  }
  return reading;
}

/// A map's own metres; beyond, coordinates are a slip of the pen.
constexpr double kFarthestM = 1e7;

void read_place(const YamlNode& root, Grid& grid) {
  grid.unit = Unit::kMetres;
  grid.resolution = root.at("resolution").number(1e-4, 1e4);
  const auto origin = root.at("origin").items();
  if (origin.size() != 3) root.at("origin").fail("must be [x, y, yaw], in metres and radians");
  grid.origin = {origin[0].number(-kFarthestM, kFarthestM),
                 origin[1].number(-kFarthestM, kFarthestM)};
  grid.yaw_rad = origin[2].number(-2 * std::numbers::pi, 2 * std::numbers::pi);
}

/// Maps are copied from the machine that made them, whose folders they name.
fs::path picture_of(const fs::path& yaml, const YamlNode& image) {
  const std::string says = image.text();
  const fs::path file = yaml.parent_path() / says;
  std::error_code failed;
  if (fs::exists(file, failed)) return file;
  const auto name = says.substr(says.find_last_of("/\\") + 1);
  image.fail(fmt::format(
      "there is no picture '{}'; {}", file.string(),
      !name.empty() && fs::exists(yaml.parent_path() / name, failed)
          ? "one of that name lies beside this file: image: " + name
          : "name it as it is found from this file's folder, / between folders, without ~"));
}

}  // namespace

Grid read_ros_map(const fs::path& yaml) {
  const auto root = parse_yaml(yaml.string(), read_text(yaml));
  // Old map_savers wrote unknown_thresh, which nobody has read.
  root.check_keys({"image", "mode", "resolution", "origin", "negate", "occupied_thresh",
                   "free_thresh", "unknown_thresh"});
  Grid grid;
  read_place(root, grid);
  const Reading reading = read_reading(root);
  const auto picture = read_picture(picture_of(yaml, root.at("image")));
  grid.width = picture.grey.width;
  grid.height = picture.grey.height;
  grid.cells.reserve(picture.grey.pixels.size());
  for (std::size_t i = 0; i < picture.grey.pixels.size(); ++i) {
    const int alpha = picture.alpha.empty() ? 255 : picture.alpha[i];
    grid.cells.push_back(reading.state_of(picture.grey.pixels[i], picture.white, alpha));
  }
  return grid;
}

Grid read_map(const fs::path& file) {
  const auto extension = file.extension().string();
  if (extension == ".yaml" || extension == ".yml") return read_ros_map(file);
  if (extension == ".map") return read_movingai_map(file);
  throw_bad_input("cannot tell what '" + file.string() +
                  "' is; a map is the .yaml of ROS's map_server, or a .map of Moving AI");
}

}  // namespace pirt::planning
