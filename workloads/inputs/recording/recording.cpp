#include "workloads/inputs/recording/recording.h"

#include <fmt/core.h>

#include <algorithm>
#include <optional>

#include "workloads/base/error.h"
#include "workloads/base/system/temporary.h"
#include "workloads/base/text/printable.h"
#include "workloads/base/text/text.h"
#include "workloads/base/text/yaml.h"
#include "workloads/inputs/recording/compression.h"

namespace pirt {
namespace {

namespace fs = std::filesystem;

/// "db3" of "flight.DB3": some file systems have capitals alone. A recorder that was killed leaves
/// ".active" behind the name.
std::string kind_of(const fs::path& file) {
  std::string name = file.filename().string();
  std::ranges::transform(name, name.begin(),
                         [](char c) { return c >= 'A' && c <= 'Z' ? char(c - 'A' + 'a') : c; });
  if (name.starts_with('.')) return "";
  constexpr std::string_view kActive = ".active";
  if (name.ends_with(kActive)) name.resize(name.size() - kActive.size());
  for (const char* known : {"bag", "db3", "mcap", "db3.zstd", "mcap.zstd", "db3.zst", "mcap.zst"}) {
    if (name.ends_with(std::string(".") + known)) return known;
  }
  return "";
}

bool ends_as_recording(const fs::path& file) { return !kind_of(file).empty(); }

std::vector<fs::path> recordings_in(const fs::path& folder) {
  std::vector<fs::path> found;
  std::error_code failed;
  for (const auto& entry : fs::directory_iterator(folder, failed)) {
    if (ends_as_recording(entry.path())) found.push_back(entry.path());
  }
  std::ranges::sort(found);
  return found;
}

constexpr const char* kMetadataKey = "rosbag2_bagfile_information";

/// Those that metadata.yaml names, in its order. Old ones name the folder, too.
std::vector<fs::path> parts_of(const fs::path& folder) {
  const fs::path metadata = folder / "metadata.yaml";
  std::vector<fs::path> parts;
  std::error_code failed;
  if (!fs::exists(metadata, failed)) return parts;
  const std::string text = read_text(metadata);
  // What a computer leaves that lost its power is as none.
  if (text.find_first_not_of('\0') == std::string::npos) return parts;
  const auto root = parse_yaml(metadata.string(), text).at(kMetadataKey);
  if (!root.has("relative_file_paths")) return parts;
  for (const auto& item : root.at("relative_file_paths").items()) {
    const fs::path named = folder / fs::path(item.text()).filename();
    // Somebody may have packed or unpacked it since.
    const fs::path others[] = {named, named.string() + ".zstd", named.string() + ".zst",
                               named.extension() == ".zstd" ? folder / named.stem() : named};
    const auto* const found = std::ranges::find_if(
        others, [&failed](const fs::path& each) { return fs::is_regular_file(each, failed); });
    if (found == std::end(others)) {
      item.fail("the part '" + named.string() + "' is missing, or no file; copy the whole folder");
    }
    parts.push_back(*found);
  }
  return parts;
}

[[nodiscard]] std::unique_ptr<Recording> open_file(const fs::path& file, const Opening& as) {
  const std::string kind = kind_of(file);
  if (kind == "bag") return open_bag(file, as);
  if (kind == "db3") return open_db3(file, as);
  if (kind == "mcap") return open_mcap(file, kCheckedBytes, as);
  if (kind.empty()) {
    throw_bad_input("'" + file.string() +
                    "' is no recording that is known: .bag of ROS 1, .db3 and .mcap of ROS 2, the "
                    "last two also with .zstd behind");
  }
  // Packed as a whole, and unpacked for as long as it is read.
  auto folder = recording_folder();
  const fs::path plain = folder->path() / file.filename().stem();
  unpack_file(file, plain);
  auto content = open_file(plain, {file.string(), as.unpacked});
  content->own(std::move(folder));
  return content;
}

/// The parts of one recording, as one.
class Joined final : public Recording {
 public:
  Joined(const fs::path& folder, const std::vector<fs::path>& parts) : Recording(folder.string()) {
    const Opening as;  // what is unpacked is kept of all of them together
    for (const fs::path& part : parts) {
      const std::uint64_t number = parts_.size();
      parts_.push_back(open_file(part, as));
      const auto& topics = parts_.back()->topics();
      for (std::size_t i = 0; i < topics.size(); ++i) {
        auto& places = topics_[add({.name = topics[i].name,
                                    .type = topics[i].type,
                                    .encoding = topics[i].encoding,
                                    .has_seq = topics[i].has_seq})]
                           .places;
        for (std::size_t k = 0; k < topics[i].places.size(); ++k) {
          places.push_back({topics[i].places[k].time, number << 32 | k, i});
        }
      }
      std::ranges::copy(parts_.back()->warnings(), std::back_inserter(warnings_));
      attachments_ += parts_.back()->attachments();
      metadata_ += parts_.back()->metadata();
    }
    finish();
  }

