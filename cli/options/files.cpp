#include "cli/options/files.h"

#include <fmt/core.h>

#include <algorithm>
#include <fstream>
#include <iterator>

#include "characterize/platform/platform.h"
#include "cli/options/process_start.h"
#include "workloads/backends/opencl/tuning/tuning_file.h"
#include "workloads/base/error.h"
#include "workloads/base/text/json.h"
#include "workloads/base/text/text.h"
#include "workloads/inputs/pictures/images.h"

namespace pirt::cli {
namespace {

namespace fs = std::filesystem;

constexpr const char* kStdin = "/dev/stdin";

/// What --help shows for the value.
std::string type_of(FileUse use) {
  switch (use) {
    case FileUse::kRead:
      return "FILE";
    case FileUse::kReadIfFile:
      return "NAME|FILE";
    case FileUse::kReadPictures:
      return "FILE|FOLDER";
    case FileUse::kContinued:
      return "DATAFILE";
    case FileUse::kWritten:
      break;
  }
  return "OUTFILE";
}

bool is_written(FileUse use) { return use == FileUse::kWritten || use == FileUse::kContinued; }

std::string problem_of_name(const std::string& name, FileUse use, bool stdout_takes_it) {
  if (name.empty()) return "the name of a file is empty";
  if (!is_written(use) || (stdout_takes_it && means_stdout(name))) return "";
  if (means_stdout(name)) {
    return fmt::format("this cannot go to standard output ({}); name a file", name);
  }
  if (name.front() != '-') return "";
  return fmt::format("'{0}' is taken for an option; write ./{0} for a file of that name", name);
}

Option mark(Option option, FileUse use, bool stdout_takes_it = false) {
  return option.names_file(use)
      .type(type_of(use) + (stdout_takes_it ? "|-" : ""))
      .check([=](const std::string& name) { return problem_of_name(name, use, stdout_takes_it); });
}

/// follow_links(), by the one name that it has whichever links lead to its folder.
fs::path destination(fs::path path) {
  std::error_code failed;
  path = follow_links(fs::absolute(path, failed));
  const auto folder = fs::weakly_canonical(path.parent_path(), failed);
  return failed ? path.lexically_normal() : folder / path.filename();
}

bool is_file(const fs::path& path) {
  std::error_code failed;
  return fs::is_regular_file(path, failed);
}

bool same_file(const fs::path& a, const fs::path& b) {
  std::error_code failed;
  if (is_file(a) && is_file(b)) return fs::equivalent(a, b, failed);
  // A device, a folder.
  if (fs::exists(a, failed) || fs::exists(b, failed)) return false;
  return destination(a) == destination(b);
}

bool is_below(const fs::path& file, const fs::path& folder) {
  std::error_code failed;
  const auto inner = fs::canonical(file, failed);
  const auto outer = fs::canonical(folder, failed);
  if (failed) return false;
  return std::ranges::mismatch(outer, inner).in1 == outer.end();
}

bool overwrites(const NamedFile& written, const NamedFile& other) {
  std::error_code failed;
  if (!fs::is_directory(other.path, failed)) return same_file(written.path, other.path);
  switch (other.use) {
    case FileUse::kReadPictures:
      return std::ranges::any_of(pictures_of(other.path), [&](const fs::path& picture) {
        return same_file(written.path, picture);
      });
    case FileUse::kRead:
      return is_file(written.path) && is_below(written.path, other.path);
    default:
      return false;
  }
}

void check_pair(const NamedFile& a, const NamedFile& b) {
  const bool first = a.use == FileUse::kWritten || !is_written(b.use);
  const NamedFile& written = first ? a : b;
  const NamedFile& other = first ? b : a;
  if (!is_written(written.use)) return;
  // The tuning file, which every command reads, and `tune`, which goes on with it.
  if (written.use == FileUse::kContinued && other.use == FileUse::kContinued) return;
  if (!overwrites(written, other)) return;
  std::error_code failed;
  const bool folder = fs::is_directory(other.path, failed);
  throw_bad_input(fmt::format("{} '{}' would overwrite {}{} '{}'{}; name another file",
                              written.option, written.path.string(), folder ? "a file of " : "",
                              other.option, other.path.string(), folder ? "" : ", the same file"));
}

/// The name of the database that a file of this name would be taken for the journal of; empty if it
/// would be taken for none.
fs::path database_beside(const fs::path& path) {
  const std::string name = path.string();
  for (const std::string suffix : {"-journal", "-wal", "-shm"}) {
    if (name.ends_with(suffix)) return name.substr(0, name.size() - suffix.size());
  }
  return {};
}

/// SQLite would roll it back into the database, or remove it; a database of such a name even with
/// the first that is made or read beside it.
void check_beside_databases(const NamedFile& written, const std::vector<NamedFile>& files) {
  const auto database = database_beside(destination(written.path));
  if (database.empty()) return;
  if (written.use == FileUse::kContinued) {
    throw_bad_input(
        fmt::format("{} '{}' would go with '{}', which SQLite keeps such files beside; "
                    "name another file",
                    written.option, written.path.string(), database.string()));
  }
  std::string head(15, ' ');
  std::ifstream(database, std::ios::binary).read(head.data(), 15);
  const bool named = std::ranges::any_of(
      files, [&](const NamedFile& file) { return destination(file.path) == database; });
  if (!named && head != "SQLite format 3") return;
  throw_bad_input(
      fmt::format("{} '{}' is where SQLite keeps what it undoes of '{}'; name another file",
                  written.option, written.path.string(), database.string()));
}

/// What no option names: where stdout leads, and the tuned parameters that every command uses.
std::vector<NamedFile> standing_files() {
  std::vector<NamedFile> files;
  const auto results = fmt::format("/proc/self/fd/{}", results_descriptor());
  if (is_file(results)) files.push_back({"standard output", results, FileUse::kWritten});
  if (const auto tuning = opencl::tuning_path()) {
    files.push_back({"the tuning file", *tuning, FileUse::kContinued});
  }
  return files;
}

}  // namespace

Option add_input(Command& command, const std::string& name, const Target& target,
                 const std::string& help, FileUse use) {
  const Option option = mark(command.add(name, target, help), use);
  return option.reads_as(
      [](const std::string& given) { return given == "-" ? std::string(kStdin) : given; });
}

Option add_continued(Command& command, const std::string& name, const Target& target,
                     const std::string& help) {
  return mark(command.add(name, target, help), FileUse::kContinued);
}

Option add_output(Command& command, const std::string& name, Output& output,
                  const std::string& help, StdoutUse stdout_use) {
  const auto label = name.substr(name.rfind(',') + 1);
  const auto set = [&output, label](const std::string& target) { output = Output(label, target); };
  return mark(command.add(name, set, help), FileUse::kWritten, stdout_use == StdoutUse::kAllowed);
}

void add_json(Command& command, Output& output) {
  add_output(command, "--json", output, "Write JSON to a file, or to stdout for -");
}

std::vector<NamedFile> given_files(const CLI::App& command) {
  std::vector<NamedFile> files;
  for (const GivenOption& option : given_options(command)) {
    const auto use = option.facts->file;
    if (!use) continue;
    for (const auto& name : option.values) {
      if (use == FileUse::kReadIfFile && !names_a_file(name)) continue;
      files.push_back({option.name, name, *use});
    }
  }
  return files;
}

std::vector<NamedFile> written_files(std::initializer_list<const Output*> outputs) {
  std::vector<NamedFile> files;
  for (const Output* output : outputs) {
    if (*output) files.push_back({output->option(), output->path(), FileUse::kWritten});
  }
  return files;
}

void check_files(std::vector<NamedFile> files) {
  // Not std::ranges: clang 14 does not compile the subrange of this libstdc++.
  const auto to_stdout =
      std::stable_partition(files.begin(), files.end(), [](const NamedFile& file) {
        return file.use != FileUse::kWritten || !means_stdout(file.path.string());
      });
  if (files.end() - to_stdout > 1) {
    throw_bad_input(fmt::format("only one of {} and {} can write to stdout; name files",
                                to_stdout->option, std::next(to_stdout)->option));
  }
  files.erase(to_stdout, files.end());
  const auto given = files.size();
  std::ranges::move(standing_files(), std::back_inserter(files));
  for (std::size_t i = 0; i < files.size(); ++i) {
    for (std::size_t k = 0; k < i; ++k) check_pair(files[i], files[k]);
  }
  for (std::size_t i = 0; i < given; ++i) {
    if (!is_written(files[i].use)) continue;
    check_beside_databases(files[i], files);
    if (files[i].use == FileUse::kWritten) check_writable(files[i].path);
  }
}

}  // namespace pirt::cli
