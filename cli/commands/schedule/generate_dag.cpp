// pirt generate dag: writes a random task graph as a mix.
#include <memory>

#include "cli/commands.h"
#include "cli/options/files.h"
#include "cli/options/output.h"
#include "cli/options/values.h"
#include "scheduler/mix/dag_generator.h"
#include "workloads/base/error.h"
#include "workloads/base/text/text.h"

namespace pirt::cli {
namespace {

struct GenerateDagFlags {
  DagParameters parameters;
  std::string units = "cpu,gpu,dsp";
  Output output;
};

int generate(const GenerateDagFlags& options) {
  DagParameters parameters = options.parameters;
  parameters.units = split(options.units, ',');
  emit_text(generate_dag(parameters), options.output);
  return 0;
}

}  // namespace

void add_generate_dag(CLI::App& app, Action& action) {
  auto options = std::make_shared<GenerateDagFlags>();
  auto& parameters = options->parameters;
  Command command(app, "generate dag",
                  "Write a random task graph as a mix, by the parameters of the HEFT paper");
  add_value(command, "--tasks", &parameters.tasks, "INTEGER", not_within(1, kMostDagTasks),
            "Number of tasks")
      .shows_default();
  add_value(command, "--shape", &parameters.shape, "NUMBER", not_within(0.0, kHighestDagShape),
            "alpha: sqrt(tasks)/alpha levels; above 1 wide, below 1 long")
      .shows_default();
  add_value(command, "--out-degree", &parameters.out_degree, "INTEGER",
            not_within(1, kMostDagTasks), "Most edges that leave a task")
      .shows_default();
  add_value(command, "--ccr", &parameters.ccr, "NUMBER", not_within(0.0, kHighestDagCcr),
            "Communication to computation: mean transfer over mean service time")
      .shows_default();
  add_value(command, "--heterogeneity", &parameters.heterogeneity, "NUMBER",
            not_within(0.0, kHighestDagHeterogeneity),
            "beta: how far the units differ, in parts of a task's mean")
      .shows_default();
  add_value(command, "--mean-ms", &parameters.mean_ms, "NUMBER", not_within(0.0, kLongestDagMeanMs),
            "Mean service time, in milliseconds")
      .shows_default();
  add_text(command, "--units", &options->units, "UNIT,...", "Units or roles that run the tasks")
      .shows_default();
  add_seed(command, parameters.seed, "Same seed, same bytes");
  add_output(command, "-o,--output", options->output, "Mix file to write (default: stdout)");
  command.footer("Example: pirt generate dag --tasks 40 --ccr 0.5 --seed 1 -o dag.yaml");
  command.runs(action, [options] { return generate(*options); });
}

}  // namespace pirt::cli
