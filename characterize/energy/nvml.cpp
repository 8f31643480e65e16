// NVML: the meter of an NVIDIA board, and what else its driver tells of it, through the library of
// its driver. It is opened when meters are looked for: nothing is needed to build with it, and a
// machine without it has no such meter.
//
// Source: NVML API Reference. nvmlDeviceGetTotalEnergyConsumption gives millijoules since the
// driver was loaded, since Volta, in steps some 20 to 100 ms apart; nvmlDeviceGetPowerUsage
// milliwatts. Names with a version are those that the library exports, and give the layouts here.
#include "characterize/energy/nvml.h"

#include <dlfcn.h>
#include <fmt/core.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <limits>
#include <memory>
#include <type_traits>

#include "characterize/energy/meter.h"
#include "workloads/base/system/pci.h"

namespace pirt {
namespace {

using NvmlStatus = int;
using NvmlBoard = void*;
constexpr NvmlStatus kNvmlSuccess = 0;
constexpr NvmlStatus kNvmlNotSupported = 3;
constexpr NvmlStatus kNvmlInsufficientSize = 7;

struct NvmlPci {
  std::array<char, 16> legacy_id;
  unsigned domain, bus, device, device_id, subsystem_id;
  std::array<char, 32> id;
};
struct NvmlMemory {
  unsigned long long total_bytes, free_bytes, used_bytes;
};
struct NvmlProcess {
  unsigned pid;
  unsigned long long memory_bytes;
  unsigned instance, compute_instance;
};

// Power is only read of boards that count no energy, and those average it over less.
constexpr Nanos kNvmlPeriod = std::chrono::milliseconds(100);
constexpr std::int64_t kMicroAMilli = 1000;

/// The library, initialized as long as this lives. Functions that an older driver lacks are null.
struct Nvml {
  Nvml() = default;
  ~Nvml() {
    if (initialized) shutdown();
  }
  Nvml(const Nvml&) = delete;
  Nvml& operator=(const Nvml&) = delete;

