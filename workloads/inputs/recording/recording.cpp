#include "workloads/inputs/recording/recording.h"

#include <fmt/core.h>

#include <algorithm>

#include "workloads/base/error.h"
#include "workloads/base/text/text.h"

namespace pirt {
namespace {

namespace fs = std::filesystem;

std::vector<fs::path> databases_in(const fs::path& folder) {
  std::vector<fs::path> found;
  std::error_code failed;
  for (const auto& entry : fs::directory_iterator(folder, failed)) {
    if (entry.path().extension() == ".db3") found.push_back(entry.path());
  }
  std::ranges::sort(found);
  return found;
}

}  // namespace

std::size_t Recording::topic(const std::string& name) const {
  const auto found = std::ranges::find(topics_, name, &Topic::name);
  if (found != topics_.end()) return static_cast<std::size_t>(found - topics_.begin());
  std::vector<std::string> names, known;
  for (const Topic& each : topics_) {
    names.push_back(each.name);
    known.push_back(fmt::format("{} ({}, {})", each.name, each.type, each.messages));
  }
  fail("has no topic '" + name + "'" + suggestion(name, names) + "; it has " +
       (known.empty() ? "none" : join(known, ", ")));
}

std::vector<std::size_t> Recording::of_type(std::string_view type) const {
  std::vector<std::size_t> found;
  for (std::size_t i = 0; i < topics_.size(); ++i) {
    if (topics_[i].type == type && topics_[i].messages > 0) found.push_back(i);
  }
  return found;
}

WireReader Recording::reader(std::size_t topic, std::size_t index, std::string_view bytes) const {
  return {bytes, format(),
          fmt::format("'{}': message {} of {}", file_, index + 1, topics_[topic].name)};
}

void Recording::fail(const std::string& problem) const {
  throw_bad_input("'" + file_ + "' " + problem);
}

bool names_a_recording(const fs::path& path) {
  std::error_code failed;
  if (fs::is_directory(path, failed)) return !databases_in(path).empty();
  return path.extension() == ".bag" || path.extension() == ".db3" || path.extension() == ".mcap" ||
         path.string().ends_with(".db3.zstd");
}

std::unique_ptr<Recording> open_recording(const fs::path& path) {
  if (fs::is_directory(path)) {
    const auto found = databases_in(path);
    if (found.size() == 1) return open_db3(found.front());
    throw_bad_input(fmt::format("'{}' has {} files that end in .db3; give one of them",
                                path.string(), found.size()));
  }
  std::error_code failed;
  if (!fs::exists(path, failed)) throw_bad_input("there is no recording '" + path.string() + "'");
  if (path.extension() == ".bag") return open_bag(path);
  if (path.extension() == ".db3") return open_db3(path);
  throw_bad_input("'" + path.string() +
                  "' is no recording that is known: .bag of ROS 1, .db3 of ROS 2 (`ros2 bag "
                  "convert` makes the second of .mcap and of what is compressed with zstd)");
}

}  // namespace pirt
