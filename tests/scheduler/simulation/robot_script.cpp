// A robot's program on a simulated Runtime.
#include <fmt/format.h>

#include <array>
#include <deque>
#include <memory>
#include <set>
#include <stdexcept>
#include <vector>

#include "scheduler/runtime/runtime.h"
#include "scheduler/runtime/threads.h"
#include "tests/scheduler/simulation/script.h"
#include "tests/scheduler/simulation/scripted_units.h"
#include "tests/scheduler/simulation/simulation.h"
#include "workloads/base/error.h"

namespace pirt::simulated {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr std::array kModes = {"olb",     "ect",        "edf",    "met",
                               "latency", "throughput", "energy", "advanced"};

struct OwnKind {
  const char* name;
  int inputs;
  int slices;
};
constexpr std::array<OwnKind, 4> kOwn = {
    {{"add", 2, 0}, {"long", 1, 4}, {"work", 1, 2}, {"go", 0, 0}}};
constexpr const char* kCounter = "counter";
constexpr const char* kOther = "other_counter";  // Of the same state.

/// A task that was submitted, as long as the run.
struct Entry {
  std::string workload;
  TaskFuture future;            ///< Until it is let go of.
  std::optional<double> value;  ///< That it has to have; absent = by a state.
  std::optional<TaskEnd> told;
  std::optional<double> had;  ///< As a callback read it.
};

class Robot {
 public:
  Robot(World& world, const Seed& seed)
      : world_(world),
        seed_(seed),
        random_(derive_seed(seed.number, "robot")),
        script_(world, seed.number, chances()),
        trace_(seed.folder / "robot.json") {}

  int play() {
    std::filesystem::remove(trace_);
    world_.explain_by([this] {
      std::string all = "have not ended:";
      for (std::size_t i = 0; i < entries_.size(); ++i) {
        if (!entries_[i].told) all += fmt::format(" {} (task {})", entries_[i].workload, i);
      }
      return all;
    });
    auto options = make_options();
    if (random_.below(40) == 0) {
      world_.refuse_threads(static_cast<int>(random_.below(8)),
                            1 + static_cast<int>(random_.below(2)));
    }
    const bool has_trace = options.trace.has_value();
    starts([&] { runtime_ = &owned_.emplace(std::move(options)); });
    world_.refuse_threads(0, 0);
    if (runtime_ == nullptr) {
      script_.release_hung();
      return 0;
    }
    {
      std::vector<runtime::Thread> clients;
      const auto others = random_.below(3);
      for (std::uint64_t i = 1; i <= others; ++i) {
        clients.push_back(runtime::start_thread([this, i] { client(i); }));
      }
      client(0);
    }
    end(has_trace);
    return actions_;
  }

 private:
  Script::Chances chances() {
    Script::Chances chances;
    chances.longest = milliseconds(1 + random_.below(5));
    const auto hostility = random_.below(5);
    if (hostility == 0) chances.hangs = chances.late = chances.refuses = chances.throws = 0;
    if (hostility == 1) chances.hangs = chances.late = 12;
    if (hostility == 2) chances.hangs = 6;
    if (random_.below(2) == 0) limit_ = 4 * chances.longest;
    chances.devices_hang = limit_.has_value();
    chances.limit = limit_.value_or(seconds(10));
    return chances;
  }

  RuntimeOptions make_options() {
    RuntimeOptions options;
    options.platform = parse_platform("platform.yaml", platform(), {}, 1);
    options.mode = kModes[random_.below(kModes.size())];
    options.time_limit = limit_;
    for (const OwnKind& kind : kOwn) {
      own_.push_back(make_scripted(kind.name, kind.inputs));
      OwnWorkload own{.name = kind.name,
                      .inputs = own_.back().inputs,
                      .outputs = own_.back().outputs,
                      .kernels = {}};
      for (const UnitModel& unit : options.platform.units) {
        if (unit.role == Role::kCloud && random_.below(2) == 0) continue;
        // One elsewhere is withdrawn, and waited for.
        const bool may_hang = unit.role != Role::kCloud;
        own.kernels[unit.name] = [this, &kind, &workload = own_.back(), name = unit.name, may_hang](
                                     std::span<const Tensor> in, std::span<Tensor> out) {
          if (script_.draw(20)) submit_within();
          script_.compute(workload, name, in, out, may_hang, kind.slices);
        };
        if (random_.below(2) == 0) own.expected[unit.name] = milliseconds(1);
      }
      options.workloads.emplace_back(std::move(own));
    }
    for (const char* name : {kCounter, kOther}) {
      options.workloads.emplace_back(make_scripted(name, 1, "count"));
    }
    options.prepare_first = random_.below(4) != 0;
    if (random_.below(2) == 0) options.slices = true;
    if (random_.below(3) == 0) options.most_tasks = 1 + random_.below(6);
    options.spin = random_.below(4) == 0 ? Nanos(200) : Nanos(0);
    if (random_.below(2) == 0) options.trace = trace_.string();
    if (random_.below(2) == 0) {
      options.problem = [this](const std::string& problem) {
        world_.note(problem);
        if (script_.draw(5)) throw std::runtime_error("on purpose");
      };
    }
    return options;
  }

