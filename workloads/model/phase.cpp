#include "workloads/model/phase.h"

#include <span>
#include <utility>

namespace pirt {
namespace {

template <typename T>
using Names = std::span<const std::pair<T, std::string_view>>;

template <typename T>
std::string_view name_of(Names<T> names, T value) {
  for (const auto& [known, name] : names) {
    if (known == value) return name;
  }
  return "?";
}

template <typename T>
std::optional<T> value_of(Names<T> names, std::string_view text) {
  for (const auto& [value, name] : names) {
    if (name == text) return value;
  }
  return std::nullopt;
}

constexpr std::pair<Phase, std::string_view> kPhases[] = {{Phase::kDeviceInit, "device_init"},
                                                          {Phase::kPrepare, "prepare"},
                                                          {Phase::kUpload, "upload"},
                                                          {Phase::kLaunch, "launch"},
                                                          {Phase::kExecute, "execute"},
                                                          {Phase::kDownload, "download"},
                                                          {Phase::kCall, "call"}};
constexpr std::pair<State, std::string_view> kStates[] = {
    {State::kCold, "cold"}, {State::kWarm, "warm"}, {State::kSteady, "steady"}};
constexpr std::pair<Provenance, std::string_view> kProvenances[] = {
    {Provenance::kMeasured, "measured"},
    {Provenance::kCounted, "counted"},
    {Provenance::kModelled, "modelled"},
    {Provenance::kFitted, "fitted"},
    {Provenance::kPublished, "published"}};

}  // namespace

std::string_view to_string(Phase phase) { return name_of<Phase>(kPhases, phase); }
std::optional<Phase> phase_from_string(std::string_view text) {
  return value_of<Phase>(kPhases, text);
}
std::string_view to_string(State state) { return name_of<State>(kStates, state); }
std::optional<State> state_from_string(std::string_view text) {
  return value_of<State>(kStates, text);
}
std::string_view to_string(Provenance provenance) {
  return name_of<Provenance>(kProvenances, provenance);
}
std::optional<Provenance> provenance_from_string(std::string_view text) {
  return value_of<Provenance>(kProvenances, text);
}

}  // namespace pirt
