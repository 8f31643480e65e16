#include "workloads/backends/missing_backend.h"

#include <utility>

#include "workloads/base/error.h"

namespace pirt {
namespace {

class MissingBackend : public Backend {
 public:
  MissingBackend(std::string name, std::string missing)
      : name_(std::move(name)), missing_(std::move(missing)) {}

  [[nodiscard]] std::string_view name() const override { return name_; }
  [[nodiscard]] std::string_view description() const override { return "not in this build"; }
  [[nodiscard]] std::vector<Phase> phases() const override { return {Phase::kCall}; }
  [[nodiscard]] Probe probe() const override { return {false, missing_, {}}; }
  [[nodiscard]] Support supports(const Workload&) const override { return {false, missing_}; }
  [[nodiscard]] std::unique_ptr<Device> open(const UnitRequest&) const override {
    throw_environment("backend " + name_ + " is unavailable: " + missing_);
  }

 private:
  std::string name_, missing_;
};

}  // namespace

std::unique_ptr<const Backend> make_missing_backend(std::string name, std::string missing) {
  return std::make_unique<MissingBackend>(std::move(name), std::move(missing));
}

bool is_missing(const Backend& backend) {
  return dynamic_cast<const MissingBackend*>(&backend) != nullptr;
}

}  // namespace pirt
