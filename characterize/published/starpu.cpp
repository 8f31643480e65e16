// A codelet's history that StarPU keeps, CODELET.HOST: the mean time on each worker, by the bytes
// of its data. Source of the format: starpu 1.2 and later, src/core/perfmodel/perfmodel_history.c,
// version 45.
#include <fmt/core.h>

#include <array>
#include <filesystem>
#include <map>
#include <set>
#include <utility>

#include "characterize/published/published.h"
#include "workloads/base/error.h"
#include "workloads/base/text/numbers.h"
#include "workloads/base/text/text.h"

namespace pirt {
namespace {

constexpr int kVersion = 45;
/// Below, StarPU itself calls a model not calibrated.
constexpr std::int64_t kCalibrated = 10;
constexpr int kMostEntries = 4096;  ///< Devices, implementations, entries; more is no such file.

/// The lines that are not comments, a list of words each.
class HistoryLines {
 public:
  HistoryLines(const std::string& file, const std::string& text) : file_(file) {
    for (auto& line : split(text, '\n')) lines_.push_back(std::move(line));
  }

  /// The words of the next line. @param least  So many at least.
  std::vector<std::string> next(std::size_t least, const char* what) {
    while (at_ < lines_.size()) {
      const std::string& line = lines_[at_++];
      if (line.starts_with('#')) continue;
      const auto words = words_in(line);
      if (words.empty()) continue;
      if (words.size() < least) fail(fmt::format("{} words of {}, got '{}'", least, what, line));
      return words;
    }
    fail(std::string("the file ends before ") + what);
  }
  int number(const char* what, int low, int high) {
    return whole_number(next(1, what).front(), low, high).or_refuse(place() + ": " + what);
  }
  [[noreturn]] void fail(const std::string& problem) const {
    throw_bad_input(place() + ": a history of StarPU has here: " + problem);
  }
  [[nodiscard]] std::string place() const { return fmt::format("{}:{}", file_, at_); }

 private:
  const std::string& file_;
  std::vector<std::string> lines_;
  std::size_t at_ = 0;
};

struct HistoryEntry {
  std::string unit, hash;
  std::int64_t size_bytes = 0;
  std::optional<std::int64_t> flops;
  Nanos mean{0};
  std::int64_t calls = 0;
};

struct History {
  std::vector<HistoryEntry> entries;
  std::vector<std::string> left_out;
};

HistoryEntry read_entry(HistoryLines& lines, const std::string& unit) {
  const auto words = lines.next(8, "an entry: hash size flops mean dev sum sum2 n");
  const std::string where = lines.place() + ": ";
  HistoryEntry entry;
  entry.unit = unit;
  entry.hash = words[0];
  entry.size_bytes =
      whole_number(words[1], std::int64_t{0}, std::int64_t{1} << 50).or_refuse(where + "size");
  if (const auto flops = decimal_number(words[2], 1, 1e18).value) {
    entry.flops = static_cast<std::int64_t>(*flops);
  }
  const double mean_us =
      decimal_number(words[3], kNanosecondMs * 1e3, kLongestMs * 1e3).or_refuse(where + "mean");
  entry.mean = from_ms(mean_us / 1e3);
  entry.calls =
      whole_number(words[7], std::int64_t{1}, std::int64_t{1} << 50).or_refuse(where + "n");
  return entry;
}

/// One combination of devices.
void read_combination(HistoryLines& lines, History& history) {
  static constexpr std::array kTypes = {"cpu", "cuda", "opencl", "mic", "mpi", "mpi"};
  const int devices = lines.number("number of devices", 1, kMostEntries);
  std::string unit, why_not;
  for (int i = 0; i < devices; ++i) {
    const int type = lines.number("device type", 0, static_cast<int>(kTypes.size()) - 1);
    const int id = lines.number("device id", 0, kMostEntries);
    const int cores = lines.number("number of cores", 0, kMostEntries);
    // All cores are alike to StarPU.
    unit = kTypes[static_cast<std::size_t>(type)] + (type == 0 ? "" : std::to_string(id));
    if (cores > 1) why_not = fmt::format("{} cores at once", cores);
  }
  if (devices > 1) why_not = fmt::format("{} devices at once", devices);
  const int implementations = lines.number("number of implementations", 1, kMostEntries);
  for (int i = 0; i < implementations; ++i) {
    const int entries = lines.number("number of entries", 0, kMostEntries);
    static_cast<void>(lines.next(9, "a regression"));
    static_cast<void>(lines.next(3, "a non-linear regression"));
    static_cast<void>(lines.next(1, "a multiple regression"));
    const std::string why = i > 0 ? "implementations but the first" : why_not;
    for (int k = 0; k < entries; ++k) {
      HistoryEntry entry = read_entry(lines, unit);
      if (why.empty()) history.entries.push_back(std::move(entry));
    }
    if (!why.empty() && entries > 0) history.left_out.push_back(unit + ": times of " + why);
  }
}

History read_history(const std::string& file, const std::string& text) {
  HistoryLines lines(file, text);
  const int version = lines.number("version", 0, 1'000'000);
  if (version != kVersion) {
    throw_bad_input(fmt::format("{}: a history of version {}; pirt reads version {}", lines.place(),
                                version, kVersion));
  }
  History history;
  const int combinations = lines.number("number of combinations", 0, kMostEntries);
  for (int i = 0; i < combinations; ++i) read_combination(lines, history);
  return history;
}

}  // namespace

Publication read_starpu(const std::string& file, const std::string& text) {
  History history = read_history(file, text);
  const std::filesystem::path name = std::filesystem::path(file).filename();
  const std::string host = name.has_extension() ? name.extension().string().substr(1) : "";
  const std::string codelet = name_of(name.stem().string(), '_');
  PublishedBoard board{.name = name_of(host).empty() ? board_of(file) : name_of(host),
                       .said = host.empty() ? file : host,
                       .provenance = Provenance::kMeasured};
  std::map<std::int64_t, std::set<std::string>> hashes;
  for (const HistoryEntry& entry : history.entries) hashes[entry.size_bytes].insert(entry.hash);
  for (const HistoryEntry& entry : history.entries) {
    add_unit(board, {.name = entry.unit, .device = entry.unit, .is_cpu = entry.unit == "cpu"});
    PublishedFigure figure{
        .workload = fmt::format("starpu.{}_{}", codelet, entry.size_bytes) +
                    (hashes[entry.size_bytes].size() > 1 ? "_" + entry.hash : ""),
        .unit = entry.unit,
        .samples = {entry.mean},
        .notes = {fmt::format("mean of {} calls, without transfers", entry.calls)}};
    if (entry.calls < kCalibrated) figure.doubts.emplace_back("few_samples");
    figure.ops = entry.flops;
    figure.bytes = entry.size_bytes;
    add_figure(board, figure);
  }
  return {
      .format = "StarPU", .boards = {std::move(board)}, .left_out = std::move(history.left_out)};
}

}  // namespace pirt
