#include "cli/options/own.h"

#include <fmt/core.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>

#include "characterize/platform/platform.h"
#include "characterize/profile/own_rows.h"
#include "characterize/worker/job_runner.h"
#include "cli/options/files.h"
#include "cli/options/output.h"
#include "scheduler/mix/mix.h"
#include "workloads/base/error.h"
#include "workloads/catalog/own_files.h"
#include "workloads/catalog/own_list.h"
#include "workloads/catalog/specs.h"
#include "workloads/model/own_operation.h"
#include "workloads/own/definition.h"
#include "workloads/own/own.h"

namespace pirt::cli {

namespace fs = std::filesystem;

namespace {

/// Whether it is of whoever runs pirt, of root, or of the owner of @p mix, which was asked for:
/// both a link and what it leads to.
bool may_be_loaded(const fs::path& file, const fs::path& mix) {
  struct stat of_mix {};
  struct stat of_link {};
  struct stat of_target {};
  static_cast<void>(::stat(mix.c_str(), &of_mix));  // one that is missing is told elsewhere
  if (::lstat(file.c_str(), &of_link) != 0 || ::stat(file.c_str(), &of_target) != 0) return false;
  return std::ranges::all_of(std::array{of_link.st_uid, of_target.st_uid}, [&of_mix](uid_t owner) {
    return owner == ::geteuid() || owner == 0 || owner == of_mix.st_uid;
  });
}

/// Whether it names workloads that are not pirt's and that nobody here has said anything of.
bool names_unknown(const std::string& mix, const Profile& profile, const Platform* platform) {
  std::error_code none;
  if (!fs::is_regular_file(mix, none)) return false;          // What a pipe has is read once.
  const std::vector<std::string> rows = profile.workloads();  // Imported ones are that alone.
  return std::ranges::any_of(named_workloads(mix), [&](const std::string& name) {
    return is_foreign(name) && try_find_own(own::plain_name(name)) == nullptr &&
           std::ranges::find(rows, name) == rows.end() &&
           (platform == nullptr || !platform->workloads.contains(name));
  });
}

/// Whether this process can compute what it has, and knows all of it.
bool is_loaded(const std::string& file) {
  return std::ranges::any_of(own_workloads(), [&file](const Workload* each) {
    const OwnOperation* const own = own_operation(*each);
    return own != nullptr && own->source == file && each->make_data;
  });
}

void ask(const std::string& file) {
  constexpr Nanos kLimit = std::chrono::seconds(120);
  learn_workloads(JobRunner("/proc/self/exe", kLimit, nullptr), file);
}

}  // namespace

std::vector<std::string> OwnFiles::all(const std::string& mix) const {
  std::vector<std::string> all;
  const auto add = [&all](const fs::path& file) {
    const std::string path = fs::absolute(file).lexically_normal().string();
    const auto is_it = [&path](const std::string& each) {
      std::error_code none;
      return each == path || fs::equivalent(each, path, none);
    };
    if (std::ranges::none_of(all, is_it)) all.push_back(path);
  };
  for (const std::string& file : files) add(file);
  if (!mix.empty() && names_a_file(mix)) {
    const fs::path beside = fs::absolute(mix).parent_path() / "pirt.workloads";
    const std::size_t named = all.size();
    if (fs::exists(beside)) add(beside);
    if (all.size() > named && !may_be_loaded(beside, mix)) {
      throw_bad_input(
          fmt::format("'{}' belongs to somebody else; name it with --workloads", all.back()));
    }
  }
  return all;
}

void add_workloads(Command& command, OwnFiles& own) {
  add_input(command, "--workloads", &own.files,
            "Workloads of your own: a module (a shared library) or a workload file (YAML); may be "
            "repeated; `pirt.workloads` beside a mix is taken by itself")
      .one_at_a_time();
}

void learn(const std::vector<std::string>& files) {
  own::NamesOfFiles names;
  for (const std::string& file : files) {
    if (known_of(file).empty()) ask(file);
    names.add(file, known_of(file));
  }
}

void load(const std::vector<std::string>& files) {
  own::NamesOfFiles names;
  for (const std::string& file : files) {
    std::set<std::string> its;
    for (const own::Definition& each : load_workloads(file)) its.insert(each.name);
    names.add(file, its);
  }
}

std::set<std::string> known_of(const std::string& file, const std::string& digest) {
  std::set<std::string> names;
  for (const Workload* each : own_workloads()) {
    const OwnOperation* const own = own_operation(*each);
    if (own == nullptr || own->source != file) continue;
    if (digest.empty() || own->digest == digest) names.insert(each->name);
  }
  return names;
}

void hold_against(Profile& profile, const std::vector<std::string>& files, const std::string& mix,
                  const Platform* platform) {
  own::NamesOfFiles names;
  for (const std::string& file : files) {
    const std::string digest = own::digest_of(file);
    auto workloads = measured_of(profile, file, digest);
    if (workloads.empty()) {
      learn({file});
    } else if (names_unknown(mix, profile, platform) && !is_loaded(file)) {
      try {
        ask(file);
      } catch (const Error& error) {  // Its rows are here all the same.
        warn(error.what());
      }
    }
    // Of what it holds now: what was measured of it may have moved to another one.
    auto its = measured_of(profile, "", digest);
    its.merge(known_of(file, digest));
    names.add(file, its);
    workloads.merge(known_of(file));
    const std::string changed = doubt_changed(profile, workloads, digest);
    if (!changed.empty()) warn(own::not_as_measured(file, changed));
  }
}

}  // namespace pirt::cli
