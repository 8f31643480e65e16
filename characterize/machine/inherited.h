// What decides how fast this process computes and is nobody's own: what it has from who started it,
// and how the machine is set to save power.
#pragma once

#include <filesystem>
#include <string>

#include "characterize/machine/environment.h"

namespace pirt {

/// "env.<NAME>" of each variable of the environment that libraries and drivers obey, and
/// "scheduling" where that is not the usual. Nothing else is in it: what is not set has no key.
/// @param variables  "NAME=value", ended by null.
[[nodiscard]] Environment inherited_environment(const char* const* variables);
[[nodiscard]] Environment inherited_environment();  ///< Of this process.

/// "power_mode.<device>.<setting>" of each that there is: power modes of boards and firmware,
/// limits of graphics cards, memory controllers and packages.
[[nodiscard]] Environment power_modes(const std::filesystem::path& root);

/// Why no code can be made here while a program runs, with the remedy; empty if it can. Drivers
/// compile kernels into files in @p folder, libraries into memory.
[[nodiscard]] std::string no_new_code(const std::filesystem::path& folder);

}  // namespace pirt
