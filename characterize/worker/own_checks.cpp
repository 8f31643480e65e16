#include "characterize/worker/own_checks.h"

#include <fmt/core.h>

#include <cstddef>
#include <cstdint>
#include <iterator>

#include "workloads/base/error.h"
#include "workloads/model/own_operation.h"
#include "workloads/model/ranges.h"
#include "workloads/model/slices.h"

namespace pirt {
namespace {

class SliceCount final : public SliceListener {
 public:
  void slice_ended() override { ++count_; }
  [[nodiscard]] std::int64_t count() const { return count_; }

 private:
  std::int64_t count_ = 0;
};

}  // namespace

void check_inputs(const Workload& workload, std::span<const Data> frames) {
  if (own_operation(workload) == nullptr) return;
  for (const Data& data : frames) {
    for (std::size_t i = 0; i < data.inputs.size(); ++i) {
      if (workload.inputs[i].ranges.empty()) continue;
      const std::string why = out_of_range(data.inputs[i], workload.inputs[i]);
      if (!why.empty()) throw_bad_input("the inputs that are made for it: " + why);
    }
  }
}

void note_slices(const Workload& workload, Player& player, std::vector<std::string>& notes) {
  const OwnOperation* const own = own_operation(workload);
  if (own == nullptr || own->slices.empty()) return;
  SliceCount heard;
  {
    const HearsSlices listening(&heard);
    player.complete();
  }
  const auto frames = static_cast<std::int64_t>(player.frames());
  if (heard.count() == frames * (std::ssize(own->slices) - 1)) return;
  notes.push_back(fmt::format("slices: says {} a call and calls between_slices() {} times in {}",
                              own->slices.size(), heard.count(), frames));
}

}  // namespace pirt