  std::string platform() {
    const auto slots = [this] { return 1 + random_.below(3); };
    std::string text = "platform: board\nunits:\n";
    text += fmt::format("  cpu: {{backend: cpu, cores: all, slots: {}, active_w: 1}}\n", slots());
    if (random_.below(2) == 0) {
      text += fmt::format("  gpu: {{backend: cpu, cores: all, slots: {}, active_w: 2}}\n", slots());
    }
    if (random_.below(3) == 0) {
      text += "  dsp: {backend: fake, contexts: {prepare_ms: 1}, active_w: 1}\n";
    }
    if (random_.below(3) == 0) {
      text += fmt::format("  cloud: {{backend: fake, role: cloud, servers: {}, active_w: 1}}\n",
                          slots());
    }
    return text;
  }

  /// Opens units, which may fail, and so may the first call of what is prepared.
  template <typename Body>
  void starts(const Body& body) {
    try {
      body();
    } catch (const Error& error) {
      if (error.code() != ErrorCode::kEnvironment) throw;
      world_.note(error.what());
    } catch (const std::runtime_error& error) {
      world_.note(error.what());
    } catch (int) {
      world_.note("a number was thrown");
    }
  }

  // What clients do.

  void client(std::uint64_t number) {
    Random random(derive_seed(seed_.number, fmt::format("client {}", number)));
    const auto most = 2 + random.below(24);
    for (std::uint64_t i = 0; i < most && actions_ < seed_.most_actions; ++i) {
      ++actions_;
      act(random, number == 0);
    }
  }

  void act(Random& random, bool first) {
    const auto what = random.below(32);
    if (what < 18) {
      const TaskFuture future = future_of(submit(random));
      // With nothing else that could bring it on.
      if (future.valid() && random.below(3) == 0) static_cast<void>(future.wait());
    } else if (what < 20) {
      cancel(any(random));
    } else if (what < 22) {
      if (const Entry* entry = any(random)) {
        const TaskFuture future = future_of(*entry);
        if (future.valid()) {
          static_cast<void>(future.wait_for(script_.draw_time(milliseconds(2))));
        }
      }
    } else if (what < 24) {
      read(any(random));
    } else if (what < 26) {
      if (Entry* const entry = any(random)) {
        TaskFuture gone;
        const std::lock_guard lock(futures_);
        std::swap(gone, entry->future);
      }
    } else if (what < 28) {
      balance();
    } else if (what < 29) {
      sleep_for(script_.draw_time(milliseconds(4)));
    } else if (what < 30 && first) {
      if (random.below(3) == 0) {
        world_.note("cancel all");
        runtime_->cancel_all();
      } else {
        runtime_->wait_all();
      }
    } else if (random.below(3) == 0) {
      static_cast<void>(runtime_->state("count"));
    } else {
      bring_back();
    }
  }

  TaskInput input(Random& random, std::optional<double>& of_inputs, std::vector<double>& values) {
    if (random.below(2) == 0) {
      for (int tries = 0; tries < 3; ++tries) {
        const Entry* const before = any(random);
        if (before == nullptr) break;
        const TaskFuture future = future_of(*before);
        if (!future.valid()) continue;
        if (before->value) values.push_back(*before->value);
        if (!before->value) of_inputs.reset();
        return future.output(0);
      }
    }
    const auto value = static_cast<double>(random.below(1000));
    values.push_back(value);
    return fresh(value);
  }

  /// An input whose end is seen.
  Tensor fresh(double value) {
    auto memory = std::make_unique<Buffer>();
    memory->value = value;
    ++inputs_;
    Buffer* const at = memory.release();
    return Tensor::over(kValue, reinterpret_cast<const std::byte*>(&at->value), [this, at] {
      --inputs_;
      delete at;  // NOLINT(cppcoreguidelines-owning-memory)
    });
  }