  bool initialized = false;
  NvmlStatus (*init)() = nullptr;
  NvmlStatus (*shutdown)() = nullptr;
  const char* (*text)(NvmlStatus) = nullptr;
  NvmlStatus (*count)(unsigned*) = nullptr;
  NvmlStatus (*board)(unsigned, NvmlBoard*) = nullptr;
  NvmlStatus (*pci)(NvmlBoard, NvmlPci*) = nullptr;
  NvmlStatus (*energy_mj)(NvmlBoard, unsigned long long*) = nullptr;
  NvmlStatus (*power_mw)(NvmlBoard, unsigned*) = nullptr;
  NvmlStatus (*mig)(NvmlBoard, unsigned* now, unsigned* pending) = nullptr;
  NvmlStatus (*processes)(NvmlBoard, unsigned*, NvmlProcess*) = nullptr;
  NvmlStatus (*memory)(NvmlBoard, NvmlMemory*) = nullptr;
  NvmlStatus (*ecc)(NvmlBoard, unsigned* now, unsigned* pending) = nullptr;
  using Number = NvmlStatus (*)(NvmlBoard, unsigned*);
  Number limit_mw = nullptr, default_limit_mw = nullptr;
  Number link_generation = nullptr, most_generation = nullptr;
  Number link_width = nullptr, most_width = nullptr;
  using Clock = NvmlStatus (*)(NvmlBoard, int type, unsigned*);
  Clock set_mhz = nullptr, default_mhz = nullptr;
};

/// PIRT_NVML names another file, or none.
std::string nvml_file() {
  const char* const file = std::getenv("PIRT_NVML");
  return file == nullptr || *file == '\0' ? "libnvidia-ml.so.1" : file;
}

/// Null with the reason in @p why. The library stays loaded.
std::shared_ptr<const Nvml> open_nvml(std::string& why) {
  const std::string file = nvml_file();
  if (file == "none") {
    why = "not asked, PIRT_NVML is none";
    return nullptr;
  }
  void* const library = ::dlopen(file.c_str(), RTLD_NOW | RTLD_LOCAL);
  if (library == nullptr) {
    why = fmt::format("{}; the driver of an NVIDIA board brings it", ::dlerror());
    return nullptr;
  }
  const auto nvml = std::make_shared<Nvml>();
  const auto find = [&](const char* name, auto& function) {
    function =
        reinterpret_cast<std::remove_reference_t<decltype(function)>>(::dlsym(library, name));
    return function != nullptr;
  };
  const bool complete = find("nvmlInit_v2", nvml->init) && find("nvmlShutdown", nvml->shutdown) &&
                        find("nvmlErrorString", nvml->text) &&
                        find("nvmlDeviceGetCount_v2", nvml->count) &&
                        find("nvmlDeviceGetHandleByIndex_v2", nvml->board) &&
                        find("nvmlDeviceGetPciInfo_v3", nvml->pci);
  if (!complete) {
    why = file + " is too old; update the board's driver";
    return nullptr;
  }
  find("nvmlDeviceGetTotalEnergyConsumption", nvml->energy_mj);
  find("nvmlDeviceGetPowerUsage", nvml->power_mw);
  find("nvmlDeviceGetMigMode", nvml->mig);
  if (!find("nvmlDeviceGetComputeRunningProcesses_v3", nvml->processes)) {
    find("nvmlDeviceGetComputeRunningProcesses_v2", nvml->processes);  // of the same layout
  }
  find("nvmlDeviceGetMemoryInfo", nvml->memory);
  find("nvmlDeviceGetEccMode", nvml->ecc);
  find("nvmlDeviceGetEnforcedPowerLimit", nvml->limit_mw);
  find("nvmlDeviceGetPowerManagementDefaultLimit", nvml->default_limit_mw);
  find("nvmlDeviceGetCurrPcieLinkGeneration", nvml->link_generation);
  find("nvmlDeviceGetMaxPcieLinkGeneration", nvml->most_generation);
  find("nvmlDeviceGetCurrPcieLinkWidth", nvml->link_width);
  find("nvmlDeviceGetMaxPcieLinkWidth", nvml->most_width);
  find("nvmlDeviceGetApplicationsClock", nvml->set_mhz);
  find("nvmlDeviceGetDefaultApplicationsClock", nvml->default_mhz);
  const NvmlStatus status = nvml->init();
  nvml->initialized = status == kNvmlSuccess;
  if (nvml->initialized) return nvml;
  why = fmt::format("{}: {}; nvidia-smi says more", file, nvml->text(status));
  return nullptr;
}

/// Processes that compute on the board and are not this program's: neither this process nor, of one
/// with a device open (a worker), the one that started it. In a container their numbers may be
/// those outside; then one of them is this process, if it has a device open. Absent where the
/// driver does not tell.
std::optional<int> others_on(const Nvml& nvml, NvmlBoard board, bool device_open) {
  if (nvml.processes == nullptr) return std::nullopt;
  std::array<NvmlProcess, 64> list{};
  auto count = static_cast<unsigned>(list.size());
  const NvmlStatus status = nvml.processes(board, &count, list.data());
  if (status == kNvmlInsufficientSize) return static_cast<int>(list.size());
  if (status != kNvmlSuccess) return std::nullopt;
  const auto is_own = [device_open](const NvmlProcess& each) {
    const auto pid = static_cast<pid_t>(each.pid);
    return pid == ::getpid() || (device_open && pid == ::getppid());
  };
  const auto all = static_cast<int>(std::min<std::size_t>(count, list.size()));
  const auto own = static_cast<int>(std::count_if(list.begin(), list.begin() + all, is_own));
  return own > 0 ? all - own : std::max(0, all - (device_open ? 1 : 0));
}

bool mig_is_on(const Nvml& nvml, NvmlBoard board) {
  unsigned mig = 0;
  unsigned pending = 0;
  return nvml.mig != nullptr && nvml.mig(board, &mig, &pending) == kNvmlSuccess && mig != 0;
}

/// Why the board's joules are not those of this program's calls, or "".
std::string not_ours(const Nvml& nvml, NvmlBoard board, int others) {
  if (mig_is_on(nvml, board)) {
    return "MIG is on, and the board does not tell its instances' joules apart; turn it off with "
           "nvidia-smi -mig 0";
  }
  if (others == 0) return "";
  return fmt::format("{} other process{} on the board; end {} (nvidia-smi shows them)", others,
                     others == 1 ? " computes" : "es compute", others == 1 ? "it" : "them");
}

class NvmlMeter : public Meter {
 public:
  NvmlMeter(MeterInfo info, std::shared_ptr<const Nvml> nvml, NvmlBoard board, std::string unusable)
      : Meter(std::move(info)),
        nvml_(std::move(nvml)),
        board_(board),
        unusable_(std::move(unusable)) {}

