// Figures that pirt has not measured, as rows of a profile: what others have published
// (ros2_benchmark's JSON, RobotPerf's YAML, a table of ncnn's README as CSV), and what the user has
// measured elsewhere (times as CSV, JSON of Google Benchmark and of nvbench, StarPU's histories).
//
// A row is what a file states as the time of a call; nothing is derived. What a file does not say
// is absent.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "characterize/profile/store/writer.h"
#include "workloads/base/text/json.h"
#include "workloads/base/time.h"
#include "workloads/model/phase.h"

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
  std::vector<std::string> notes = {};
  std::vector<std::string> doubts = {};              ///< Words of judgement.h.
  std::optional<Nanos> p95 = {};                     ///< Of a call, at least as long as the figure.
  std::optional<double> energy_j = {};               ///< Of a call.
  std::optional<std::int64_t> memory_bytes = {};     ///< That a call needs.
  std::optional<std::int64_t> ops = {}, bytes = {};  ///< That it computes, and moves.
};

/// What is said of one board at one time.
struct PublishedBoard {
  std::string name;          ///< A platform's: "qualcomm-msm8996-snapdragon-820".
  std::string said;          ///< As the file has it.
  std::string edition = {};  ///< Which of several, where the file tells; else empty.
  std::vector<PublishedUnit> units = {};
  std::vector<PublishedFigure> figures = {};
  std::map<std::string, std::string> facts = {};   ///< What else it says: of the run's environment.
  Provenance provenance = Provenance::kPublished;  ///< Or measured, by the user.
};

struct Publication {
  std::string format;  ///< "ros2_benchmark", "RobotPerf", "ncnn", "times", "nvbench", ...
  std::vector<PublishedBoard> boards;      ///< Older ones first, where one board is in several.
  std::vector<std::string> left_out = {};  ///< What is no time of a call, and why, a line each.
};

/// @param file  Name for messages and facts, and of a board that the text does not name.
/// @throws Error{kBadInput} with the place of what cannot be read, or if it is none of the formats.
[[nodiscard]] Publication read_publication(const std::string& file, const std::string& text);

/// A run of its own, of the board's provenance. Rows that are measured are noted `measured
/// elsewhere`.
/// @param source  Where it comes from.
/// @return        The number of the run.
/// @throws Error as ProfileWriter.
std::int64_t write_published(ProfileWriter& writer, const PublishedBoard& board,
                             const std::string& source);

/// A platform file with the board's units, which states no watts: nobody has said them.
[[nodiscard]] std::string published_platform(const PublishedBoard& board,
                                             const std::string& source);
/// The same of a profile that write_published alone has made; absent for any other.
[[nodiscard]] std::optional<std::string> published_platform(const Profile& profile);

// Of the formats, each in its file. Those of JSON are @throws JsonError for what is none of them.
[[nodiscard]] Publication read_ncnn(const std::string& file, const std::string& text);
[[nodiscard]] Publication read_robotperf(const std::string& file, const std::string& text);
[[nodiscard]] Publication read_times(const std::string& file, const std::string& text);
[[nodiscard]] Publication read_starpu(const std::string& file, const std::string& text);
[[nodiscard]] Publication read_ros2_benchmark(const std::string& file, const Json& root);
[[nodiscard]] Publication read_google_benchmark(const std::string& file, const Json& root);
[[nodiscard]] Publication read_nvbench(const std::string& file, const Json& root);

/// "Qualcomm MSM8996 (Kryo)" as a name: "qualcomm-msm8996-kryo". @param gap  Between its words.
[[nodiscard]] std::string name_of(const std::string& said, char gap = '-');
/// "a/b.times.csv" as a board's name: "b-times".
[[nodiscard]] std::string board_of(const std::string& file);
/// PREFIX.NAME of what a file calls @p said.
/// @param known  By name: what the file calls so; added to.
/// @throws JsonError where it has no letter or digit, or something else has that name.
[[nodiscard]] std::string foreign_name(const std::string& prefix, const std::string& said,
                                       std::map<std::string, std::string>& known);
/// @return The time in a file of times in @p unit_ns ns. @throws JsonError where it is none.
[[nodiscard]] Nanos published_time(double value, double unit_ns, const std::string& what);
/// The board's unit of that name, added if it is new.
void add_unit(PublishedBoard& board, const PublishedUnit& unit);
/// The figure's samples and notes, to those that the board has of it already.
void add_figure(PublishedBoard& board, const PublishedFigure& figure);

}  // namespace pirt
