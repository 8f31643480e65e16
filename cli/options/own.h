// Workloads that are not pirt's: --workloads, and `pirt.workloads` beside a mix.
#pragma once

#include <filesystem>
#include <set>
#include <string>
#include <vector>

#include "characterize/platform/platform.h"
#include "characterize/profile/profile.h"
#include "cli/options/command.h"

namespace pirt::cli {

struct OwnFiles {
  std::vector<std::string> files;  ///< As they were given.

  /// Absolute, with `pirt.workloads` beside @p mix, if that is a file and there is one.
  /// @throws Error{kBadInput} if that is a stranger's and was not given.
  [[nodiscard]] std::vector<std::string> all(const std::string& mix = "") const;
};

/// --workloads
void add_workloads(Command& command, OwnFiles& own);

/// Makes known what the files have, as specs that compute nothing: a process of its own loads them,
/// but for those that something is known of.
/// @throws Error{kBadInput} naming the file.
void learn(const std::vector<std::string>& files);
/// Loads them into this process, which can compute them from then on.
/// @throws Error as own::load.
void load(const std::vector<std::string>& files);
/// The workloads that are known of the file.
/// @param digest  Of what it held when they were; empty = any.
[[nodiscard]] std::set<std::string> known_of(const std::string& file,
                                             const std::string& digest = "");
/// Warns of rows whose files are not what they were, which are doubted from then on. A file that
/// the profile has measured nothing of is learned, and, as long as @p mix names what is not known,
/// others, too, where they can be loaded here.
/// @param mix       As --mix; empty = there is none.
/// @param platform  That the mix is for, and may model workloads; null = there is none.
/// @throws Error{kBadInput} as learn, or if two files have one name.
void hold_against(Profile& profile, const std::vector<std::string>& files,
                  const std::string& mix = "", const Platform* platform = nullptr);

}  // namespace pirt::cli
