// pirt export: a profile in the formats of other tools.
#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "cli/commands.h"
#include "cli/options/files.h"
#include "cli/options/output.h"
#include "cli/options/shipped.h"
#include "cli/options/values.h"
#include "reports/export/profile_export.h"
#include "workloads/base/error.h"
#include "workloads/base/text/json.h"
#include "workloads/base/text/text.h"

namespace pirt::cli {
namespace {

struct ExportFlags {
  std::string database;
  std::string format;
  std::string table;
  std::string filter;
  std::string platform;
  Output output;
};

const std::vector<std::string>& formats() {
  static const std::vector<std::string> names = {"json", "csv", "gbench"};
  return names;
}

constexpr std::array kTables = {
    std::pair("profile", CsvTable::kProfile), std::pair("conditions", CsvTable::kConditions),
    std::pair("units", CsvTable::kUnitTimes), std::pair("energy", CsvTable::kEnergy),
    std::pair("peaks", CsvTable::kPeaks),     std::pair("samples", CsvTable::kSamples)};

std::vector<std::string> table_names() {
  std::vector<std::string> names;
  for (const auto& [name, table] : kTables) names.emplace_back(name);
  return names;
}

CsvTable table_of(const std::string& name) {
  return std::ranges::find_if(kTables, [&](const auto& each) { return each.first == name; })
      ->second;
}

std::string exported(const ExportFlags& options) {
  const auto load = [&options] {
    return load_with_samples(options.database, options.platform, options.filter);
  };
  if (options.format == "csv") {
    return export_csv(load(), table_of(options.table.empty() ? "profile" : options.table));
  }
  if (!options.table.empty()) throw_bad_input("--table is for --format csv only; leave it out");
  if (options.format == "json") {
    auto json = export_json(load());
    json["schema_version"] = 1;
    return json_text(json, 1) + "\n";
  }
  const auto result = export_google_benchmark(load());
  for (const auto& row : result.left_out) warn("not exported, since it is not used: " + row);
  return json_text(result.json, 1) + "\n";
}

int run_export(const ExportFlags& options) {
  if (options.format.empty()) {
    throw_bad_input("--format is required: " + join(formats(), ", ") +
                    "; see 'pirt export --help'");
  }
  if (options.database.empty()) {
    throw_bad_input("no profile database given; `pirt characterize --db FILE` makes one");
  }
  emit_text(exported(options), options.output);
  return 0;
}

}  // namespace

void add_export(CLI::App& app, Action& action) {
  auto options = std::make_shared<ExportFlags>();
  Command command(
      app, "export",
      "Write a profile for other tools: the newest rows of one platform, with provenance");
  add_input(command, "profile", &options->database, "The profile database");
  add_choice(command, "--format", &options->format, "FORMAT", formats(),
             "Everything with the raw samples, one table, or JSON as Google Benchmark writes it "
             "(valid rows only, ns a call)");
  add_choice(command, "--table", &options->table, "TABLE", table_names(),
             "With csv (default: profile); conditions are cold caches and calls beside others, "
             "units are hand-overs and what else they take beside calls");
  add_filter(command, options->filter);
  add_text(command, "--platform", &options->platform, "NAME",
           "The runs of this platform (default: that of the newest run)")
      .offers(offer_platforms());
  add_output(command, "-o,--output", options->output, "Write to a file (default, and -: stdout)");
  command.footer("Example: pirt export profile.db --format gbench -o profile.json");
  command.runs(action, [options] { return run_export(*options); });
}

}  // namespace pirt::cli
