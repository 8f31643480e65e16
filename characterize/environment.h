// What is known of the machine and the build when something is measured: the facts that figures are
// comparable by.
//
// A fact that cannot be known has no key, but a key "<fact>_unknown" with the reason: never an
// empty text or a made-up value.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <string_view>

namespace pirt {

using Environment = std::map<std::string, std::string>;

/// Whether two runs with different values can be compared: not if it is one of identity.
enum class FactKind : std::uint8_t { kIdentity, kInformation };
[[nodiscard]] std::string_view to_string(FactKind kind);

/// What a fact of that key is, known or "_unknown". Identity: the processor and the cores used,
/// devices and their drivers and libraries, inputs, the precision asked for, compiler, flags and
/// build type.
[[nodiscard]] FactKind fact_kind(std::string_view key);

/// cpu_model, cpu_flags (those that kernels are chosen by), cores_online, memory_mb, os, kernel,
/// governor, turbo, load_1m, steal_percent (since boot), temperature_c (hottest zone), hypervisor.
/// @param root  Where /proc, /sys and /etc are found; another folder in tests.
[[nodiscard]] Environment host_environment(const std::filesystem::path& root = "/");

/// pirt_version, compiler, compiler_flags, build_type, git_commit, git_dirty, sqlite_version.
[[nodiscard]] Environment build_environment();

}  // namespace pirt
