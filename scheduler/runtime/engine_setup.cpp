// Starting a runtime: its workloads, what they cost, and its units.
#include <fmt/core.h>
#include <pthread.h>

#include <algorithm>
#include <limits>
#include <variant>

#include "characterize/platform/elsewhere.h"
#include "characterize/platform/unit_request.h"
#include "characterize/profile/own_rows.h"
#include "scheduler/runtime/engine.h"
#include "scheduler/services/devices.h"
#include "scheduler/services/eligibility.h"
#include "workloads/backends/registry.h"
#include "workloads/base/error.h"
#include "workloads/base/system/thread.h"
#include "workloads/base/text/text.h"
#include "workloads/catalog/catalog.h"
#include "workloads/catalog/own_files.h"
#include "workloads/catalog/own_list.h"
#include "workloads/own/definition.h"
#include "workloads/own/own.h"

namespace pirt {
namespace {

constexpr Nanos kUnknownTime = std::chrono::milliseconds(1);

std::uint64_t next_number() {
  static runtime::Atomic<std::uint64_t> engines = 0;
  return ++engines;
}

int counted_forks() {
  static const int failed = ::pthread_atfork(nullptr, nullptr, [] { ++runtime::forks(); });
  static_cast<void>(failed);
  return runtime::forks();
}

/// A list, a filter's state or a network's numbers are none.
bool is_picture(const TensorSpec& spec) {
  return spec.element == Element::kU8 && !spec.varies &&
         (spec.shape.size() == 2 || spec.shape.size() == 3);
}

/// As set_up_mode has it, which may not be asked yet.
bool suspends_calls(const RuntimeOptions& options) {
  return options.prepare_first && options.slices.value_or(find_policy(options.mode).budgets);
}

/// On the devices of the profile.
RuntimeOptions checked(RuntimeOptions options) {
  options.platform =
      on_devices(std::move(options.platform), options.profile ? &*options.profile : nullptr);
  if (options.most_tasks == 0) throw_bad_input("most_tasks is 0; it is at least 1");
  if (options.spin < Nanos::zero() || options.spin > kMostSpin) {
    throw_bad_input("spin is " + std::to_string(to_us(options.spin)) + " us; it is 0 to " +
                    std::to_string(to_us(kMostSpin)) + " us");
  }
  return options;
}

/// Null: it has none there.
const KernelFunction* own_kernel(const OwnWorkload& own, const UnitModel& unit) {
  for (const std::string& name : {unit.name, unit.backend}) {
    const auto at = own.kernels.find(name);
    if (at != own.kernels.end()) return &at->second;
  }
  return nullptr;
}

}  // namespace

Runtime::Engine::Engine(RuntimeOptions options)
    : number_of_engine_(next_number()),
      forks_(counted_forks()),
      options_(checked(std::move(options))),
      samples_(1),
      room_(options_.most_tasks),
      live_units_(options_.platform,
                  {.prepare_first = options_.prepare_first,
                   .time_limit = options_.time_limit,
                   .priority = options_.priority,
                   .spin = options_.spin,
                   .keeps = own_,
                   .stop = options_.stop,
                   .progress = [this](const std::string& line) { say(line); },
                   .slices = suspends_calls(options_)},
                  *this) {
  const Nanos begin = clock_.now();
  units_.resize(options_.platform.units.size());
  list_workloads();
  mix_ = mix();
  ScheduleOptions schedule;
  schedule.mode = options_.mode;
  schedule.strict = options_.strict;
  schedule.slices = suspends_calls(options_);
  setup_.emplace(set_up_mode(options_.platform, options_.profile ? &*options_.profile : nullptr,
                             mix_, schedule));
  for (const std::string& warning : setup_->scenario.services.warnings) say(warning);
  if (setup_->mode.policy.planner != nullptr) {
    throw_bad_input("mode " + options_.mode +
                    " plans a whole mix ahead, and a runtime does not know what comes; take "
                    "another (pirt list modes)");
  }
  for (std::size_t w = 0; w < workloads_.size(); ++w) {
    Known& known = workloads_[w];
    TaskClass kind = setup_->scenario.classes[w][0];
    known.runs_on &= kind.eligible;
    known.lead = recall_leads(setup_->scenario, w)[0];
    if (known.runs_on == 0) {
      throw_bad_input("no unit of platform " + options_.platform.name + " can run " +
                      known.workload->name + " here");
    }
    for (UnitId unit = 0; unit < units_.size(); ++unit) {
      kind.eligible = known.runs_on & unit_bit(unit);
      kind.real_time = false;
      known.takers |= setup_->policy->takers(kind, kind.eligible);
      kind.real_time = true;
      known.real_time_takers |= setup_->policy->takers(kind, kind.eligible);
    }
    if (setup_->mode.policy.cloud_use == CloudUse::kNotRealTime) {
      known.real_time_takers &= ~cloud_units(options_.platform);
    }
  }
  list_states();
  for (UnitId unit = 0; unit < units_.size(); ++unit) {
    units_[unit].name = options_.platform.units[unit].name;
    units_[unit].slots = setup_->slots[unit].value_or(std::numeric_limits<int>::max());
  }
  dispatcher_.emplace(setup_->slots, std::move(setup_->policy));
  if (options_.trace) {
    writer_ = std::make_unique<TraceWriter>(
        *options_.trace, setup_->scenario,
        DispatcherSetup{&setup_->mode.policy, options_.platform.unit_names(), setup_->slots,
                        setup_->policy_setup},
        "live");
    trace_ = std::make_unique<TraceThread>(*writer_, live_units_.cores());
    dispatcher_->observe(&*trace_);
  }
  take_first_inputs();
  open_units();
  now_ = now();
  live_units_.look_for_reach();  // Before the first task: nothing is given to what is out of reach.
  starting_ = false;
  set_up_ = clock_.now() - begin;
  watcher_ = runtime::start_thread([this](const std::stop_token& stop) { watch(stop); });
  if (anything_to_tell_) wake_watcher();
}

/// Of the rows that a workload of the caller's takes: those of its size, where pictures have one.
std::string Runtime::Engine::name_of_rows(const Workload& made) const {
  const Workload* const named = try_find_workload(made.name);
  const std::string plain = own::plain_name(made.name);
  const Workload* const base = try_find_workload(plain);  // "sobel" of "sobel@map"
  const bool same = named == nullptr || base == nullptr || !base->at_size ||
                    (named->inputs == made.inputs && named->outputs == made.outputs);
  if (same || made.inputs.empty() || made.inputs.front().shape.size() < 2) return made.name;
  const auto& shape = made.inputs.front().shape;
  const std::string name = fmt::format("{}@{}x{}{}", plain, shape.back(), shape.end()[-2],
                                       made.variant.empty() ? "" : "@" + made.variant);
  const auto has_rows = std::ranges::any_of(
      options_.profile->phases, [&name](const PhaseRow& row) { return row.workload == name; });
  if (has_rows) return name;
  throw_bad_input(fmt::format(
      "profile {} has no rows of {} in this size, and those of another do not tell its time; "
      "measure it: {}",
      options_.profile->path, plain,
      measure_command(options_.platform, "", {name}, options_.profile->path)));
}

/// Before anything is listed, so that others of the options may name what a file has, too.
void Runtime::Engine::load_files() {
  own::NamesOfFiles of_files;
  for (ServedWorkload& served : options_.workloads) {
    auto* const file = std::get_if<WorkloadFile>(&served);
    if (file == nullptr) continue;
    std::vector<std::string> names;
    const auto loaded = load_workloads(file->path);
    for (const own::Definition& each : loaded) names.push_back(each.name);
    of_files.add(loaded.front().source, {names.begin(), names.end()});
    if (options_.profile) {
      const std::string changed =
          doubt_changed(*options_.profile, {names.begin(), names.end()}, loaded.front().digest);
      if (!changed.empty()) say(own::not_as_measured(file->path, changed));
    }
    for (const std::string& name : file->workloads) {
      if (std::ranges::find(names, own::plain_name(name)) != names.end()) continue;
      throw_bad_input(file->path + " has no workload '" + name + "'" + suggestion(name, names));
    }
    if (file->workloads.empty()) file->workloads = std::move(names);
  }
}

void Runtime::Engine::list_workload(const Workload& workload, const OwnWorkload* own,
                                    const std::string& name) {
  if (!names_.emplace(name, workloads_.size()).second) {
    throw_bad_input("workload '" + name + "' is given twice");
  }
  check_code_is_here(workload);
  workloads_.push_back({.workload = &workload,
                        .own = own,
                        .takes_image = std::ranges::any_of(workload.inputs, is_picture)});
  workloads_.back().runs_on = units_of(workloads_.back());
}

void Runtime::Engine::list_workload(Workload& made) {
  if (options_.profile && !try_find_spec(made.name)) {
    throw_bad_input("workload '" + made.name +
                    "' is none of the catalogue's, so that the profile has no rows of it; give it "
                    "the name of the one whose rows it shall have");
  }
  const std::string name = made.name;
  if (options_.profile) made.name = name_of_rows(made);
  list_workload(own_->emplace_back(std::move(made)), nullptr, name);
}

void Runtime::Engine::list_workload(const OwnWorkload& own) {
  if (own.kernels.empty()) throw_bad_input("workload '" + own.name + "' has no kernel");
  Workload& workload = own_->emplace_back(own.known_as != nullptr ? *own.known_as : Workload{});
  workload.name = own.name;
  workload.inputs = own.inputs;
  workload.outputs = own.outputs;
  list_workload(workload, &own, own.name);
}

void Runtime::Engine::list_workloads() {
  load_files();
  const auto by_name = [this](const std::string& name) {
    list_workload(find_workload(name), nullptr, name);
  };
  for (ServedWorkload& served : options_.workloads) {
    if (const auto* const name = std::get_if<std::string>(&served)) by_name(*name);
    if (const auto* const file = std::get_if<WorkloadFile>(&served)) {
      std::ranges::for_each(file->workloads, by_name);
    }
    if (auto* const made = std::get_if<Workload>(&served)) list_workload(*made);
    if (const auto* const own = std::get_if<OwnWorkload>(&served)) list_workload(*own);
  }
  if (workloads_.empty()) throw_bad_input("a runtime needs workloads: name them in its options");
}

void Runtime::Engine::list_states() {
  std::vector<const Workload*> first;
  for (Known& known : workloads_) {
    const auto& spec = known.workload->state;
    if (!spec) continue;
    const auto [place, is_new] =
        state_names_.emplace(spec->name, static_cast<StateId>(state_names_.size()));
    if (is_new) {
      first.push_back(known.workload);
      live_units_.add_state(*known.workload);
    } else if (*first[place->second]->state != *spec) {
      throw_bad_input("workloads " + first[place->second]->name + " and " + known.workload->name +
                      " have other tensors in the state '" + spec->name + "' that they share");
    }
    known.state = place->second;
  }
}

Support Runtime::Engine::support(const Known& known, const UnitModel& unit) const {
  if (known.own != nullptr) {
    if (own_kernel(*known.own, unit) != nullptr) return {true, ""};
    if (known.own->known_as == nullptr) return {false, "no kernel was given for it"};
  }
  if (!unit.measured()) return {false, "it has no backend"};
  return find_backend(unit.backend)
      .supports_on(make_unit_request(options_.platform, unit), *known.workload);
}

/// Those that have a kernel for it.
UnitMask Runtime::Engine::units_of(const Known& known) const {
  UnitMask mask = 0;
  std::vector<std::string> reasons;
  for (UnitId unit = 0; unit < options_.platform.units.size(); ++unit) {
    const UnitModel& model = options_.platform.units[unit];
    const Support here = support(known, model);
    if (here.ok) {
      mask |= unit_bit(unit);
    } else {
      reasons.push_back(model.name + ": " + here.reason);
    }
  }
  if (mask != 0) return mask;
  throw_bad_input("no unit of platform " + options_.platform.name + " can run " +
                  known.workload->name + " (" + join(reasons, "; ") + ")");
}

/// Of each workload a pipeline of one task, for whoever asks what it costs and who may serve it.
Mix Runtime::Engine::mix() const {
  Mix mix;
  mix.name = "runtime";
  for (const Known& known : workloads_) {
    MixTask task;
    task.name = task.workload = known.workload->name;
    task.service_location = "runtime: " + task.name;
    for (UnitId unit = 0; unit < units_.size(); ++unit) {
      const std::string& name = options_.platform.units[unit].name;
      if (!contains(known.runs_on, unit)) continue;
      if (known.own == nullptr && options_.profile) continue;
      const bool said = known.own != nullptr && known.own->expected.contains(name);
      task.service[name] = said ? known.own->expected.at(name) : kUnknownTime;
    }
    Pipeline pipeline;
    pipeline.name = task.name;
    pipeline.frames = 1;
    pipeline.real_time = false;  // Some task may not be.
    pipeline.tasks.push_back(std::move(task));
    mix.pipelines.push_back(std::move(pipeline));
  }
  return mix;
}

std::vector<Preparation> Runtime::Engine::preparations(UnitId unit) {
  const UnitModel& model = options_.platform.units[unit];
  std::vector<Preparation> preparations;
  for (const Known& known : workloads_) {
    if (!contains(known.runs_on, unit)) continue;
    Preparation& each = preparations.emplace_back();
    each.workload = known.workload;
    const auto* const own = known.own != nullptr ? own_kernel(*known.own, model) : nullptr;
    if (own == nullptr) {
      each.sample = samples_.of(*known.workload, 0);
    } else {  // There, even if the robot's is not: then each call fails.
      each.function = [function = *own](auto inputs, auto outputs) { function(inputs, outputs); };
    }
  }
  return preparations;
}

void Runtime::Engine::take_first_inputs() {
  for (const auto& [name, inputs] : options_.first_inputs) {
    const Known& known = workloads_[find(name).index_];
    if (known.own != nullptr) {
      throw_bad_input("first_inputs: '" + name +
                      "' is a function of your own, which is not called before it is needed");
    }
    check_inputs(*known.workload, {inputs->begin(), inputs->end()});
    samples_.begin_with(*known.workload, *inputs);
  }
}

/// Of own functions that say nothing of what they take.
void Runtime::Engine::tell_limits() {
  if (options_.time_limit) return;
  for (const Known& known : workloads_) {
    for (UnitId unit = 0; unit < units_.size() && known.own != nullptr; ++unit) {
      const UnitModel& model = options_.platform.units[unit];
      const bool said = known.own->expected.contains(model.name);
      if (!contains(known.runs_on, unit) || said || is_elsewhere(model)) continue;
      say(known.own->name + " on " + model.name +
          " does not say what it is expected to take: a call that has not ended after " +
          std::to_string(kUnknownTimeLimit / std::chrono::seconds(1)) +
          " s is taken for one that hangs");
    }
  }
}

void Runtime::Engine::open_units() {
  tell_limits();
  live_units_.open();
  for (UnitId unit = 0; unit < units_.size(); ++unit) {
    if (!live_units_.has(unit)) continue;
    with_room_ |= unit_bit(unit);
    if (!live_units_.at(unit).is_remote()) continue;
    elsewhere_.push_back(unit);
    ask_for_all(unit, false);  // The unit has said it.
  }
}

/// From the unit's thread, which waits for the answer.
void Runtime::Engine::slice_ended(UnitId, Call& call) {
  Submitted& task = task_at(call.token);
  task.call_end.at = now();
  post(ended_calls_, task, Submitted::Event::kSliceEnded);
  work(Thread::kOurs);
}

/// From the unit's thread.
void Runtime::Engine::ended(UnitId, Call& call, CallEnd& end) {
  Submitted& task = task_at(call.token);
  task.call_end = std::move(end);
  task.call_end.at -= began_;
  post(ended_calls_, task, Submitted::Event::kEnd);
  work(Thread::kOurs);
}

}  // namespace pirt
