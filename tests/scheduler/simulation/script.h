// What calls do in a simulated run, by its seed: they take their time, throw, give back, hang,
// return late, heed a stop or not; devices go and come back. Each call looks, too, whether others
// write what it reads or has to write.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "tests/scheduler/simulation/world.h"
#include "workloads/model/tensor.h"
#include "workloads/model/workload.h"

namespace pirt::simulated {

/// Of a number, which all tensors of a simulated run are.
inline const TensorSpec kValue{.name = "value", .element = Element::kF64, .shape = {1}};
[[nodiscard]] inline double& value_in(Tensor& tensor) { return tensor.as<double>()[0]; }
[[nodiscard]] inline double value_in(const Tensor& tensor) { return tensor.as<double>()[0]; }
/// What a workload makes of such inputs: a whole number that others would not.
[[nodiscard]] double value_of(std::string_view workload, std::span<const double> inputs);

/// Of one run, while it is there.
class Script {
 public:
  struct Chances {  ///< Of calls; one in so many, 0 = never.
    std::uint64_t throws = 12, refuses = 40, loses_device = 300, hangs = 60, late = 60;
    std::uint64_t fails_to_open = 60;
    Nanos longest{0};          ///< That one takes that does not hang.
    Nanos limit{0};            ///< Beyond which one is late.
    bool devices_hang = true;  ///< Calls of devices have that limit, too.
  };
  Script(World& world, std::uint64_t seed, Chances chances);
  ~Script();
  Script(const Script&) = delete;
  Script& operator=(const Script&) = delete;
  static Script& here();

  [[nodiscard]] World& world() { return world_; }
  /// One in so many; false for 0.
  bool draw(std::uint64_t times) { return times != 0 && random_.below(times) == 0; }
  Nanos draw_time(Nanos longest);
  [[nodiscard]] const Chances& chances() const { return chances_; }

  /// Computes a call, if it comes to that.
  /// @param slices  After which another call may be let in.
  /// @throws What the script says.
  void compute(const Workload& workload, const std::string& unit, std::span<const Tensor> inputs,
               std::span<Tensor> outputs, bool may_hang, int slices);
  /// The call takes its time; where somebody @p wants it no more it may end earlier.
  void spend(Nanos time, bool heeds_stop);
  /// Calls that hang go on from here.
  void release_hung();
  /// Calls that took longer than they may.
  [[nodiscard]] int given_up() const { return given_up_; }

  // The way to what computes elsewhere.
  [[nodiscard]] bool is_away() const;
  /// From now on, for good.
  void lose_the_way();
  [[nodiscard]] std::uint64_t heard() const;

 private:
  void hang();

  World& world_;
  Random random_;
  Chances chances_;
  bool released_ = false;
  int given_up_ = 0;
  Nanos away_from_, away_until_;
  std::map<const void*, int> readers_;  ///< By memory; -1: somebody writes it.
};

}  // namespace pirt::simulated
