// Pictures of a recording's messages.
#pragma once

#include <atomic>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "workloads/inputs/recording/messages.h"
#include "workloads/inputs/recording/recording.h"
#include "workloads/model/grey_image.h"

namespace pirt {

/// Why a message is no picture, though its type says so: depth, a mosaic, 16 bits; empty = it may
/// be one.
[[nodiscard]] std::string no_picture(const ImageMessage& message);

/// Positions of the topics of pictures' types that have messages which can be read.
[[nodiscard]] std::vector<std::size_t> picture_topics(const Recording& recording);
/// Why the first message of such a topic that is one is no picture, or, of compressed ones, none of
/// the first is; empty = it may be one.
[[nodiscard]] std::string no_pictures(const Recording& recording, std::size_t topic);

/// Position of the topic of that name, or, where that is empty, of the first with pictures, by
/// name.
/// @throws Error{kBadInput} if there is none.
[[nodiscard]] std::size_t picture_topic(const Recording& recording, const std::string& name);

/// Grey or B, G, R, 8 bits.
/// @param is_deep  As take_upper_bits.
/// @throws Error{kBadInput} for damage and for encodings that are not known.
[[nodiscard]] cv::Mat recorded_picture(const Recording& recording, std::size_t topic,
                                       std::size_t index, std::atomic<bool>* is_deep);

/// In grey.
/// @param is_deep  As take_upper_bits.
/// @throws Error{kBadInput} also unless it is @p width x @p height.
[[nodiscard]] GreyImage recorded_grey(const Recording& recording, std::size_t topic,
                                      std::size_t index, int width, int height,
                                      std::atomic<bool>* is_deep);

}  // namespace pirt
