#include "tests/scheduler/simulation/script.h"

#include <algorithm>
#include <stdexcept>
#include <vector>

#include "scheduler/runtime/runtime.h"
#include "workloads/base/error.h"
#include "workloads/model/slices.h"

namespace pirt::simulated {
namespace {

Script* script_here = nullptr;

/// While a call is under way nobody else writes what it reads, and nobody reads what it writes.
class Access {
 public:
  Access(World& world, std::map<const void*, int>& readers, std::span<const Tensor> inputs,
         std::span<Tensor> outputs)
      : readers_(readers) {
    for (const Tensor& each : inputs) {
      int& count = readers_[each.data()];
      if (count < 0) world.fail("a call reads what another one writes");
      ++count;
      read_.push_back(each.data());
    }
    for (Tensor& each : outputs) {
      int& count = readers_[each.data()];
      if (count != 0) world.fail("a call writes what another one reads or writes");
      count = -1;
      written_.push_back(each.data());
    }
  }
  ~Access() {
    for (const void* each : read_) --readers_[each];
    for (const void* each : written_) readers_[each] = 0;
  }
  Access(const Access&) = delete;
  Access& operator=(const Access&) = delete;

 private:
  std::map<const void*, int>& readers_;
  std::vector<const void*> read_, written_;
};

std::vector<double> values(std::span<const Tensor> tensors) {
  std::vector<double> all;
  for (const Tensor& each : tensors) all.push_back(value_in(each));
  return all;
}

}  // namespace

double value_of(std::string_view workload, std::span<const double> inputs) {
  std::uint64_t hash = derive_seed(7, workload);
  for (const double each : inputs) hash = hash_u64(hash, static_cast<std::uint64_t>(each));
  return static_cast<double>(hash >> 32U);
}

Script::Script(World& world, std::uint64_t seed, Chances chances)
    : world_(world),
      random_(derive_seed(seed, "calls")),
      chances_(chances),
      away_from_(world.now() + draw_time(std::chrono::milliseconds(20))),
      away_until_(away_from_ + draw_time(std::chrono::milliseconds(20))) {
  script_here = this;
}

Script::~Script() { script_here = nullptr; }

Script& Script::here() { return *script_here; }

/// Many are short, whatever the longest is.
Nanos Script::draw_time(Nanos longest) {
  const auto shrink = random_.below(4);
  const auto most = static_cast<std::uint64_t>(longest.count()) >> (4 * shrink);
  return Nanos(static_cast<std::int64_t>(random_.below(most + 1)));
}

void Script::spend(Nanos time, bool heeds_stop) {
  const Nanos until = world_.now() + time;
  const auto stop = stop_of_this_call();
  while (world_.now() < until) {
    if (heeds_stop && stop.stop_requested()) return;
    world_.sleep_until(heeds_stop ? std::min(until, world_.now() + time / 4 + Nanos(1)) : until);
  }
}

void Script::hang() {
  ++given_up_;
  world_.note("a call hangs");
  while (!released_) world_.wait(&released_);
}

void Script::release_hung() {
  released_ = true;
  world_.wake(&released_, INT32_MAX);
}

bool Script::is_away() const { return world_.now() >= away_from_ && world_.now() < away_until_; }

void Script::lose_the_way() {
  away_from_ = std::min(away_from_, world_.now());
  away_until_ = Nanos::max();
}

std::uint64_t Script::heard() const {
  return world_.now() < away_from_ ? 1 : world_.now() < away_until_ ? 2 : 3;
}

void Script::compute(const Workload& workload, const std::string& unit,
                     std::span<const Tensor> inputs, std::span<Tensor> outputs, bool may_hang,
                     int slices) {
  if (inputs.size() != workload.inputs.size()) {
    world_.fail(workload.name + " was given " + std::to_string(inputs.size()) + " inputs");
  }
  const Access access(world_, readers_, inputs, outputs);
  const auto given = values(inputs);
  constexpr double kMine = -1;
  for (Tensor& each : outputs) value_in(each) = kMine;
  world_.note(workload.name + " begins on " + unit);
  const bool heeds_stop = draw(2);
  for (int slice = 0; slice <= slices; ++slice) {
    if (slice > 0) between_slices();
    const bool late = may_hang && draw(chances_.late);
    if (late) ++given_up_;
    spend(late ? chances_.limit + draw_time(chances_.limit) : draw_time(chances_.longest),
          heeds_stop);
    if (may_hang && draw(chances_.hangs)) hang();
  }
  if (draw(chances_.refuses)) throw_environment("the device cannot");
  if (draw(chances_.throws)) {
    if (draw(4)) throw 1;  // NOLINT: anything may be thrown.
    throw std::runtime_error("on purpose");
  }
  if (values(inputs) != given) world_.fail("what a call read has changed under it");
  for (Tensor& each : outputs) {
    if (value_in(each) != kMine) world_.fail("what a call writes, somebody else has written");
    value_in(each) = value_of(workload.name, given);
  }
}

}  // namespace pirt::simulated
