// What the backend needs of this machine and of the installation.
#pragma once

#include <filesystem>
#include <string>

namespace pirt::dsp {

struct Tools {
  std::filesystem::path emulator, plugin, program;
  std::string missing;  ///< What of them is not there and how to get it; empty if all are.
};

/// qemu-hexagon from PATH, the others from where pirt is installed or was built.
[[nodiscard]] Tools find_tools();

/// @p path as qemu reads values of options: a comma stands twice.
[[nodiscard]] std::string quoted(const std::filesystem::path& path);

/// "qemu-hexagon 7.2.22"; asks the emulator, and waits a few seconds for its answer.
/// @throws Error{kEnvironment} if it does not run, takes no plugin, says something else, or does
///     not answer.
[[nodiscard]] std::string emulator_version(const Tools& tools);

/// The program's and the plugin's content: what counts change with besides the emulator.
[[nodiscard]] std::string program_hash(const Tools& tools);

}  // namespace pirt::dsp
