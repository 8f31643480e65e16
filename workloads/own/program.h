// A program as a kernel: started once, asked by lines of JSON, given tensors by shared memory.
//
// Its standard input gets, a line each (README.md of this folder has an example in Python):
//   {"pirt": 1, "workload": NAME, "threads": N, "memory": PATH, "bytes": N, "tensors": [
//     {"name": "image", "role": "input", "dtype": "u8", "shape": [480, 640], "offset": 0}, ...]}
//   {"null": 1}                                        to be answered at once
//   {"call": 2} or {"call": 2, "rows": {"points": 12}} the inputs are in the memory
// and it answers on standard output, a line each: {"ready": true}, {"done": N}, with "rows" for
// outputs that vary, or {"error": TEXT}. Its standard error is pirt's. It ends when its standard
// input does.
#pragma once

#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "workloads/base/time.h"
#include "workloads/model/backend.h"

namespace pirt::own {

struct Program {
  std::string workload;                 ///< For messages, and the program's to know.
  std::vector<std::string> command;     ///< Its words; the first is looked for in PATH.
  std::filesystem::path folder;         ///< That it runs in.
  Nanos start_limit{0}, call_limit{0};  ///< Beyond which it is killed.
  std::vector<TensorSpec> inputs = {}, parameters = {}, outputs = {};
};

/// Starts it, and times what a call that does nothing takes (Kernel::remarks). A call during which
/// it ends or is over its time fails, and the next one starts it anew; so does one that is stopped,
/// which ends it. One that it answers with an error throws CallFailed.
/// @throws Error{kEnvironment} if it does not get ready.
[[nodiscard]] std::unique_ptr<Kernel> make_program_kernel(const Program& program,
                                                          std::span<const Tensor> parameters,
                                                          int threads);

}  // namespace pirt::own