  [[nodiscard]] Attribute<std::int64_t> read() const override {
    if (!unusable_.empty()) return {std::nullopt, unusable_, 0};
    unsigned long long milli = 0;
    unsigned power_mw = 0;
    NvmlStatus status = kNvmlSuccess;
    if (info().kind == MeterKind::kCounter) {
      status = nvml_->energy_mj(board_, &milli);
    } else {
      status = nvml_->power_mw(board_, &power_mw);
      milli = power_mw;
    }
    if (status != kNvmlSuccess) return {std::nullopt, info().path + ": " + nvml_->text(status), 0};
    if (milli > std::numeric_limits<std::int64_t>::max() / kMicroAMilli) {
      return {std::nullopt, fmt::format("{}: {} is no reading", info().path, milli), 0};
    }
    return {static_cast<std::int64_t>(milli) * kMicroAMilli, "", 0};
  }

 private:
  std::shared_ptr<const Nvml> nvml_;
  NvmlBoard board_;
  std::string unusable_;
};

/// What the driver gives of the board, energy rather than power; absent if neither.
std::optional<MeterKind> kind_of(const Nvml& nvml, NvmlBoard board) {
  unsigned long long energy_mj = 0;
  if (nvml.energy_mj != nullptr && nvml.energy_mj(board, &energy_mj) != kNvmlNotSupported) {
    return MeterKind::kCounter;
  }
  unsigned power_mw = 0;
  if (nvml.power_mw != nullptr && nvml.power_mw(board, &power_mw) != kNvmlNotSupported) {
    return MeterKind::kPower;
  }
  return std::nullopt;
}

/// Null with the reason in @p why.
NvmlBoard board_at(const Nvml& nvml, unsigned index, std::string& pci, std::string& why) {
  NvmlBoard board = nullptr;
  NvmlPci place{};
  NvmlStatus status = nvml.board(index, &board);
  if (status == kNvmlSuccess) status = nvml.pci(board, &place);
  pci = pci_address(place.domain, place.bus, place.device, 0);
  if (status == kNvmlSuccess) return board;
  why = fmt::format("board {}: {}", index, nvml.text(status));
  return nullptr;
}

void add_board(const std::shared_ptr<const Nvml>& nvml, unsigned index, bool device_open,
               MeterDiscovery& found) {
  MeterInfo info;
  std::string why;
  const NvmlBoard board = board_at(*nvml, index, info.pci, why);
  if (board == nullptr) return found.missing.push_back("NVML: " + why);
  const auto kind = kind_of(*nvml, board);
  if (!kind) {
    found.missing.push_back("NVML: the driver tells neither energy nor power of board " + info.pci);
    return;
  }
  info.name = "nvidia/" + info.pci;
  info.driver = "nvml";
  info.kind = *kind;
  info.domain = MeterDomain::kGpu;
  info.covers = kCoversGpu;
  info.steps = *kind == MeterKind::kCounter;
  if (!info.steps) info.period = kNvmlPeriod;
  info.path = nvml_file() + " of board " + info.pci;
  const auto others = others_on(*nvml, board, device_open);
  if (!others && !mig_is_on(*nvml, board)) {
    found.missing.push_back("NVML: the driver does not tell who else computes on board " +
                            info.pci + ", whose joules would count as well");
  }
  found.meters.push_back(std::make_unique<NvmlMeter>(std::move(info), nvml, board,
                                                     not_ours(*nvml, board, others.value_or(0))));
}

/// None with the reason in @p why.
unsigned count_boards(const Nvml* nvml, std::string& why) {
  if (nvml == nullptr) return 0;
  unsigned boards = 0;
  const NvmlStatus status = nvml->count(&boards);
  if (status == kNvmlSuccess && boards > 0) return boards;
  why = status == kNvmlSuccess ? "the driver has no board" : nvml->text(status);
  return 0;
}

/// @param which  Of several, as the function takes it.
template <typename Ask, typename... Which>
std::optional<unsigned> number_of_board(Ask ask, NvmlBoard board, Which... which) {
  unsigned value = 0;
  if (ask == nullptr || ask(board, which..., &value) != kNvmlSuccess) return std::nullopt;
  return value;
}

NvmlBoardFacts facts_of(const Nvml& nvml, NvmlBoard board) {
  NvmlBoardFacts facts;
  NvmlMemory memory{};
  if (nvml.memory != nullptr && nvml.memory(board, &memory) == kNvmlSuccess) {
    facts.memory_gb = static_cast<double>(memory.total_bytes) / 1e9;
    facts.free_gb = static_cast<double>(memory.free_bytes) / 1e9;
  }
  const auto watts = [&](Nvml::Number ask) -> std::optional<double> {
    const auto milli = number_of_board(ask, board);
    return milli ? std::optional(*milli / 1e3) : std::nullopt;
  };
  facts.limit_w = watts(nvml.limit_mw);
  facts.default_limit_w = watts(nvml.default_limit_mw);
  constexpr int kGraphics = 0, kMemory = 2;
  facts.core_mhz = number_of_board(nvml.set_mhz, board, kGraphics);
  facts.default_core_mhz = number_of_board(nvml.default_mhz, board, kGraphics);
  facts.memory_mhz = number_of_board(nvml.set_mhz, board, kMemory);
  unsigned ecc = 0;
  unsigned pending = 0;
  if (nvml.ecc != nullptr && nvml.ecc(board, &ecc, &pending) == kNvmlSuccess) facts.ecc = ecc != 0;
  facts.mig = mig_is_on(nvml, board);
  facts.others = others_on(nvml, board, false);
  facts.link_generation = number_of_board(nvml.link_generation, board);
  facts.most_generation = number_of_board(nvml.most_generation, board);
  facts.link_width = number_of_board(nvml.link_width, board);
  facts.most_width = number_of_board(nvml.most_width, board);
  return facts;
}

}  // namespace

NvmlFacts read_nvml() {
  NvmlFacts facts;
  const auto nvml = open_nvml(facts.missing);
  const unsigned boards = count_boards(nvml.get(), facts.missing);
  for (unsigned index = 0; index < boards; ++index) {
    std::string pci;
    const NvmlBoard board = board_at(*nvml, index, pci, facts.missing);
    if (board == nullptr) continue;
    facts.boards.push_back(facts_of(*nvml, board));
    facts.boards.back().pci = pci;
  }
  return facts;
}

std::map<std::string, std::string> board_settings(const std::string& pci) {
  std::map<std::string, std::string> settings;
  for (const NvmlBoardFacts& board : read_nvml().boards) {
    if (board.pci != pci) continue;
    const auto put = [&settings](const char* name, const auto& value) {
      if (value) settings[name] = fmt::format("{}", *value);
    };
    put("power_limit_w", board.limit_w);
    put("core_mhz", board.core_mhz);
    put("memory_mhz", board.memory_mhz);
    put("ecc", board.ecc);
  }
  return settings;
}

void find_nvml(bool device_open, MeterDiscovery& found) {
  std::string why;
  const auto nvml = open_nvml(why);
  const unsigned boards = count_boards(nvml.get(), why);
  if (!why.empty()) found.missing.push_back("NVML: " + why);
  for (unsigned index = 0; index < boards; ++index) add_board(nvml, index, device_open, found);
}

}  // namespace pirt
