// A sequence goes on without the pictures that cannot be read: a cable, a full disk, a card that
// was pulled out spoil one, not all.
#pragma once

#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

#include "workloads/inputs/pictures/images.h"
#include "workloads/inputs/sequence/sequence.h"

namespace pirt {

/// Any thread may call it.
class BadPictures {
 public:
  explicit BadPictures(const Sequence& sequence);

  void add(std::size_t frame, std::size_t camera, const std::string& problem);
  /// What the first camera showed.
  void look_at(std::size_t frame, const GreyImage& picture);
  /// So many may be.
  [[nodiscard]] std::size_t most() const;
  [[nodiscard]] bool are_too_many() const;
  /// Of the first few, and how many there are; and whether the camera hung: no two pictures of one
  /// that works are the same.
  [[nodiscard]] std::vector<std::string> warnings() const;

 private:
  std::size_t frames_, pictures_ = 0;  ///< Pictures: of all cameras.
  mutable std::mutex mutex_;
  std::map<std::pair<std::size_t, std::size_t>, std::string> problems_;  ///< By frame, camera.
  std::map<std::size_t, std::size_t> hashes_;                            ///< By frame.
};

/// From now on Sequence::image gives an empty picture in place of one that cannot be read.
/// @throws Error{kBadInput} if that is so of all of the first pictures of a camera, three or as
/// many as end a run: then none will be better.
[[nodiscard]] std::shared_ptr<const BadPictures> leave_out_bad_pictures(Sequence& sequence);

}  // namespace pirt
