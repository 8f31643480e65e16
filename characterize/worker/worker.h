// The body of a worker process: everything that touches a device happens in one of these.
//
// A process of its own because a driver's crash, hang or failing kernel must cost one cell and not
// the run, because affinity is process-wide, and because cold set-up can only be measured in a
// fresh process.
#pragma once

#include <iosfwd>

#include "characterize/worker/injection.h"
#include "characterize/worker/job.h"

namespace pirt {

/// Reads one job (job.h), does it and writes its records.
/// @return 0 if the job was done; otherwise the exit code of the error, which the last record tells
/// as well. Does not throw.
int run_worker(std::istream& job, std::ostream& records);

/// Does a job in this process. Without a reference, kSample verifies nothing.
/// @throws Error as what the job does.
[[nodiscard]] JobResult do_job(const Job& job, const Injection& injection = {});

}  // namespace pirt
