#include "scheduler/mix/mix.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <set>
#include <span>
#include <utility>

#include "characterize/platform/shipped.h"
#include "mix_files.h"
#include "scheduler/mix/dependency_order.h"
#include "workloads/base/error.h"
#include "workloads/base/text/text.h"
#include "workloads/base/text/yaml.h"
#include "workloads/catalog/specs.h"

namespace pirt {
namespace {

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

/// A task, and where it stands: what it comes after is read once all names are known.
struct FileTask {
  MixTask task;
  YamlNode node;
};

/// Position of the tensor called @p name. @throws with the nearest name.
std::size_t find_port(const YamlNode& node, const std::string& workload, const char* kind,
                      const std::vector<TensorSpec>& specs, const std::string& name) {
  const auto found = std::ranges::find(specs, name, &TensorSpec::name);
  if (found == specs.end()) {
    std::vector<std::string> names;
    for (const auto& spec : specs) names.push_back(spec.name);
    node.fail(workload + " has no " + kind + " '" + name + "'" + suggestion(name, names));
  }
  return static_cast<std::size_t>(found - specs.begin());
}

/// Whether what is made fits where it is taken: a list may have a lower capacity.
bool fits(const TensorSpec& made, const TensorSpec& taken) {
  if (made.element != taken.element || made.varies != taken.varies) return false;
  if (!made.varies) return made.shape == taken.shape;
  return std::ranges::equal(std::span(made.shape).subspan(1), std::span(taken.shape).subspan(1)) &&
         made.shape.front() <= taken.shape.front();
}

void read_workload(const YamlNode& node, MixTask& task) {
  task.workload = node.text();
  try {
    static_cast<void>(find_spec(task.workload));
  } catch (const Error& error) {
    node.fail(error.what());
  }
}

void read_service(const YamlNode& node, MixTask& task) {
  for (const auto& unit : node.keys()) {
    task.service.emplace(unit, node.at(unit).milliseconds(kNanosecondMs));
  }
  if (task.service.empty()) node.fail("must give the time on at least one unit");
  task.service_location = node.location();
}

/// 921600, as much in as out, or {in: 921600, out: 1200}.
MixBytes read_bytes(const YamlNode& node, const MixTask& task) {
  if (!task.service.empty()) {
    node.fail(
        "a task with service_ms moves what its edges say; use after: [{task: NAME, bytes: N}]");
  }
  if (moves_tensors(find_spec(task.workload))) {
    node.fail("the tensors of " + task.workload + " say what it moves; leave it out");
  }
  if (!node.is_map()) {
    const std::int64_t each_way = node.integer(0, kMaxCount);
    return {.in = each_way, .out = each_way};
  }
  node.check_keys({"in", "out"});
  return {.in = node.at("in").integer(0, kMaxCount), .out = node.at("out").integer(0, kMaxCount)};
}

MixTask read_task(const YamlNode& node, const std::string& pipeline,
                  const std::vector<std::string>& eligible) {
  node.check_keys({"name", "workload", "service_ms", "image_input", "inputs", "after", "state",
                   "bytes", "eligible"});
  MixTask task;
  if (node.has("workload") == node.has("service_ms")) {
    node.fail(
        "needs one of workload (of the catalog, or a foreign one of a profile) and service_ms "
        "({unit: milliseconds})");
  }
  if (node.has("workload")) {
    read_workload(node.at("workload"), task);
    task.name = task.workload;
  }
  if (node.has("name") || node.has("service_ms")) {
    task.name = checked_name(node.at("name"), node.at("name").text());
  }
  if (node.has("service_ms")) {
    read_service(node.at("service_ms"), task);
    task.workload = pipeline + "/" + task.name;
  }
  if (node.has("bytes")) task.bytes = read_bytes(node.at("bytes"), task);
  if (node.has("image_input")) task.image_input = node.at("image_input").boolean();
  task.eligible = node.has("eligible") ? read_eligible(node.at("eligible")) : eligible;
  return task;
}

/// Finds tasks by their name.
class TaskNames {
 public:
  explicit TaskNames(const std::vector<FileTask>& tasks) {
    for (const auto& each : tasks) {
      if (!positions_.emplace(each.task.name, names_.size()).second) {
        each.node.fail("two tasks are named '" + each.task.name + "'");
      }
      names_.push_back(each.task.name);
    }
  }
  [[nodiscard]] std::size_t find(const YamlNode& node, const std::string& name) const {
    const auto found = positions_.find(name);
    if (found == positions_.end()) {
      node.fail("no task '" + name + "' in this pipeline" + suggestion(name, names_));
    }
    return found->second;
  }
  [[nodiscard]] bool has(const std::string& name) const { return positions_.contains(name); }
  [[nodiscard]] const std::vector<std::string>& all() const { return names_; }

