// Options that name a user's trained model, as all commands with one have them.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "cli/options/command.h"
#include "workloads/recognition/detect_objects.h"

namespace pirt::cli {

struct ModelFlags {
  std::optional<std::string> model, config, names, size, preprocess, fit;

  std::string config_option = "--config";  ///< As it is called.

  [[nodiscard]] recognition::ModelOptions options() const;
  /// The same again, for another program. @param prefix  As add_model's.
  [[nodiscard]] std::vector<std::string> arguments(const std::string& prefix) const;
};

/// @param prefix  "" for --model, --config, --names, --size and --preprocess; "classifier" for
/// --classifier, --classifier-config and so on.
/// @param what    For the help: "a detector".
void add_model(Command& command, ModelFlags& flags, const std::string& prefix,
               const std::string& what);

/// --fit, of detectors.
void add_fit(Command& command, ModelFlags& flags);

/// --threshold and --overlap.
void add_detect_options(Command& command, recognition::DetectOptions& options);

/// The pictures, files or folders, that a command works on.
void add_pictures(Command& command, std::vector<std::string>& pictures);
/// The files of @p given, each folder's in name order.
/// @throws Error{kBadInput} if there are none.
[[nodiscard]] std::vector<std::string> picture_files(const std::vector<std::string>& given);

}  // namespace pirt::cli
