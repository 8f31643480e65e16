// pirt history: the rows of many runs over time, and where they changed.
#include "reports/history/history.h"

#include <memory>

#include "cli/commands.h"
#include "cli/options/files.h"
#include "cli/options/output.h"
#include "cli/options/shipped.h"
#include "cli/options/values.h"
#include "workloads/base/error.h"

namespace pirt::cli {
namespace {

struct HistoryFlags {
  std::vector<std::string> files;
  std::string platform, filter;
  Output page, json;
};

int history(const HistoryFlags& options) {
  if (options.files.empty()) {
    throw_bad_input("no profile database given; name some, or a folder of them");
  }
  const History read = read_history(history_files(options.files), options.platform, options.filter);
  if (options.page) emit_text(render(history_document(read, true), Format::kHtml), options.page);
  const bool quiet = options.page.to_stdout();
  emit(quiet ? "" : render(history_document(read, false), Format::kText, stdout_columns()),
       history_json(read), options.json);
  return 0;
}

}  // namespace

void add_history(CLI::App& app, Action& action) {
  auto options = std::make_shared<HistoryFlags>();
  Command command(app, "history",
                  "Show where rows became slower or faster over the runs of many profiles");
  add_input(command, "profiles", &options->files,
            "Profile databases, or a folder of them (*.db); their runs in order of time");
  add_filter(command, options->filter);
  add_text(command, "--platform", &options->platform, "NAME",
           "The runs of this platform (default: that of the first file's newest run)")
      .offers(offer_platforms());
  add_output(command, "-o,--output", options->page,
             "Write a page with every series to a file, or to stdout for -");
  add_json(command, options->json);
  command.footer(
      "Shows and does not judge: the exit code is 0 whatever changed; pirt regress is the gate.\n"
      "Example: pirt history runs/ -o history.html");
  command.runs(action, [options] { return history(*options); });
}

}  // namespace pirt::cli
