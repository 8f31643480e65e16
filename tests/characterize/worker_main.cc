// The worker process alone: what `pirt worker` is, for tests of the coordinator that should not
// depend on the command line.
#include <iostream>

#include "characterize/worker/worker.h"

int main() { return pirt::run_worker(std::cin, std::cout); }
