// pirt generate-dag: writes a random task graph as a mix.
#include <memory>

#include "cli/commands.h"
#include "cli/output.h"
#include "scheduler/dag_generator.h"
#include "workloads/base/error.h"
#include "workloads/base/text.h"

namespace pirt::cli {
namespace {

struct Options {
  DagParameters parameters;
  std::string units = "cpu,gpu,dsp";
  std::int64_t seed = 1;
  std::optional<std::string> output;
};

int generate(const Options& options) {
  DagParameters parameters = options.parameters;
  parameters.units = split(options.units, ',');
  if (options.seed < 0) {
    throw_bad_input("--seed is " + std::to_string(options.seed) + "; it is at least 0");
  }
  parameters.seed = static_cast<std::uint64_t>(options.seed);
  emit_text(generate_dag(parameters), options.output);
  return 0;
}

}  // namespace

void add_generate_dag(CLI::App& app, Action& action) {
  auto options = std::make_shared<Options>();
  auto& parameters = options->parameters;
  auto* command = app.add_subcommand(
      "generate-dag", "Write a random task graph as a mix, by the parameters of the HEFT paper");
  command->add_option("--tasks", parameters.tasks, "Number of tasks, 1 to 10000")
      ->capture_default_str();
  command
      ->add_option("--shape", parameters.shape,
                   "alpha: sqrt(tasks)/alpha levels; above 1 wide, below 1 long")
      ->capture_default_str();
  command->add_option("--out-degree", parameters.out_degree, "Most edges that leave a task")
      ->capture_default_str();
  command
      ->add_option("--ccr", parameters.ccr,
                   "Communication to computation: mean transfer over mean service time")
      ->capture_default_str();
  command
      ->add_option("--heterogeneity", parameters.heterogeneity,
                   "beta, 0 to 2: how far the units differ, in parts of a task's mean")
      ->capture_default_str();
  command->add_option("--mean-ms", parameters.mean_ms, "Mean service time, in milliseconds")
      ->capture_default_str();
  command->add_option("--units", options->units, "Units or roles that run the tasks")
      ->capture_default_str();
  command->add_option("--seed", options->seed, "Same seed, same bytes")->capture_default_str();
  command->add_option("-o,--output", options->output, "Mix file to write (default: stdout)");
  command->footer("Example: pirt generate-dag --tasks 40 --ccr 0.5 --seed 1 -o dag.yaml");
  command->callback([options, &action] { action = [options] { return generate(*options); }; });
}

}  // namespace pirt::cli
