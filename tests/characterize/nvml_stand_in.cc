// A library that stands in for libnvidia-ml.so.1, with the functions that pirt asks for. What its
// boards are and draw is in NVML_STAND_IN, read anew at each call: "boards=01,41 step_ms=50 ...".
//
// Energy is power times time, and with call_w more for each second that this process computes; it
// is renewed each step_ms. A process that is started as a worker has a device open: it finds the
// board awake (awake_w), any other one at rest (rest_w). Built with NVML_STAND_IN_OLD it is a
// driver from before there was energy, with the list of processes of that time.
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <fstream>
#include <map>
#include <mutex>
#include <sstream>
#include <string>
#include <vector>

namespace {

std::string setting(const std::string& key, const std::string& otherwise) {
  const char* const script = std::getenv("NVML_STAND_IN");
  std::istringstream words(script == nullptr ? "" : script);
  for (std::string word; words >> word;) {
    if (word.starts_with(key + "=")) return word.substr(key.size() + 1);
  }
  return otherwise;
}

double number(const std::string& key, double otherwise) {
  return std::stod(setting(key, std::to_string(otherwise)));
}

std::vector<std::string> list(const std::string& key, const std::string& otherwise) {
  std::istringstream items(setting(key, otherwise));
  std::vector<std::string> all;
  for (std::string item; std::getline(items, item, ',');) all.push_back(item);
  return all;
}

[[maybe_unused]] double seconds(clockid_t clock) {
  timespec time{};
  ::clock_gettime(clock, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

bool is_worker() {
  static const bool worker = [] {
    std::ifstream file("/proc/self/cmdline");
    const std::string line{std::istreambuf_iterator<char>(file), {}};
    return line.find(std::string("worker")) != std::string::npos;
  }();
  return worker;
}

double power_w() { return is_worker() ? number("awake_w", 124) : number("rest_w", 79); }

}  // namespace

extern "C" {

struct Place {
  char legacy[16];
  unsigned domain, bus, device, id, subsystem;
  char bus_id[32];
};
struct Process {
  unsigned pid;
  unsigned long long memory;
  unsigned instance, compute_instance;
};

int nvmlInit_v2() { return static_cast<int>(number("init", 0)); }
int nvmlShutdown() { return 0; }
const char* nvmlErrorString(int status) { return status == 15 ? "GPU is lost" : "some error"; }
int nvmlDeviceGetCount_v2(unsigned* count) {
  *count = static_cast<unsigned>(list("boards", "01").size());
  return 0;
}
int nvmlDeviceGetHandleByIndex_v2(unsigned index, void** board) {
  *board = reinterpret_cast<void*>(static_cast<std::size_t>(index) + 1);
  return 0;
}
int nvmlDeviceGetPciInfo_v3(void* board, Place* place) {
  const auto bus = list("boards", "01").at(reinterpret_cast<std::size_t>(board) - 1);
  *place = {};
  place->bus = static_cast<unsigned>(std::stoul(bus, nullptr, 16));
  return 0;
}
int nvmlDeviceGetPowerUsage(void*, unsigned* power_mw) {
  *power_mw = static_cast<unsigned>(std::lround(power_w() * 1e3));
  return static_cast<int>(number("power_status", 0));
}
int nvmlDeviceGetEnforcedPowerLimit(void*, unsigned* limit_mw) {
  *limit_mw = static_cast<unsigned>(std::lround(number("limit_w", 700) * 1e3));
  return 0;
}
int nvmlDeviceGetPowerManagementDefaultLimit(void*, unsigned* limit_mw) {
  *limit_mw = 700'000;
  return 0;
}
int nvmlDeviceGetApplicationsClock(void*, int type, unsigned* mhz) {
  *mhz = static_cast<unsigned>(type == 0 ? number("core_mhz", 1980) : number("memory_mhz", 2619));
  return static_cast<int>(number("clock_status", 0));
}
int nvmlDeviceGetDefaultApplicationsClock(void*, int type, unsigned* mhz) {
  *mhz = type == 0 ? 1980 : 2619;
  return static_cast<int>(number("clock_status", 0));
}
int nvmlDeviceGetMemoryInfo(void*, unsigned long long* total_free_used) {
  total_free_used[0] = 80'000'000'000;
  total_free_used[1] = 79'000'000'000;
  total_free_used[2] = 1'000'000'000;
  return 0;
}
int nvmlDeviceGetEccMode(void*, unsigned* now, unsigned* pending) {
  *now = *pending = static_cast<unsigned>(number("ecc", 1));
  return static_cast<int>(number("ecc_status", 0));
}
int nvmlDeviceGetCurrPcieLinkGeneration(void*, unsigned* generation) {
  *generation = 3;
  return 0;
}
int nvmlDeviceGetMaxPcieLinkGeneration(void*, unsigned* generation) {
  *generation = 5;
  return 0;
}
int nvmlDeviceGetCurrPcieLinkWidth(void*, unsigned* lanes) {
  *lanes = static_cast<unsigned>(number("lanes", 16));
  return 0;
}
int nvmlDeviceGetMaxPcieLinkWidth(void*, unsigned* lanes) {
  *lanes = 16;
  return 0;
}
int nvmlDeviceGetMigMode(void*, unsigned* now, unsigned* pending) {
  *now = *pending = static_cast<unsigned>(number("mig", 0));
  return 0;
}
#ifdef NVML_STAND_IN_OLD
#define nvmlDeviceGetComputeRunningProcesses_v3 nvmlDeviceGetComputeRunningProcesses_v2
#endif
int nvmlDeviceGetComputeRunningProcesses_v3(void*, unsigned* count, Process* processes) {
  const auto pids = list("pids", "");
  if (pids.size() > *count) return 7;
  *count = static_cast<unsigned>(pids.size());
  for (std::size_t i = 0; i < pids.size(); ++i) {
    processes[i] = {static_cast<unsigned>(std::stoul(pids[i])), 0, 0, 0};
  }
  return static_cast<int>(number("pids_status", 0));
}

#ifndef NVML_STAND_IN_OLD
int nvmlDeviceGetTotalEnergyConsumption(void*, unsigned long long* energy_mj) {
  static std::mutex mutex;
  static double step = -1;
  static double energy_j = 0;
  const std::lock_guard lock(mutex);
  const double now_s = seconds(CLOCK_MONOTONIC);
  const double now_step = std::floor(now_s * 1e3 / number("step_ms", 50));
  if (setting("still", "").empty() && now_step != step) {
    step = now_step;
    energy_j = power_w() * now_s + number("call_w", 0) * seconds(CLOCK_PROCESS_CPUTIME_ID);
  }
  *energy_mj = static_cast<unsigned long long>(energy_j * 1e3);
  return static_cast<int>(number("energy_status", 0));
}
#endif
}
