// pirt diff: the figures of two profiles side by side.
#include <fmt/core.h>

#include <filesystem>
#include <memory>

#include "characterize/profile/store/reader.h"
#include "cli/commands.h"
#include "cli/options/files.h"
#include "cli/options/output.h"
#include "cli/options/shipped.h"
#include "cli/options/values.h"
#include "reports/export/profile_export.h"
#include "reports/profile/profile_diff.h"
#include "workloads/base/error.h"
#include "workloads/base/text/json.h"

namespace pirt::cli {
namespace {

struct DiffFlags {
  std::vector<std::string> files;
  std::string filter;
  std::string platform;
  Output json;
};

Profile open_profile(const DiffFlags& options, const std::string& path) {
  auto profile = load_profile(path, options.platform);
  if (!options.filter.empty()) keep_workloads(profile, options.filter);
  return profile;
}

int diff(const DiffFlags& options) {
  if (options.files.size() != 2) {
    throw_bad_input(
        fmt::format("pirt diff takes two profile databases, not {}; see 'pirt diff --help'",
                    options.files.size()));
  }
  refuse_same_file(options.files[0], options.files[1],
                   ", and it shows the newest row of each cell; give two files");
  const auto a = open_profile(options, options.files[0]);
  const auto b = open_profile(options, options.files[1]);
  const auto result = diff_profiles(a, b);
  auto json = diff_json(result);
  json["schema_version"] = 1;
  emit(render(diff_document(result), Format::kText), json, options.json);
  if (!result.identity.empty()) {
    warn("identity differs (" + result.identity.front().fact +
         (result.identity.size() > 1 ? ", ..." : "") + "): the ratios compare different things");
  }
  return 0;
}

}  // namespace

void add_diff(CLI::App& app, Action& action) {
  auto options = std::make_shared<DiffFlags>();
  Command command(app, "diff",
                  "Show the figures of two profiles side by side: medians, "
                  "their ratio, whether their intervals meet");
  add_input(command, "profiles", &options->files, "Two profile databases, a and b");
  add_filter(command, options->filter);
  add_text(command, "--platform", &options->platform, "NAME",
           "The runs of this platform (default: that of each file's newest run)")
      .offers(offer_platforms());
  add_json(command, options->json);
  command.footer(
      "Shows and does not judge: the exit code is 0 however far apart the figures are.\n"
      "Example: pirt diff before.db after.db --filter sobel");
  command.runs(action, [options] { return diff(*options); });
}

}  // namespace pirt::cli
