// What completion offers where an option names something shipped, or something of a platform.
#pragma once

#include "cli/options/command.h"

namespace pirt::cli {

[[nodiscard]] Offer offer_workloads();
[[nodiscard]] Offer offer_variants();
[[nodiscard]] Offer offer_backends();
[[nodiscard]] Offer offer_platforms();
[[nodiscard]] Offer offer_mixes();
[[nodiscard]] Offer offer_modes();
/// The units of what --platform names, else of `host`.
/// @param suffix  What follows a unit in the value: "=" of its weight.
[[nodiscard]] Offer offer_units(std::string suffix = "");

}  // namespace pirt::cli
