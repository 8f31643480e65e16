#include "workloads/backends/opencl/device/session.h"

#include <fmt/core.h>

#include <algorithm>
#include <memory>
#include <stdexcept>

#include "opencl_files.h"
#include "workloads/backends/opencl/device/kernel_cache.h"
#include "workloads/base/error.h"
#include "workloads/base/text/text.h"

namespace pirt::opencl {
namespace {

/// Of a build log, what fits into one message line.
std::string first_lines(const std::string& log) {
  constexpr std::size_t kLines = 6;
  std::vector<std::string> lines = split(log, '\n');
  std::erase_if(lines, [](const std::string& line) {
    return std::ranges::all_of(line, [](unsigned char c) { return std::isspace(c) || c == '\0'; });
  });
  if (lines.empty()) return "(the driver gave no build log)";
  if (lines.size() > kLines) {
    lines.resize(kLines);
    lines.emplace_back("...");
  }
  return join(lines, " | ");
}

/// The source with the embedded files that it includes in the place of their lines: drivers differ
/// in how they are told of files that are in memory.
std::string with_includes(std::string_view source) {
  constexpr std::string_view kInclude = "#include \"";
  std::string text;
  for (const std::string& line : split(std::string(source), '\n')) {
    if (line.starts_with(kInclude)) {
      const std::string name = line.substr(kInclude.size(), line.rfind('"') - kInclude.size());
      const auto included = find_embedded(opencl_files::files(), name);
      if (!included) throw std::logic_error("no embedded file " + name);
      text += with_includes(*included);
    } else {
      text += line + '\n';
    }
  }
  return text;
}

/// Builds it once a session.
cl::Program build(const DeviceSession& session, std::string_view name, const std::string& source,
                  const std::string& further) {
  // -w: PoCL would print "12 warnings generated." to stderr, all of them about the ABI of wide
  // vectors in functions that are inlined anyway.
  const std::string options = "-cl-std=CL1.2 -w" + further;
  const std::lock_guard lock(session.programs->mutex);
  const auto [entry, is_new] = session.programs->built.try_emplace(options + '\n' + source);
  if (!is_new && entry->second() != nullptr) return entry->second;
  auto made = std::make_unique<cl::Program>(session.context, source, false);
  cl::Program& program = *made;
  try {
    program.build(session.device, options.c_str());
  } catch (const cl::BuildError& error) {
    const std::string complaint = kernel_cache_complaint(platform_of(session.device));
    if (!complaint.empty()) {
      throw_environment(fmt::format("opencl: {} does not build: {}", name, complaint));
    }
    const auto logs = error.getBuildLog();
    throw_environment(fmt::format(
        "opencl: {} does not build on \"{}\" with {} ({}): {}; choose another device or report it",
        name, session.device.getInfo<CL_DEVICE_NAME>(), options, error_name(error.err()),
        first_lines(logs.empty() ? std::string() : logs.front().second)));
  } catch (const cl::Error& error) {
    throw_translated(fmt::format("building {}", name), error);
  } catch (const std::exception& error) {
    // PoCL lets one through with the program's lock taken, so that releasing it would wait for
    // ever.
    static_cast<void>(made.release());
    throw_environment(
        fmt::format("opencl: building {} ends the driver's compiler ({}); is there a limit on "
                    "memory (ulimit -v)?",
                    name, error.what()));
  }
  return entry->second = program;
}

}  // namespace

std::size_t most_items(const cl::Device& device) {
  const auto along = device.getInfo<CL_DEVICE_MAX_WORK_ITEM_SIZES>();
  const auto all = device.getInfo<CL_DEVICE_MAX_WORK_GROUP_SIZE>();
  return along.empty() ? all : std::min(all, along.front());
}

bool is_lost(const DeviceSession& session) {
  try {
    const cl::Buffer word(session.context, CL_MEM_READ_WRITE, sizeof(cl_uint));
    session.queue.enqueueFillBuffer(word, cl_uint{0}, 0, sizeof(cl_uint));
    session.queue.finish();
    return false;
  } catch (const cl::Error& error) {  // One that is full will have room again.
    return error.err() != CL_MEM_OBJECT_ALLOCATION_FAILURE && error.err() != CL_OUT_OF_HOST_MEMORY;
  }
}

cl::Program build_program(const DeviceSession& session, std::string_view name,
                          std::string_view source, const std::string& definitions) {
  return build(session, name, with_includes(source),
               definitions_of(for_vectors(session.tuning, session.lanes), name) + definitions);
}

cl::Program build_own_program(const DeviceSession& session, const std::string& file,
                              const std::string& source, const std::string& options) {
  return build(session, file, source, options + " -cl-kernel-arg-info");
}

}  // namespace pirt::opencl
