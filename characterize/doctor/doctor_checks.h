// The single checks behind diagnose(), by what they look at.
#pragma once

#include <vector>

#include "characterize/doctor/doctor.h"

namespace pirt::doctor {

/// A list, since a check may find several things (one a unit, one a folder).
using Findings = std::vector<Finding>;

// doctor_clock.cpp: what decides how fast the cores run.
[[nodiscard]] Findings governor(const DoctorInput& input);
[[nodiscard]] Findings frequency_limit(const DoctorInput& input);
[[nodiscard]] Findings turbo(const DoctorInput& input);
[[nodiscard]] Findings heat(const DoctorInput& input);
[[nodiscard]] Findings power_supply(const DoctorInput& input);
[[nodiscard]] Findings clock_source(const DoctorInput& input);

// doctor_sharing.cpp: who else uses them, and memory.
[[nodiscard]] Findings cores(const DoctorInput& input);
[[nodiscard]] Findings siblings(const DoctorInput& input);
[[nodiscard]] Findings load(const DoctorInput& input);
[[nodiscard]] Findings steal(const DoctorInput& input);
[[nodiscard]] Findings jitter(const DoctorInput& input);
[[nodiscard]] Findings quota(const DoctorInput& input);
[[nodiscard]] Findings memory(const DoctorInput& input);
[[nodiscard]] Findings swapping(const DoctorInput& input);

// doctor_gpu.cpp: graphics cards.
[[nodiscard]] Findings gpus(const DoctorInput& input);

// doctor.cpp: pirt itself.
[[nodiscard]] Findings build(const DoctorInput& input);
[[nodiscard]] Findings units(const DoctorInput& input);
[[nodiscard]] Findings energy_meter(const DoctorInput& input);
[[nodiscard]] Findings disk(const DoctorInput& input);
[[nodiscard]] Findings new_code(const DoctorInput& input);
[[nodiscard]] Findings inherited(const DoctorInput& input);

[[nodiscard]] inline Finding good(std::string check, std::string found) {
  return {std::move(check), Level::kGood, std::move(found), "", ""};
}
[[nodiscard]] inline Finding unknown(std::string check, std::string why) {
  return {std::move(check), Level::kUnknown, std::move(why), "", ""};
}

}  // namespace pirt::doctor
