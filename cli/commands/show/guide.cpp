// pirt complete, pirt manual: what the shells' scripts and the build ask for; hidden.
#include <memory>
#include <span>

#include "characterize/machine/build_info.h"
#include "cli/commands.h"
#include "cli/guide/completion.h"
#include "cli/guide/manual.h"
#include "cli/options/files.h"
#include "cli/options/output.h"
#include "cli/options/program.h"
#include "workloads/base/text/text.h"

namespace pirt::cli {

void add_complete(CLI::App& app, Action& action) {
  auto words = std::make_shared<std::vector<std::string>>();
  Command command(app, "complete", "What may follow these words, a line each");
  command.hide();
  command.add("words", words.get(), "Behind `--`; the last is being typed");
  command.runs(action, [words, &app] {
    emit_text(completion_text(complete(describe(app), *words)), {});
    return 0;
  });
}

void add_manual(CLI::App& app, Action& action) {
  struct Options {
    std::string page;
    Output output;
  };
  auto options = std::make_shared<Options>();
  Command command(app, "manual", "A manual page; without a name, the names of all");
  command.hide();
  command.add("page", &options->page, "Its name");
  add_output(command, "-o,--output", options->output, "Write to a file (default: stdout)");
  command.runs(action, [options, &app] {
    const auto program = describe(app);
    emit_text(options->page.empty()
                  ? join(manual_names(program), "\n") + "\n"
                  : manual_page(program, options->page, std::string(build_info().version)),
              options->output);
    return 0;
  });
}

}  // namespace pirt::cli
