#include "characterize/machine/inherited.h"

#include <fmt/format.h>
#include <sched.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/statvfs.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <string_view>
#include <utility>
#include <vector>

#include "characterize/machine/system_files.h"
#include "workloads/base/hash.h"
#include "workloads/base/text/text.h"

namespace pirt {
namespace {

/// Of loader and C library, allocators, OpenMP runtimes, libraries, drivers, sanitizers.
constexpr std::array kObeyed = {
    "LD_PRELOAD", "LD_AUDIT", "LD_BIND_",   "GLIBC_TUNABLES", "MALLOC_",  "TCMALLOC_", "JEMALLOC_",
    "MIMALLOC_",  "HUGETLB_", "OMP_",       "GOMP_",          "KMP_",     "LIBOMP",    "ACC_",
    "TBB_",       "ONEDNN_",  "DNNL_",      "OPENBLAS_",      "GOTO_",    "BLIS_",     "MKL_",
    "OPENCV_",    "EIGEN_",   "FFTW_",      "ARM_COMPUTE_",   "ACL_",     "XNNPACK_",  "POCL_",
    "OCL_",       "OPENCL_",  "CL_CONFIG_", "CUDA_",          "NVIDIA_",  "GPU_",      "HSA_",
    "HIP_",       "ROCR_",    "ROC_",       "AMD_",           "RADV_",    "INTEL_",    "IGC_",
    "NEO",        "ZE_",      "SYCL_",      "MESA_",          "RUSTICL_", "GALLIUM_",  "LIBGL_",
    "LP_",        "DRI_",     "PAN_",       "PANVK_",         "FD_",      "V3D_",      "ETNA_",
    "MALI_",      "ADRENO_",  "QEMU_",      "ASAN_",          "TSAN_",    "UBSAN_",    "HWLOC_",
    "GALLIVM_",   "ONEAPI_",  "FLEXIBLAS"};
/// What they say where, or what they say aloud, changes no figure that counts: samples after the
/// first call are warm.
constexpr std::array kNotObeyed = {
    "POCL_CACHE_DIR",         "CUDA_CACHE_PATH", "NEO_CACHE_DIR", "AMD_COMGR_CACHE_DIR",
    "OCL_ICD_DEBUG",          "CUDA_HOME",       "CUDA_PATH",     "MESA_SHADER_CACHE_DIR",
    "NVIDIA_VISIBLE_DEVICES", "ONEAPI_ROOT"};

/// Those of this kernel's that a program may have; empty for the usual.
std::string scheduling() {
  std::vector<std::string> parts;
  constexpr int kResetsOnFork = 0x40000000;  // SCHED_RESET_ON_FORK
  const int policy = ::sched_getscheduler(0) & ~kResetsOnFork;
  sched_param parameters{};
  static_cast<void>(::sched_getparam(0, &parameters));
  constexpr std::array<std::string_view, 7> kNames = {"other", "fifo", "rr",      "batch",
                                                      "iso",   "idle", "deadline"};
  if (policy > 0 && static_cast<std::size_t>(policy) < kNames.size()) {
    const auto name = kNames.at(static_cast<std::size_t>(policy));
    parts.push_back(parameters.sched_priority > 0
                        ? fmt::format("class {}, priority {}", name, parameters.sched_priority)
                        : fmt::format("class {}", name));
  }
  errno = 0;
  const int nice = ::getpriority(PRIO_PROCESS, 0);
  if (errno == 0 && nice != 0) parts.push_back(fmt::format("nice {}", nice));
  int memory_mode = 0;
  if (::syscall(SYS_get_mempolicy, &memory_mode, nullptr, 0, nullptr, 0) == 0 && memory_mode != 0) {
    parts.push_back(fmt::format("memory policy {}", memory_mode));
  }
  if (::prctl(PR_GET_THP_DISABLE, 0, 0, 0, 0) == 1) parts.emplace_back("no huge pages");
  constexpr int kUsualSlackNs = 50'000;
  const int slack_ns = ::prctl(PR_GET_TIMERSLACK, 0, 0, 0, 0);
  if (policy <= 0 && slack_ns > 0 && slack_ns != kUsualSlackNs) {
    parts.push_back(fmt::format("timer slack {} ns", slack_ns));
  }
  const int stores = ::prctl(PR_GET_SPECULATION_CTRL, PR_SPEC_STORE_BYPASS, 0, 0, 0);
  constexpr auto kOff = PR_SPEC_DISABLE | PR_SPEC_FORCE_DISABLE;
  if (stores > 0 && (static_cast<unsigned long>(stores) & kOff) != 0) {
    parts.emplace_back("no loads ahead of stores");
  }
  return join(parts, ", ");
}

}  // namespace

Environment inherited_environment(const char* const* variables) {
  constexpr std::size_t kLongest = 300;
  Environment facts;
  for (; *variables != nullptr; ++variables) {
    const std::string_view text(*variables);
    const auto name = text.substr(0, text.find('='));
    const auto begins = [&](std::string_view prefix) { return name.starts_with(prefix); };
    if (std::ranges::none_of(kObeyed, begins) ||
        std::ranges::find(kNotObeyed, name) != kNotObeyed.end())
      continue;
    const auto all = text.substr(std::min(text.size(), name.size() + 1));
    std::string value(all.substr(0, kLongest));
    if (all.size() > kLongest) value += fmt::format("... ({:016x})", Hash64().add(all).value());
    facts["env." + std::string(name)] = value.empty() ? "set, and empty" : value;
  }
  return facts;
}

Environment inherited_environment() {
  Environment facts = inherited_environment(environ);
  if (const std::string unusual = scheduling(); !unusual.empty()) facts["scheduling"] = unusual;
  return facts;
}

Environment power_modes(const std::filesystem::path& root) {
  // @source Documentation/ABI/testing: sysfs-platform_profile, sysfs-class-devfreq, sysfs-driver-
  // intel-i915, sysfs-driver-intel-xe, gpu/amdgpu/thermal, power/powercap; nvpmodel of L4T;
  // Documentation/admin-guide/pm: intel_pstate, intel_uncore_frequency_scaling.
  constexpr std::array<std::pair<const char*, const char*>, 2> kOfTheMachine = {
      {{"platform_profile", "sys/firmware/acpi/platform_profile"},
       {"nvpmodel", "var/lib/nvpmodel/status"}}};
  struct Settings {
    std::string_view folder, begins;
    std::vector<std::string_view> files;  ///< Of each entry; "FOLDER/*/FILE" of each of FOLDER's.
  };
  const std::array<Settings, 5> all = {{
      {"sys/devices/system/cpu/intel_uncore_frequency", "", {"max_freq_khz"}},
      {"sys/class/devfreq", "", {"governor", "min_freq", "max_freq"}},
      {"sys/class/kgsl", "", {"max_gpuclk"}},
      {"sys/class/drm",
       "card",
       {"gt_max_freq_mhz", "gt_boost_freq_mhz", "device/power_dpm_force_performance_level",
        "device/tile0/gt0/freq0/max_freq", "device/hwmon/*/power1_cap",
        "device/hwmon/*/power1_max"}},
      {"sys/class/powercap", "intel-rapl", {"constraint_0_power_limit_uw"}},
  }};
  Environment facts;
  const auto put = [&](const std::string& name, const std::filesystem::path& file) {
    if (const auto value = first_line(file); value && !value->empty()) {
      facts["power_mode." + name] = *value;
    }
  };
  for (const auto& [name, file] : kOfTheMachine) put(name, root / file);
  const auto percent = root / "sys/devices/system/cpu/intel_pstate/max_perf_pct";
  if (first_line(percent) != "100") put("max_perf_pct", percent);  // It is, where nobody limits it.
  for (const Settings& settings : all) {
    for (const auto& entry : folder_entries(root / settings.folder)) {
      const std::string name = entry.filename();
      if (!name.starts_with(settings.begins)) continue;
      for (const auto file : settings.files) {
        const auto star = file.find("/*/");
        const bool each = star != std::string_view::npos;
        const auto folders = each ? folder_entries(entry / file.substr(0, star))
                                  : std::vector<std::filesystem::path>{entry};
        for (const auto& folder : folders) {
          put(name + "." + std::filesystem::path(file).filename().string(),
              folder / (each ? file.substr(star + 3) : file));
        }
      }
    }
  }
  return facts;
}

std::string no_new_code(const std::filesystem::path& folder) {
  struct statvfs system {};
  if (::statvfs(folder.c_str(), &system) == 0 && (system.f_flag & ST_NOEXEC) != 0) {
    return fmt::format(
        "'{}' is mounted noexec, so that no driver can load the kernels that it compiles there; "
        "set "
        "TMPDIR to a folder of another file system",
        folder.string());
  }
  const auto size = static_cast<std::size_t>(::sysconf(_SC_PAGESIZE));
  void* const page =
      ::mmap(nullptr, size, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
  if (page == MAP_FAILED) return "";
  const bool refused = ::mprotect(page, size, PROT_READ | PROT_EXEC) != 0;
  ::munmap(page, size);
  if (!refused) return "";
  return "memory may not be made executable here, so that libraries and drivers that compile while "
         "they run fail; start it without MemoryDenyWriteExecute= of systemd (PR_SET_MDWE), or "
         "allow execmem in SELinux";
}

}  // namespace pirt
