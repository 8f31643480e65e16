// pirt replay: feeds the log of a trace into a fresh dispatcher and compares the decisions.
#include "scheduler/trace/replay.h"

#include <fmt/core.h>

#include <memory>

#include "cli/commands.h"
#include "cli/options/files.h"
#include "cli/options/output.h"
#include "workloads/base/error.h"
#include "workloads/base/text/json.h"

namespace pirt::cli {
namespace {

struct ReplayFlags {
  std::string file;
  Output json;
};

std::string text_of(const FileReplay& replay) {
  const ReplayResult& result = replay.result;
  if (!result.difference) {
    return fmt::format(
        "{} inputs replayed, mode {}: all {} decisions are the same\n{}", result.inputs,
        std::string(replay.mode->name), result.decisions,
        replay.complete ? "" : "The trace ends in the middle: its run did not come to its end.\n");
  }
  const ReplayDifference& difference = *result.difference;
  return fmt::format(
      "The decisions differ at input {}{}, {:.6f} ms, {}:\n  recorded: {}\n  replayed: {}\n",
      difference.entry + 1, replay.size ? fmt::format(" of {}", *replay.size) : "",
      to_ms(difference.at), difference.input, difference.recorded, difference.replayed);
}

Json json_of(const FileReplay& replay) {
  const ReplayResult& result = replay.result;
  Json json = {{"schema_version", 1},
               {"mode", std::string(replay.mode->name)},
               {"inputs", result.inputs},
               {"decisions", result.decisions},
               {"same", !result.difference.has_value()}};
  // Behind a difference nothing is read.
  if (!result.difference) json["complete"] = replay.complete;
  if (result.difference) {
    const ReplayDifference& difference = *result.difference;
    json["difference"] = {{"input", difference.entry + 1},
                          {"at_ns", difference.at.count()},
                          {"what", difference.input},
                          {"recorded", difference.recorded},
                          {"replayed", difference.replayed}};
  }
  return json;
}

int replay_trace(const ReplayFlags& options) {
  const FileReplay replay = replay_file(options.file);
  emit(text_of(replay), json_of(replay), options.json);
  return replay.result.difference ? kExitCheckFailed : 0;
}

}  // namespace

void add_replay(CLI::App& app, Action& action) {
  auto options = std::make_shared<ReplayFlags>();
  Command command(app, "replay",
                  "Check that the inputs of a trace give a fresh dispatcher the same decisions");
  add_input(command, "trace", &options->file, "A trace of pirt schedule --trace").required();
  add_json(command, options->json);
  command.footer(
      "Exit code 0: the same; 1: they differ, with the first difference; 2: the file is damaged.\n"
      "Example: pirt schedule --mode energy --platform snapdragon820 --mix convolution-1000 "
      "--trace t.json && pirt replay t.json");
  command.runs(action, [options] { return replay_trace(*options); });
}

}  // namespace pirt::cli