  const Entry& submit(Random& random) {
    const auto which = random.below(kOwn.size() + 2);
    const bool own = which < kOwn.size();
    const std::string workload = own ? kOwn[which].name : which == kOwn.size() ? kCounter : kOther;
    std::optional<double> value = 0;
    std::vector<double> values;
    std::vector<TaskInput> inputs;
    const int count = own ? kOwn[which].inputs : 1;
    for (int i = 0; i < count; ++i) inputs.push_back(input(random, value, values));
    TaskOptions options;
    options.real_time = random.below(2) == 0;
    if (random.below(3) == 0) options.image_input = random.below(2) == 0;
    if (random.below(2) == 0) options.deadline = draw(random, milliseconds(20));
    if (random.below(12) == 0) options.expires = draw(random, milliseconds(10));
    if (random.below(6) == 0) {
      if (const Entry* const before = any(random)) options.after.push_back(future_of(*before));
    }
    if (random.below(8) == 0) options.eligible = {"cpu"};
    Entry& entry = entries_.emplace_back();
    entry.workload = workload;
    if (own && value) entry.value = value_of(workload, values);
    submit(entry, std::move(inputs), std::move(options));
    return entry;
  }

  static Nanos draw(Random& random, Nanos most) {
    return Nanos(static_cast<std::int64_t>(random.below(static_cast<std::uint64_t>(most.count()))));
  }

  void submit(Entry& entry, std::vector<TaskInput> inputs, TaskOptions options) {
    const auto number = entries_.size() - 1;
    try {
      TaskFuture future = runtime_->submit(
          entry.workload, std::move(inputs), std::move(options),
          [this, &entry](const TaskFuture& task, TaskEnd end) { told(entry, task, end); });
      ++submitted_;
      world_.note(fmt::format("submitted {}, task {}", entry.workload, number));
      const std::lock_guard lock(futures_);
      entry.future = std::move(future);
    } catch (const Error& error) {
      // It ends; or none of the units may serve it.
      entry.told = TaskEnd::kCancelled;
      world_.note(error.what());
      ++refused_;
    }
  }

  /// From a callback, or a kernel.
  void submit_within() {
    if (seed_.most_actions <= actions_) return;
    Entry& entry = entries_.emplace_back();
    entry.workload = "go";
    entry.value = value_of("go", {});
    TaskOptions options;
    if (ends_ && script_.draw(2)) options.eligible = {"cloud"};
    submit(entry, {}, std::move(options));
  }

  void told(Entry& entry, const TaskFuture& task, TaskEnd end) {
    if (entry.told) world_.fail("a task of " + entry.workload + " is told twice");
    entry.told = end;
    if (task.end() != end) world_.fail("a future says otherwise than its callback");
    world_.note(entry.workload + " " + std::string(to_string(end)) + " " + task.problem());
    if (end == TaskEnd::kCompleted) {
      entry.had = value_in(task.get()[0]);
      expect_value(entry, *entry.had);
    } else if (end != TaskEnd::kExpired && end != TaskEnd::kCancelled && task.problem().empty()) {
      world_.fail("nobody says why a task of " + entry.workload + " was " +
                  std::string(to_string(end)));
    }
    if (script_.draw(ends_ ? 2 : 8)) submit_within();
    if (script_.draw(16)) cancel(any(random_));
    if (script_.draw(16)) throw std::runtime_error("on purpose");
  }

  void expect_value(const Entry& entry, double value) {
    if (entry.value && *entry.value != value) {
      world_.fail(fmt::format("{} has {}, not {}", entry.workload, value, *entry.value));
    }
    if (entry.had && *entry.had != value) {
      world_.fail(fmt::format("{} had {}, and then {}", entry.workload, *entry.had, value));
    }
  }

  void read(const Entry* entry) {
    if (entry == nullptr) return;
    const TaskFuture future = future_of(*entry);
    if (!future.valid() || future.end() != TaskEnd::kCompleted) return;
    expect_value(*entry, value_in(future.get()[0]));
  }

  /// One of which a future is there; null if there is none.
  Entry* any(Random& random) {
    if (entries_.empty()) return nullptr;
    for (int tries = 0; tries < 4; ++tries) {
      Entry& entry = entries_[random.below(entries_.size())];
      if (entry.future.valid()) return &entry;
    }
    return nullptr;
  }

  /// Others may let go of it meanwhile.
  TaskFuture future_of(const Entry& entry) {
    const std::lock_guard lock(futures_);
    return entry.future;
  }

  void cancel(const Entry* entry) {
    if (entry == nullptr) return;
    const TaskFuture future = future_of(*entry);
    if (future.valid()) runtime_->cancel(future);
  }

  RuntimeStatistics balance() {
    RuntimeStatistics now = runtime_->statistics();
    if (now.submitted !=
            now.completed + now.failed + now.dropped + now.expired + now.cancelled + now.live ||
        now.live < 0) {
      world_.fail("statistics do not balance");
    }
    return now;
  }

