// Figures that others have published, as rows of a profile: ros2_benchmark's JSON, RobotPerf's
// YAML, a table of ncnn's README as CSV.
//
// A row is what a file states as the time of a call; nothing is derived. What a file does not say
// is absent.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "characterize/profile/store/writer.h"
#include "workloads/base/time.h"

namespace pirt {

/// A unit of a board as far as the file names it.
struct PublishedUnit {
  std::string name;  ///< "cpu", "gpu", or "board" where the file does not say what computes.
  std::string device;
  bool is_cpu = false;
};

/// The time of a call on a unit.
struct PublishedFigure {
  std::string workload;  ///< A foreign name: "ncnn.alexnet".
  std::string unit;
  std::vector<Nanos> samples;  ///< Each figure that the file states, at least one.
  std::vector<std::string> notes;
};

/// What is said of one board at one time.
struct PublishedBoard {
  std::string name;          ///< A platform's: "qualcomm-msm8996-snapdragon-820".
  std::string said;          ///< As the file has it.
  std::string edition = {};  ///< Which of several, where the file tells; else empty.
  std::vector<PublishedUnit> units;
  std::vector<PublishedFigure> figures;
  std::map<std::string, std::string> facts;  ///< What else it says: of the run's environment.
};

struct Publication {
  std::string format;                  ///< "ros2_benchmark", "RobotPerf", "ncnn".
  std::vector<PublishedBoard> boards;  ///< Older ones first, where one board is in several.
  std::vector<std::string> left_out;   ///< What is no time of a call, and why, a line each.
};

/// @param file  Name for messages and facts.
/// @throws Error{kBadInput} with the place of what cannot be read, or if it is none of the formats.
[[nodiscard]] Publication read_publication(const std::string& file, const std::string& text);

/// A run of its own, of provenance `published`.
/// @param source  Where it comes from.
/// @return        The number of the run.
/// @throws Error as ProfileWriter.
std::int64_t write_published(ProfileWriter& writer, const PublishedBoard& board,
                             const std::string& source);

/// A platform file with the board's units, which states no watts: nobody has published them.
[[nodiscard]] std::string published_platform(const PublishedBoard& board,
                                             const std::string& source);

// Of the formats, each in its file.
[[nodiscard]] Publication read_ncnn(const std::string& file, const std::string& text);
[[nodiscard]] Publication read_robotperf(const std::string& file, const std::string& text);
[[nodiscard]] Publication read_ros2_benchmark(const std::string& file, const std::string& text);

/// "Qualcomm MSM8996 (Kryo)" as a name: "qualcomm-msm8996-kryo". @param gap  Between its words.
[[nodiscard]] std::string name_of(const std::string& said, char gap = '-');
/// The board's unit of that name, added if it is new.
void add_unit(PublishedBoard& board, const PublishedUnit& unit);
/// The figure's samples and notes, to those that the board has of it already.
void add_figure(PublishedBoard& board, const PublishedFigure& figure);

}  // namespace pirt
