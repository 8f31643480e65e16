// The clock by which messages were recorded: where it begins anew, and where it was only set back.
#include <fmt/core.h>

#include <algorithm>
#include <cstdint>
#include <optional>
#include <utility>

#include "workloads/base/error.h"
#include "workloads/base/text/printable.h"
#include "workloads/inputs/recording/messages.h"
#include "workloads/inputs/recording/recording.h"
#include "workloads/inputs/recording/restarts.h"

namespace pirt {
namespace {

/// How a message lies in the file.
auto lies_at(const Topic::Place& place) { return std::pair(place.at, place.part); }

/// Two messages of one topic, between which the clock falls.
struct Fall {
  Topic::Place last, next;

  /// What lies between the two is of the side whose time is nearer.
  [[nodiscard]] bool is_before(const Topic::Place& place) const {
    if (lies_at(place) <= lies_at(last)) return true;
    return lies_at(place) < lies_at(next) && place.time - next.time > last.time - place.time;
  }
};

/// Of a message; none where it has none, or cannot be read.
std::optional<Nanos> stamp_of(const Recording& recording, std::size_t topic, std::size_t i) {
  constexpr std::uint64_t kHead = 4096;
  try {
    const std::string bytes = recording.message(topic, i, kHead);
    auto in = recording.reader(topic, i, bytes);
    const Nanos stamp = read_head(in).time;
    if (stamp > Nanos::zero()) return stamp;
  } catch (const Error& error) {
    if (error.code() != ErrorCode::kBadInput) throw;
  }
  return std::nullopt;
}

/// What sensors' stamps do across a fall: nothing is known where no sensor has messages on both
/// sides; where those of one go on, it is the recorder's clock alone.
enum class Stamps : std::uint8_t { kUnknown, kGoOn, kBeginAnew };

Stamps stamps_across(const Recording& recording, const Fall& fall) {
  Stamps stamps = Stamps::kUnknown;
  for (std::size_t t = 0; t < recording.topics().size(); ++t) {
    const Topic& topic = recording.topics()[t];
    const bool is_sensor = topic.type == ImageMessage::kType ||
                           topic.type == ImageMessage::kCompressedType ||
                           topic.type == ImuMessage::kType;
    if (!is_sensor || !topic.is_readable()) continue;
    std::optional<std::size_t> last, next;  // of this topic
    for (std::size_t i = 0; i < topic.places.size(); ++i) {
      const Topic::Place& place = topic.places[i];
      const bool is_before = fall.is_before(place);
      auto& nearest = is_before ? last : next;
      const bool is_behind = nearest && lies_at(topic.places[*nearest]) < lies_at(place);
      if (!nearest || is_behind == is_before) nearest = i;
    }
    if (!last || !next) continue;
    stamps = Stamps::kBeginAnew;
    const auto before = stamp_of(recording, t, *last), behind = stamp_of(recording, t, *next);
    if (before && behind && *behind > *before) return Stamps::kGoOn;
  }
  return stamps;
}

}  // namespace

/// By the topic with the most messages.
void Recording::keep_longest_run() {
  using Place = Topic::Place;
  const auto clock =
      std::ranges::max_element(topics_, {}, [](const Topic& topic) { return topic.places.size(); });
  if (clock == topics_.end()) return;
  // rosbag has the index of a chunk in order of time.
  if (!std::ranges::is_sorted(clock->places, {}, lies_at)) {
    std::ranges::sort(clock->places, {}, lies_at);
  }
  if (std::ranges::is_sorted(clock->places, {}, &Place::time)) return;
  std::vector<Nanos> stamps;
  for (const Place& place : clock->places) stamps.push_back(place.time);
  const auto fall = [&](std::size_t i) { return Fall{clock->places[i - 1], clock->places[i]}; };
  constexpr std::size_t kMostSet = 16;                         // each costs a pass
  constexpr Nanos kLeastSet = std::chrono::milliseconds(100);  // ntpd sets one that is off by 128
  auto falls = restarts_of(stamps, kLeastSet);
  if (falls.size() > kMostSet) falls = restarts_of(stamps);
  // Of two parts that were put together in the wrong order the file's first message was recorded
  // right after its last one.
  const Nanos rest = clock->places.front().time - clock->places.back().time;
  const bool is_swapped = falls.size() == 1 && rest >= Nanos::zero() && rest <= kLeastRestart;
  std::vector<std::size_t> restarts;
  for (const std::size_t i : falls) {
    const Fall here = fall(i);
    const auto across = falls.size() > kMostSet ? Stamps::kBeginAnew : stamps_across(*this, here);
    if (across != Stamps::kGoOn) {
      const bool is_long = here.last.time - here.next.time > kLeastRestart;
      if (across == Stamps::kBeginAnew && is_long && !is_swapped) restarts.push_back(i);
      continue;
    }
    const Nanos usual = here.last.time - clock->places[i - 2].time;
    const Nanos later = here.last.time - here.next.time + usual;
    for (Topic& topic : topics_) {
      for (Place& place : topic.places) {
        if (!here.is_before(place)) place.time = std::min(place.time, Nanos::max() - later) + later;
      }
    }
    was_set_back_ = true;
    warnings_.push_back(fmt::format(
        "'{}': the clock that it was recorded by was set back by {:.2f} s after {} messages of {}; "
        "stamps go on, and all is read",
        file_, to_s(later), i, printable(clock->name)));
  }
  if (restarts.empty()) return;
  const auto [begin, end] = longest_run(restarts, stamps);
  const bool is_first = begin == 0;
  const bool is_last = end == stamps.size();
  const Fall before = is_first ? Fall{} : fall(begin);
  const Fall after = is_last ? Fall{} : fall(end);
  std::size_t left_out = 0;
  for (Topic& topic : topics_) {
    if (topic.name.ends_with("tf_static")) continue;  // it is said once, and has no time
    left_out += std::erase_if(topic.places, [&](const Place& place) {
      return (!is_first && before.is_before(place)) || (!is_last && !after.is_before(place));
    });
  }
  warnings_.push_back(fmt::format(
      "'{}': the clock that it was recorded by begins anew, as that of a simulator that was "
      "restarted: the longest of {} runs is read, and {} messages of the others are left out",
      file_, restarts.size() + 1, left_out));
}

}  // namespace pirt