  void bring_back() {
    for (const auto& unit : balance().units) {
      if (unit.in_service) continue;
      starts([&] { runtime_->bring_back(unit.name); });
    }
  }

  // The end.

  void end(bool has_trace) {
    const auto how = random_.below(8);
    bool complete = false, full = false;
    if (how > 1) {
      runtime_->wait_all();
      // What callbacks submit meanwhile is waited for, too.
      if (how > 4) compare_statistics();
      if (has_trace && how > 2) {
        std::optional<FullDisk> disk;
        if (how == 3) disk.emplace();
        try {
          runtime_->write_trace();
          complete = true;
        } catch (const Error& error) {
          if (!disk) throw;
          full = true;
          world_.note(error.what());
        }
      }
      if (!full && how > 4) expect_state();
    }
    std::vector<TaskFuture> outlive;
    for (std::size_t i = 0; i < entries_.size(); ++i) {  // A callback may submit meanwhile.
      const TaskFuture& future = entries_[i].future;
      if (future.valid() && random_.below(2) == 0) outlive.push_back(future);
    }
    world_.note("the runtime ends");
    if (how <= 1) {  // What only the cloud may serve is cancelled, also if it is submitted now.
      script_.lose_the_way();
      ends_ = true;
    }
    owned_.reset();
    for (const TaskFuture& each : outlive) {
      if (!each.end()) world_.fail("a task has no end, and its runtime has ended");
      static_cast<void>(each.wait());
    }
    for (const Entry& entry : entries_) {
      if (!entry.told) world_.fail("a task of " + entry.workload + " was never told of");
      if (entry.future.valid()) read(&entry);
    }
    outlive.clear();
    script_.release_hung();
    for (Entry& entry : entries_) entry.future = {};
    // What was given up keeps what it has.
    if (script_.given_up() == 0 && !limit_ && inputs_ != 0) {
      world_.fail(fmt::format("{} inputs are left behind", inputs_));
    }
    if (has_trace) expect_replay(world_, trace_, complete);
  }

  void compare_statistics() {
    const RuntimeStatistics last = balance();
    if (last.live != 0) return;  // A callback has submitted since.
    std::int64_t completed = 0, by_unit = 0, ended = 0;
    for (const Entry& entry : entries_) {
      if (!entry.told) continue;
      ++ended;
      completed += entry.told == TaskEnd::kCompleted ? 1 : 0;
    }
    for (const auto& unit : last.units) {
      by_unit += unit.completed;
    }
    if (last.completed != completed || by_unit != completed || last.submitted != submitted_ ||
        ended - refused_ != submitted_) {
      world_.fail(fmt::format(
          "statistics: {} of {} completed, {} by units; told: {} of {}, of {} submitted",
          last.completed, last.submitted, by_unit, completed, ended - refused_, submitted_));
    }
  }

  /// Each that completed has counted one on, in turn.
  void expect_state() {
    std::set<double> seen;
    double completed = 0;
    const double state = value_in(runtime_->state("count")[0]);
    for (const Entry& entry : entries_) {
      if (entry.workload != kCounter && entry.workload != kOther) continue;
      if (entry.told != TaskEnd::kCompleted) continue;
      ++completed;
      if (!seen.insert(*entry.had).second || *entry.had >= state) {
        world_.fail("two tasks had the same state");
      }
    }
    if (state != completed) {
      world_.fail(fmt::format("{} tasks completed, and their state says {}", completed, state));
    }
  }

  struct alignas(Tensor::kAlignment) Buffer {
    double value = 0;
    std::array<double, 7> rest = {};
  };

  World& world_;
  const Seed& seed_;
  Random random_;
  std::optional<Nanos> limit_;
  Script script_;
  std::filesystem::path trace_;
  std::deque<Workload> own_;
  std::deque<Entry> entries_;
  runtime::Mutex futures_;  ///< Of these.
  std::int64_t inputs_ = 0, submitted_ = 0, refused_ = 0;
  int actions_ = 0;
  bool ends_ = false;  ///< While the cloud is out of reach.
  std::optional<Runtime> owned_;
  Runtime* runtime_ = nullptr;  ///< Used by callbacks until it has ended.
};

}  // namespace

int play_robot(World& world, const Seed& seed) {
  // Calls that were given up use it after the runtime's end.
  const auto robot = std::make_shared<Robot>(world, seed);
  int actions = 0;
  world.run([&] { actions = robot->play(); });
  return actions;
}

}  // namespace pirt::simulated
