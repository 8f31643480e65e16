#include "scheduler/mix/mix.h"

#include <algorithm>
#include <map>
#include <set>
#include <utility>

#include "characterize/platform/platform.h"
#include "mix_files.h"
#include "scheduler/mix/dependency_order.h"
#include "workloads/base/error.h"
#include "workloads/base/text.h"
#include "workloads/base/yaml.h"
#include "workloads/catalog.h"

namespace pirt {
namespace {

constexpr std::string_view kSuffix = ".yaml";
// Hz. At the least rate the second firing comes after eleven days: the time of any firing that a
// run may reach, and of the one after it, is far inside int64 nanoseconds.
constexpr double kMinRate = 1e-6;
constexpr double kMaxRate = 1e6;
constexpr std::int64_t kMaxCount = 1'000'000'000'000;

std::string checked_name(const YamlNode& node, const std::string& name) {
  if (name.empty()) node.fail("a name must not be empty");
  return name;
}

std::vector<std::string> read_eligible(const YamlNode& node) {
  std::vector<std::string> names;
  for (const auto& item : node.items()) names.push_back(checked_name(item, item.text()));
  if (names.empty()) node.fail("must name at least one unit or role");
  return names;
}

/// A task with the names that it comes after; positions come once all are known.
struct NamedTask {
  MixTask task;
  std::vector<std::string> after;
  YamlNode node;
};

void read_edge(const YamlNode& node, NamedTask& named) {
  MixEdge& edge = named.task.edges.emplace_back();
  if (!node.is_map()) {
    named.after.push_back(node.text());
    return;
  }
  node.check_keys({"task", "bytes", "transfer_ms"});
  named.after.push_back(node.at("task").text());
  if (node.has("transfer_ms")) edge.transfer = node.at("transfer_ms").milliseconds(0);
  if (node.has("bytes")) {
    edge.bytes = node.at("bytes").integer(0, kMaxCount);
    named.task.input_bytes = named.task.input_bytes.value_or(0) + *edge.bytes;
  }
}

void read_workload(const YamlNode& node, MixTask& task) {
  task.workload = node.text();
  if (try_find_workload(task.workload) == nullptr) {
    node.fail("there is no workload '" + task.workload + "'" +
              suggestion(task.workload, workload_names()));
  }
}

void read_service(const YamlNode& node, MixTask& task) {
  for (const auto& unit : node.keys()) {
    task.service.emplace(unit, node.at(unit).milliseconds(kNanosecondMs));
  }
  if (task.service.empty()) node.fail("must give the time on at least one unit");
  task.service_location = node.location();
}

NamedTask read_task(const YamlNode& node, const std::string& pipeline,
                    const std::vector<std::string>& eligible) {
  node.check_keys({"name", "workload", "service_ms", "image_input", "after", "eligible"});
  NamedTask named{.task = {}, .after = {}, .node = node};
  if (node.has("workload") == node.has("service_ms")) {
    node.fail("needs one of workload (of the catalog) and service_ms ({unit: milliseconds})");
  }
  if (node.has("workload")) {
    read_workload(node.at("workload"), named.task);
    named.task.name = named.task.workload;
  }
  if (node.has("name") || node.has("service_ms")) {
    named.task.name = checked_name(node.at("name"), node.at("name").text());
  }
  if (node.has("service_ms")) {
    read_service(node.at("service_ms"), named.task);
    named.task.workload = pipeline + "/" + named.task.name;
  }
  if (node.has("image_input")) named.task.image_input = node.at("image_input").boolean();
  named.task.eligible = node.has("eligible") ? read_eligible(node.at("eligible")) : eligible;
  if (node.has("after")) {
    for (const auto& edge : node.at("after").items()) read_edge(edge, named);
  }
  return named;
}

/// Predecessors of each task, by position in the file.
using Edges = std::vector<std::vector<std::size_t>>;

Edges resolve_edges(const std::vector<NamedTask>& tasks) {
  std::vector<std::string> names;
  std::map<std::string, std::size_t> positions;
  for (const auto& each : tasks) {
    if (!positions.emplace(each.task.name, names.size()).second) {
      each.node.fail("two tasks are named '" + each.task.name + "'");
    }
    names.push_back(each.task.name);
  }
  Edges edges(tasks.size());
  for (std::size_t i = 0; i < tasks.size(); ++i) {
    for (const auto& name : tasks[i].after) {
      const auto predecessor = positions.find(name);
      if (predecessor == positions.end()) {
        tasks[i].node.at("after").fail("no task '" + name + "' in this pipeline" +
                                       suggestion(name, names));
      }
      edges[i].push_back(predecessor->second);
    }
  }
  return edges;
}

/// Predecessors first, otherwise in file order.
std::vector<MixTask> sorted_tasks(const YamlNode& node, std::vector<NamedTask> tasks) {
  const Edges edges = resolve_edges(tasks);
  const auto [order, cycle] = dependency_order(edges);
  if (!cycle.empty()) {
    std::vector<std::string> names;
    for (const auto& each : tasks) names.push_back(each.task.name);
    node.fail(cycle_text(cycle, names));
  }
  std::vector<std::size_t> new_position(tasks.size());
  std::vector<MixTask> sorted;
  for (const std::size_t each : order) {
    new_position[each] = sorted.size();
    sorted.push_back(std::move(tasks[each].task));
    for (const std::size_t before : edges[each]) {
      sorted.back().after.push_back(new_position[before]);
    }
  }
  return sorted;
}

Pipeline read_pipeline(const YamlNode& node, const std::string& name) {
  node.check_keys(
      {"rate_hz", "closed_loop", "deadline_ms", "expires_ms", "real_time", "eligible", "tasks"});
  Pipeline pipeline;
  pipeline.name = checked_name(node, name);
  if (node.has("rate_hz") == node.has("closed_loop"))
    node.fail("needs one of rate_hz and closed_loop");
  if (node.has("rate_hz")) pipeline.rate_hz = node.at("rate_hz").number(kMinRate, kMaxRate);
  if (node.has("closed_loop")) {
    const auto loop = node.at("closed_loop");
    loop.check_keys({"frames"});
    pipeline.frames = loop.at("frames").integer(1, kMaxCount);
  }
  if (node.has("deadline_ms"))
    pipeline.deadline = node.at("deadline_ms").milliseconds(kNanosecondMs);
  if (node.has("expires_ms")) pipeline.expires = node.at("expires_ms").milliseconds(kNanosecondMs);
  if (node.has("real_time")) pipeline.real_time = node.at("real_time").boolean();
  const auto eligible =
      node.has("eligible") ? read_eligible(node.at("eligible")) : std::vector<std::string>{};
  std::vector<NamedTask> tasks;
  for (const auto& item : node.at("tasks").items())
    tasks.push_back(read_task(item, name, eligible));
  if (tasks.empty()) node.at("tasks").fail("must list at least one task");
  pipeline.tasks = sorted_tasks(node, std::move(tasks));
  return pipeline;
}

/// "a/b" with task "c" and "a" with task "b/c" would be one.
void check_own_workloads(const YamlNode& node, const Mix& mix) {
  std::set<std::string> seen;
  for (const auto& pipeline : mix.pipelines) {
    for (const auto& task : pipeline.tasks) {
      if (!task.service.empty() && !seen.insert(task.workload).second) {
        node.fail("two tasks with service_ms are called '" + task.workload + "'; rename one");
      }
    }
  }
}

}  // namespace

bool Pipeline::has_image_input() const { return std::ranges::any_of(tasks, &MixTask::image_input); }

bool Mix::open_loop() const {
  return std::ranges::any_of(pipelines,
                             [](const Pipeline& each) { return each.rate_hz.has_value(); });
}

bool Mix::fires_once() const {
  return std::ranges::all_of(pipelines, [](const Pipeline& each) { return each.frames == 1; });
}

Mix parse_mix(const std::string& file, const std::string& text) {
  const YamlNode document = parse_yaml(file, text);
  document.check_keys({"mix", "description", "image_buffers", "pipelines"});
  Mix mix;
  mix.name = checked_name(document.at("mix"), document.at("mix").text());
  if (document.has("description")) mix.description = document.at("description").paragraph();
  if (document.has("image_buffers"))
    mix.image_buffers = document.at("image_buffers").integer(1, kMaxCount);
  const auto pipelines = document.at("pipelines");
  for (const auto& name : pipelines.keys()) {
    mix.pipelines.push_back(read_pipeline(pipelines.at(name), name));
  }
  if (mix.pipelines.empty()) pipelines.fail("a mix has at least one pipeline");
  check_own_workloads(pipelines, mix);
  return mix;
}

Mix load_mix(const std::string& name) {
  if (names_a_file(name)) return parse_mix(name, read_file(name));
  const std::string file = name + std::string(kSuffix);
  const auto text = find_embedded(mix_files::files(), file);
  if (!text) {
    throw_bad_input("unknown mix '" + name + "'" + suggestion(name, shipped_mixes()) +
                    "; a file is named with a '/' or ends in .yaml");
  }
  return parse_mix(file, std::string(*text));
}

std::vector<std::string> shipped_mixes() {
  std::vector<std::string> names;
  for (const auto& file : mix_files::files()) {
    names.emplace_back(file.name.substr(0, file.name.size() - kSuffix.size()));
  }
  std::ranges::sort(names);
  return names;
}

}  // namespace pirt
