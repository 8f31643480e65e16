// The OpenCL C++ bindings as this folder uses them, and the translation of their errors.
//
// Only files of this folder include it: cl::Error does not leave the folder.
#pragma once

#define CL_HPP_ENABLE_EXCEPTIONS
#define CL_HPP_TARGET_OPENCL_VERSION 120
#define CL_HPP_MINIMUM_OPENCL_VERSION 120
#include <CL/opencl.hpp>
#include <string>
#include <string_view>
#include <utility>

namespace pirt::opencl {

/// What to do where no OpenCL device is found.
inline constexpr std::string_view kInstallDriver =
    "install an OpenCL driver, e.g. apt-get install pocl-opencl-icd";

[[nodiscard]] cl::Platform platform_of(const cl::Device& device);

/// "CL_OUT_OF_RESOURCES", or "error -1234" for a code that OpenCL 1.2 does not name.
[[nodiscard]] std::string error_name(cl_int code);

/// "clCreateBuffer: CL_INVALID_BUFFER_SIZE", with the remedy where the code suggests one.
[[nodiscard]] std::string describe(const cl::Error& error);

[[noreturn]] void throw_translated(std::string_view doing, const cl::Error& error);

/// Runs @p body, which calls OpenCL.
/// @param doing  For the message: "preparing conv1".
/// @throws Error{kEnvironment} "opencl: <doing>: <call>: <name>; <remedy>" in place of cl::Error.
template <typename Body>
decltype(auto) translated(std::string_view doing, Body&& body) {
  try {
    return std::forward<Body>(body)();
  } catch (const cl::Error& error) {
    throw_translated(doing, error);
  }
}

}  // namespace pirt::opencl
