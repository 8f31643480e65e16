#include "workloads/own/own.h"

#include <fmt/core.h>

#include "workloads/base/error.h"
#include "workloads/base/hash.h"
#include "workloads/base/system/program_path.h"
#include "workloads/base/text/text.h"
#include "workloads/own/libraries.h"

namespace pirt::own {
namespace {

namespace fs = std::filesystem;

/// Or a program.
bool is_library(std::string_view bytes) {
  return bytes.starts_with(
      "\x7f"
      "ELF");
}

/// The file, and what it is linked with.
void add(Hash64& hash, const fs::path& file, const std::string& bytes) {
  hash.add(std::string_view(bytes));
  if (!is_library(bytes)) return;
  for (const fs::path& linked : linked_libraries(file)) {
    hash.add(std::string_view(read_file(linked, kAnySize)));
  }
}

std::string digest(const fs::path& file, const std::string& bytes) {
  Hash64 hash;
  add(hash, file, bytes);
  if (!is_library(bytes)) {
    for (const NamedFile& named : named_files(file, bytes)) {
      const std::uintmax_t size = named.is_of_command ? fs::file_size(named.file) : 0;
      if (size > kMostHashedBytes) {
        hash.add(std::uint64_t{size});
      } else {
        add(hash, named.file, read_file(named.file, kAnySize));
      }
    }
  }
  return fmt::format("{:016x}", hash.value());
}

}  // namespace

void check_is_file(const fs::path& path) {
  std::error_code unknown;
  if (fs::exists(path, unknown) && !fs::is_regular_file(path, unknown)) {
    throw_bad_input("'" + path.string() + "' is a folder, a pipe or a device, and no file");
  }
}

std::string digest_of(const fs::path& file) {
  check_is_file(file);
  return digest(file, read_file(file, kAnySize));
}

void NamesOfFiles::add(const std::string& file, const std::set<std::string>& names) {
  for (const std::string& name : names) {
    const auto [known, is_new] = files_.emplace(name, file);
    if (is_new || known->second == file) continue;
    throw_bad_input(
        fmt::format("workload {} is in {} and in {}; rename one", name, known->second, file));
  }
}

std::string not_as_measured(const std::string& file, const std::string& workloads) {
  return fmt::format(
      "{} is not what was measured: the rows of {} are uncertain; measure them again with pirt "
      "characterize --workloads {}",
      file, workloads, file);
}

std::vector<Definition> load(const fs::path& file) {
  const fs::path path = fs::absolute(file).lexically_normal();
  check_is_file(path);
  const std::string bytes = read_file(path, kAnySize);
  auto all = is_library(bytes) ? load_module(path) : read_workload_file(path, read_text(path));
  const std::string held = digest(path, bytes);
  for (std::size_t i = 0; i < all.size(); ++i) {
    Definition& each = all[i];
    each.source = path.string();
    each.digest = held;
    check(each, path.string());
    for (std::size_t j = 0; j < i; ++j) {
      if (all[j].name == each.name) {
        throw_bad_input(fmt::format("{}: two workloads are called '{}'", path.string(), each.name));
      }
    }
  }
  if (all.empty()) throw_bad_input(path.string() + " has no workload");
  return all;
}

}  // namespace pirt::own
