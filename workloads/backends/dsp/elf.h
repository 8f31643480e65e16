// Looking at a program before it is run.
#pragma once

#include <filesystem>

namespace pirt::dsp {

/// @throws Error{kEnvironment} saying what @p path is if it is not a program for Hexagon.
void check_hexagon_elf(const std::filesystem::path& path);

}  // namespace pirt::dsp
