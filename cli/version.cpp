#include "cli/version.h"

#include <fmt/core.h>

#include <vector>

#include "characterize/machine/build_info.h"
#include "characterize/machine/environment.h"
#include "workloads/backends/missing_backend.h"
#include "workloads/backends/registry.h"
#include "workloads/base/text/text.h"

namespace pirt::cli {

std::string version_text() {
  const BuildInfo build = build_info();
  std::vector<std::string> built, missing;
  for (const auto& backend : backends()) {
    (is_missing(*backend) ? missing : built).emplace_back(backend->name());
  }
  const std::string commit =
      build.git_commit.empty()
          ? "unknown (not built from a git checkout)"
          : std::string(build.git_commit) + (build.git_dirty ? ", with changes" : "");
  auto text = fmt::format(
      "pirt {}\ncommit: {}\ncompiler: {}, {}{}\nbackends: {}", build.version, commit,
      build_environment().at("compiler"), build.build_type,
      build.sanitizers.empty() ? "" : fmt::format(" with sanitizers {}", build.sanitizers),
      join(built, ", "));
  if (!missing.empty()) text += "; without " + join(missing, ", ");
  return text;
}

}  // namespace pirt::cli
