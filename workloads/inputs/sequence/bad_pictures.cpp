#include "workloads/inputs/sequence/bad_pictures.h"

#include <fmt/core.h>

#include <algorithm>
#include <functional>
#include <optional>
#include <string_view>

#include "workloads/base/error.h"

namespace pirt {

BadPictures::BadPictures(const Sequence& sequence) : frames_(sequence.frames.size()) {
  for (const Frame& frame : sequence.frames) {
    pictures_ += static_cast<std::size_t>(std::ranges::count(frame.present, true));
  }
}

void BadPictures::add(std::size_t frame, std::size_t camera, const std::string& problem) {
  const std::lock_guard lock(mutex_);
  problems_.try_emplace({frame, camera}, problem);
}

void BadPictures::look_at(std::size_t frame, const GreyImage& picture) {
  const auto* const bytes = reinterpret_cast<const char*>(picture.pixels.data());
  const auto hash = std::hash<std::string_view>()({bytes, picture.pixels.size()});
  const std::lock_guard lock(mutex_);
  hashes_[frame] = hash;
}

std::size_t BadPictures::most() const {
  return static_cast<std::size_t>(kMostBadPart * static_cast<double>(pictures_));
}

bool BadPictures::are_too_many() const {
  const std::lock_guard lock(mutex_);
  return problems_.size() > most();
}

std::vector<std::string> BadPictures::warnings() const {
  constexpr std::size_t kShown = 3;
  const std::lock_guard lock(mutex_);
  std::vector<std::string> warnings;
  for (const auto& [where, problem] : problems_) {
    if (warnings.size() == kShown) break;
    warnings.push_back(
        fmt::format("the picture of frame {} is left out: {}", where.first, problem));
  }
  if (problems_.size() > kShown) {
    warnings.push_back(
        fmt::format("{} pictures of {} frames are left out in all", problems_.size(), frames_));
  }
  std::size_t same = 0;
  for (auto it = hashes_.begin(); it != hashes_.end(); ++it) {
    const auto before = it->first == 0 ? hashes_.end() : hashes_.find(it->first - 1);
    same += before != hashes_.end() && before->second == it->second ? 1U : 0U;
  }
  if (static_cast<double>(same) > kMostBadPart * static_cast<double>(frames_)) {
    warnings.push_back(
        fmt::format("{} of {} pictures are the same, byte for byte, as the one before: has the "
                    "camera hung?",
                    same, hashes_.size()));
  }
  return warnings;
}

std::shared_ptr<const BadPictures> leave_out_bad_pictures(Sequence& sequence) {
  const auto bad = std::make_shared<BadPictures>(sequence);
  const std::size_t tried = std::max<std::size_t>(3, bad->most() + 1);
  for (std::size_t camera = 0; camera < sequence.cameras.size(); ++camera) {
    std::optional<Error> first;
    std::size_t looked_at = 0;
    std::size_t unusable = 0;
    for (std::size_t i = 0; i < sequence.frames.size() && looked_at < tried; ++i) {
      if (!sequence.frames[i].present[camera]) continue;
      ++looked_at;
      try {
        static_cast<void>(sequence.image(i, camera));
        break;
      } catch (const Error& error) {
        if (error.code() != ErrorCode::kBadInput) throw;
        if (!first) first = error;
        ++unusable;
      }
    }
    if (first && unusable == looked_at) throw Error(*first);
  }
  sequence.image = [read = sequence.image, bad](std::size_t frame, std::size_t camera) {
    try {
      GreyImage picture = read(frame, camera);
      if (camera == 0) bad->look_at(frame, picture);
      return picture;
    } catch (const Error& error) {
      if (error.code() != ErrorCode::kBadInput) throw;
      bad->add(frame, camera, error.what());
      return GreyImage{};
    }
  };
  return bad;
}

}  // namespace pirt