 private:
  std::vector<std::string> names_;
  std::map<std::string, std::size_t> positions_;
};

/// One of @p list, which is `after`.
void read_edge(const YamlNode& list, const YamlNode& item, const std::vector<FileTask>& tasks,
               const TaskNames& names, MixTask& task) {
  MixEdge& edge = task.edges.emplace_back();
  if (item.is_map()) {
    item.check_keys({"task", "bytes", "transfer_ms"});
    if (item.has("transfer_ms")) edge.transfer = item.at("transfer_ms").milliseconds(0);
    if (item.has("bytes")) {
      edge.bytes = item.at("bytes").integer(0, kMaxCount);
      task.input_bytes = task.input_bytes.value_or(0) + *edge.bytes;
    }
  }
  task.after.push_back(names.find(list, (item.is_map() ? item.at("task") : item).text()));
  // What a foreign task makes goes to a task with service_ms along their edge, unless that says how
  // much: other calls move it themselves.
  const auto& made = tasks[task.after.back()].task.bytes;
  if (!edge.bytes && made && !task.service.empty()) edge.bytes = made->out;
}

/// "undistort.image@-1", by file order; checked against what that task makes.
PortInput read_port(const YamlNode& node, const std::string& input, const MixTask& taker,
                    const std::vector<FileTask>& tasks, const TaskNames& names) {
  constexpr std::string_view kEarlier = "@-1";
  const WorkloadSpec workload = find_spec(taker.workload);
  PortInput port{.input = find_port(node, workload.name, "input", workload.inputs, input)};
  std::string maker_name = node.text();
  port.earlier = maker_name.ends_with(kEarlier);
  if (port.earlier) maker_name.resize(maker_name.size() - kEarlier.size());
  auto dot = maker_name.rfind('.');
  if (dot == std::string::npos || dot == 0 || dot + 1 == maker_name.size() ||
      maker_name.find('@', dot) != std::string::npos) {
    node.fail("'" + node.text() + "' is not of the form TASK.OUTPUT or TASK.OUTPUT@-1");
  }
  // Tensors have dots, too, as tasks may.
  for (auto at = dot; at != std::string::npos && at > 0; at = maker_name.rfind('.', at - 1)) {
    if (!names.has(maker_name.substr(0, at))) continue;
    dot = at;
    break;
  }
  const std::string output = maker_name.substr(dot + 1);
  maker_name.resize(dot);
  port.task = names.find(node, maker_name);
  const MixTask& maker = tasks[port.task].task;
  if (!maker.service.empty()) {
    node.fail("'" + maker_name + "' has service_ms and makes no tensors; use after:");
  }
  const auto& outputs = find_spec(maker.workload).outputs;
  port.output = find_port(node, maker.workload, "output", outputs, output);
  const TensorSpec& made = outputs[port.output];
  const TensorSpec& taken = workload.inputs[port.input];
  if (!fits(made, taken)) {
    node.fail(maker.workload + " makes " + made.describe() + ", but " + taker.workload + " takes " +
              taken.describe());
  }
  return port;
}

/// What comes in by ports of one firing is an edge whose bytes follow from them.
void add_port_edge(const YamlNode& node, const PortInput& port, const MixTask& maker,
                   MixTask& taker) {
  const auto known = std::ranges::find(taker.after, port.task);
  const auto position = static_cast<std::size_t>(known - taker.after.begin());
  if (known == taker.after.end()) {
    taker.after.push_back(port.task);
    taker.edges.emplace_back();
  }
  MixEdge& edge = taker.edges[position];
  if (edge.bytes && !edge.by_port) {
    node.at("after").fail("the bytes from '" + maker.name +
                          "' follow from `inputs`; leave them out");
  }
  edge.by_port = true;
  edge.bytes = edge.bytes.value_or(0) + find_spec(maker.workload).outputs[port.output].size_bytes();
}

/// What each comes after, by file order: `after`, and `inputs` of the same firing.
void read_edges(std::vector<FileTask>& tasks, const TaskNames& names) {
  for (auto& [task, node] : tasks) {
    if (node.has("after")) {
      const YamlNode after = node.at("after");
      for (const auto& item : after.items()) read_edge(after, item, tasks, names, task);
    }
    if (!node.has("inputs")) continue;
    const YamlNode inputs = node.at("inputs");
    if (!task.service.empty()) {
      inputs.fail("a task with service_ms has no tensors; use after: [{task: NAME, bytes: N}]");
    }
    for (const auto& input : inputs.keys()) {
      const PortInput port = read_port(inputs.at(input), input, task, tasks, names);
      task.inputs.push_back(port);
      if (!port.earlier) add_port_edge(node, port, tasks[port.task].task, task);
    }
  }
}

/// Who makes something for others knows it.
void note_makers(std::vector<MixTask>& tasks) {
  for (const MixTask& taker : tasks) {
    for (const PortInput& port : taker.inputs) {
      auto& handed_on = tasks[port.task].handed_on;
      const auto place = std::ranges::lower_bound(handed_on, port.output);
      if (place == handed_on.end() || *place != port.output) handed_on.insert(place, port.output);
      tasks[port.task].read_later = tasks[port.task].read_later || port.earlier;
    }
  }
}

/// Predecessors first, otherwise in file order.
std::vector<MixTask> sorted_tasks(const YamlNode& node, std::vector<FileTask> tasks) {
  const TaskNames names(tasks);
  read_edges(tasks, names);
  std::vector<std::vector<std::size_t>> edges;
  for (const auto& each : tasks) edges.push_back(each.task.after);
  const auto [order, cycle] = dependency_order(edges);
  if (!cycle.empty()) node.fail(cycle_text(cycle, names.all()));
  // A loop that leads through an earlier firing has no first one: nothing in it could ever start.
  for (std::size_t i = 0; i < tasks.size(); ++i) {
    for (const PortInput& port : tasks[i].task.inputs) edges[i].push_back(port.task);
  }
  const auto loop = dependency_order(edges).cycle;
  if (!loop.empty()) {
    node.fail(cycle_text(loop, names.all()) + ", through @-1: no firing could be the first");
  }
  std::vector<std::size_t> new_position(tasks.size());
  for (std::size_t i = 0; i < order.size(); ++i) new_position[order[i]] = i;
  std::vector<MixTask> sorted;
  for (const std::size_t each : order) {
    MixTask& task = sorted.emplace_back(std::move(tasks[each].task));
    for (std::size_t& before : task.after) before = new_position[before];
    for (PortInput& port : task.inputs) port.task = new_position[port.task];
  }
  note_makers(sorted);
  return sorted;
}

/// Gives the task its state: one of the pipeline's own, or one that `state:` names and tasks of
/// other pipelines may hold too.
void resolve_state(const YamlNode& node, const std::string& pipeline, MixTask& task, Mix& mix) {
  const auto workload =
      task.service.empty() ? std::optional(find_spec(task.workload)) : std::nullopt;
  const bool has_state = workload && workload->state.has_value();
  if (!has_state) {
    if (node.has("state")) node.at("state").fail(task.workload + " has no state; leave it out");
    return;
  }
  const StateSpec& spec = *workload->state;
  const std::string name = node.has("state")
                               ? checked_name(node.at("state"), node.at("state").text())
                               : pipeline + "/" + spec.name;
  const auto known = std::ranges::find(mix.states, name, &MixState::name);
  task.state = static_cast<std::size_t>(known - mix.states.begin());
  if (known == mix.states.end()) {
    std::int64_t size_bytes = 0;
    for (const auto& tensor : spec.tensors) size_bytes += tensor.size_bytes();
    mix.states.push_back({.name = name, .size_bytes = size_bytes, .workload = task.workload});
    return;
  }
  const StateSpec& theirs = *find_spec(known->workload).state;
  if (theirs.name != spec.name || theirs.tensors != spec.tensors) {
    node.at(node.has("state") ? "state" : "workload")
        .fail("state '" + name + "' is already " + known->workload + "'s " + theirs.name + "; " +
              task.workload + " keeps another, " + spec.name + ": give it a name of its own");
  }
}

/// When firings come, beside the rate.
void read_arrivals(const YamlNode& node, Pipeline& pipeline) {
  for (const char* key : {"offset_ms", "jitter_ms"}) {
    if (node.has(key) && !pipeline.rate_hz) {
      node.at(key).fail("is about pipelines with a rate_hz; leave it out");
    }
  }
  if (node.has("offset_ms")) pipeline.offset = node.at("offset_ms").milliseconds(0);
  if (!node.has("jitter_ms")) return;
  pipeline.jitter = node.at("jitter_ms").milliseconds(0);
  // Firings stay in their order.
  if (to_s(pipeline.jitter) * *pipeline.rate_hz > 1) {
    node.at("jitter_ms")
        .fail(fmt::format("must not be above the {:g} ms between two firings",
                          1e3 / *pipeline.rate_hz));
  }
}

Pipeline read_pipeline(const YamlNode& node, const std::string& name, Mix& mix) {
  node.check_keys({"rate_hz", "offset_ms", "jitter_ms", "closed_loop", "deadline_ms", "expires_ms",
                   "real_time", "eligible", "tasks"});
  Pipeline pipeline;
  pipeline.name = checked_name(node, name);
  if (node.has("rate_hz") == node.has("closed_loop"))
    node.fail("needs one of rate_hz and closed_loop");
  if (node.has("rate_hz")) pipeline.rate_hz = node.at("rate_hz").number(kMinRate, kMaxRate);
  read_arrivals(node, pipeline);
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
  std::vector<FileTask> tasks;
  for (const auto& item : node.at("tasks").items()) {
    tasks.push_back({read_task(item, name, eligible), item});
    resolve_state(item, name, tasks.back().task, mix);
  }
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

/// A pipeline of which a later firing takes an image keeps one buffer for it all the time.
void check_buffers(const YamlNode& document, const Mix& mix) {
  const auto kept = std::ranges::count_if(mix.pipelines, &Pipeline::keeps_image);
  if (!mix.image_buffers || kept == 0 || *mix.image_buffers > kept) return;
  document.at("image_buffers")
      .fail("images that @-1 takes hold " + std::to_string(kept) +
            " of them all the time, so that no firing finds one; at least " +
            std::to_string(kept + 1));
}

}  // namespace

bool Pipeline::keeps_image() const {
  return std::ranges::any_of(
      tasks, [](const MixTask& each) { return each.image_input && each.read_later; });
}

bool Mix::reads_earlier() const {
  return std::ranges::any_of(pipelines, [](const Pipeline& pipeline) {
    return std::ranges::any_of(pipeline.tasks, &MixTask::read_later);
  });
}

bool Pipeline::has_image_input() const { return std::ranges::any_of(tasks, &MixTask::image_input); }

std::vector<std::size_t> Pipeline::waits_for(std::size_t task) const {
  std::vector<std::size_t> before = tasks[task].after;
  for (std::size_t each = task; tasks[task].state && each-- > 0;) {
    if (tasks[each].state != tasks[task].state) continue;
    before.push_back(each);
    break;
  }
  return before;
}

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
    mix.pipelines.push_back(read_pipeline(pipelines.at(name), name, mix));
  }
  if (mix.pipelines.empty()) pipelines.fail("a mix has at least one pipeline");
  check_own_workloads(pipelines, mix);
  check_buffers(document, mix);
  return mix;
}

Mix load_mix(const std::string& name) {
  const auto [file, text] = read_named("mix", name, mix_files::files());
  Mix mix = parse_mix(file, text);
  mix.argument = name;
  return mix;
}

std::vector<std::string> named_workloads(const std::string& name) {
  const auto [file, text] = read_named("mix", name, mix_files::files());
  const YamlNode pipelines = parse_yaml(file, text).at("pipelines");
  std::vector<std::string> named;
  for (const auto& pipeline : pipelines.keys()) {
    for (const auto& task : pipelines.at(pipeline).at("tasks").items()) {
      if (task.has("workload")) named.push_back(task.at("workload").text());
    }
  }
  return named;
}

std::vector<std::string> shipped_mixes() { return names_of(mix_files::files()); }

}  // namespace pirt
