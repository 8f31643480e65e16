#include "tests/bench/peers/kernels.h"

namespace pirt::bench {

std::optional<Call> clblast_convolution(const Workload&, const Data&) { return std::nullopt; }

}  // namespace pirt::bench
