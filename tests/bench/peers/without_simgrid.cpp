#include <cstdio>

#include "tests/bench/peers/comparison.h"

namespace pirt::bench {

bool compare_with_simgrid() {
  std::puts("SimGrid: not installed when this was built (Debian: libsimgrid-dev); not compared");
  return true;
}

}  // namespace pirt::bench