 private:
  [[nodiscard]] std::string load(const Topic::Place& place, std::uint64_t most) const override {
    constexpr std::uint64_t kMessage = 0xffffffff;
    return parts_[place.at >> 32]->message(place.part, place.at & kMessage, most);
  }

  std::vector<std::unique_ptr<Recording>> parts_;
};

}  // namespace

std::string ros1_type(const std::string& type) {
  const auto at = type.find("/msg/");
  return at == std::string::npos ? type : type.substr(0, at) + type.substr(at + 4);
}

std::string ros2_type(std::string_view type) {
  const auto slash = type.find('/');
  return std::string(type.substr(0, slash)) + "/msg" + std::string(type.substr(slash));
}

bool defines_seq(std::string_view definition, bool otherwise) {
  const auto begin = definition.find("MSG: std_msgs/Header");
  if (begin == std::string_view::npos) return otherwise;
  const auto header = definition.substr(begin, definition.find("\n===", begin) - begin);
  return header.find("uint32 seq") != std::string_view::npos;
}

std::string Topic::describe() const {
  return fmt::format("{} ({}, {}{})", printable(name), printable(type), messages,
                     is_readable() ? "" : ", encoded as '" + printable(encoding) + "'");
}

std::string Recording::describe() const {
  std::vector<std::string> known;
  for (const Topic& each : topics_) known.push_back(each.describe());
  return known.empty() ? "no topics" : join(known, ", ");
}

std::size_t Recording::topic(const std::string& name,
                             const std::vector<std::string_view>& types) const {
  std::optional<std::size_t> found;
  for (std::size_t i = 0; i < topics_.size(); ++i) {
    if (topics_[i].name != name) continue;
    const bool fits = std::ranges::find(types, topics_[i].type) != types.end();
    if (!found || fits) found = i;
    if (fits) break;
  }
  if (found) return *found;
  std::vector<std::string> names;
  for (const Topic& each : topics_) names.push_back(each.name);
  fail("has no topic '" + name + "'" + suggestion(name, names) + "; it has " + describe());
}

std::vector<std::size_t> Recording::of_type(std::string_view type) const {
  std::vector<std::size_t> found;
  for (std::size_t i = 0; i < topics_.size(); ++i) {
    const Topic& topic = topics_[i];
    // Of one name with two types the one that has more messages that can be read is meant.
    const bool is_other = std::ranges::any_of(topics_, [&](const Topic& other) {
      return other.is_readable() && other.name == topic.name && other.messages > topic.messages;
    });
    if (topic.type == type && topic.messages > 0 && topic.is_readable() && !is_other) {
      found.push_back(i);
    }
  }
  return found;
}

std::string Recording::message(std::size_t topic, std::size_t index, std::uint64_t most) const {
  const Topic& of = topics_[topic];
  std::string bytes = load(of.places[index], most);
  if (of.encoding != "cdr" || !is_packed(bytes)) return bytes;
  if (most < kWhole) bytes = load(of.places[index], kWhole);
  return unpack_message(std::move(bytes), file_).substr(0, most);
}

WireReader Recording::reader(std::size_t topic, std::size_t index, std::string_view bytes) const {
  const Topic& of = topics_[topic];
  return {bytes, of.encoding == "ros1" ? WireFormat::kRos1 : WireFormat::kCdr,
          fmt::format("'{}': message {} of {}", file_, index + 1, of.name), of.has_seq};
}

void Recording::walk(const std::vector<Wanted>& topics, const Take& take) const {
  struct Next {
    Wanted of;
    std::size_t index = 0;
  };
  std::vector<Next> next;
  for (const Wanted& each : topics) {
    if (topics_[each.topic].messages > 0) next.push_back({each});
  }
  while (!next.empty()) {
    const auto first = std::ranges::min_element(
        next, {}, [this](const Next& each) { return time(each.of.topic, each.index); });
    const Wanted of = first->of;
    take(of.topic, first->index, [&] { return message(of.topic, first->index, of.most); });
    if (++first->index == topics_[of.topic].messages) next.erase(first);
  }
}

std::size_t Recording::add(Topic topic) {
  for (std::size_t i = 0; i < topics_.size(); ++i) {
    if (topics_[i].name == topic.name && topics_[i].type == topic.type &&
        topics_[i].encoding == topic.encoding) {
      return i;
    }
  }
  topics_.push_back(std::move(topic));
  return topics_.size() - 1;
}

void Recording::finish() {
  keep_longest_run();
  for (Topic& topic : topics_) {
    if (!std::ranges::is_sorted(topic.places, {}, &Topic::Place::time)) {
      std::ranges::stable_sort(topic.places, {}, &Topic::Place::time);
    }
    topic.messages = topic.places.size();
  }
  std::ranges::stable_sort(topics_, {}, &Topic::name);
  for (std::size_t i = 1; i < topics_.size(); ++i) {
    if (topics_[i].name != topics_[i - 1].name) continue;
    warnings_.push_back(
        fmt::format("'{}' has two topics of one name, {} and {}: of those that can be read the one "
                    "with more messages is used",
                    file_, topics_[i - 1].describe(), topics_[i].describe()));
  }
}

void Recording::fail(const std::string& problem) const {
  throw_bad_input("'" + file_ + "' " + problem);
}

std::unique_ptr<TemporaryFolder> recording_folder() {
  const fs::path target = fs::temp_directory_path() / "pirt-recording";
  remove_left_beside(target);
  return std::make_unique<TemporaryFolder>(target);
}

bool names_a_recording(const fs::path& path) {
  std::error_code failed;
  if (!fs::is_directory(path, failed)) return ends_as_recording(path);
  if (!recordings_in(path).empty()) return true;
  const fs::path metadata = path / "metadata.yaml";
  return fs::is_regular_file(metadata, failed) &&
         read_text(metadata).find(kMetadataKey) != std::string::npos;
}

std::unique_ptr<Recording> open_recording(const fs::path& path) {
  std::error_code failed;
  if (fs::is_directory(path, failed)) {
    auto parts = parts_of(path);
    if (parts.empty()) {
      parts = recordings_in(path);
      if (parts.size() != 1) {
        throw_bad_input(fmt::format(
            "'{}' has {} recordings and no metadata.yaml that says that they are one; give one of "
            "them",
            path.string(), parts.size()));
      }
    }
    std::unique_ptr<Recording> recording;
    if (parts.size() == 1) {
      recording = open_recording(parts.front());
    } else {
      recording = std::make_unique<Joined>(path, parts);
    }
    for (const fs::path& each : recordings_in(path)) {
      if (std::ranges::find(parts, each) != parts.end()) continue;
      recording->warn("'" + each.string() + "' is not read: metadata.yaml does not name it");
    }
    return recording;
  }
  if (!fs::exists(path, failed)) throw_bad_input("there is no recording '" + path.string() + "'");
  return open_file(path, {});
}

}  // namespace pirt
