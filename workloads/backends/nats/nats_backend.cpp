#include "workloads/backends/nats/nats_backend.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <condition_variable>
#include <mutex>
#include <string>
#include <utility>

#include "workloads/backends/nats/nats_settings.h"
#include "workloads/backends/nats/robot_link.h"
#include "workloads/base/error.h"
#include "workloads/base/text/yaml.h"
#include "workloads/model/remote.h"

namespace pirt {
namespace {

using namespace std::chrono_literals;

/// How long opening waits for a server and a worker.
constexpr Nanos kOpening = 3s;
constexpr Nanos kLook = 100ms;

Support support_of(const Workload& workload) {
  if (workload.state) return {false, "stateful workloads: unsupported in the cloud"};
  return {true, ""};
}

/// One call on its way; the link's threads tell it what becomes of it.
struct Flight {
  std::mutex mutex;
  std::condition_variable changed;
  bool stored = false, arrived = false;
  bool large = false;  ///< Its outputs have to be read after that.
  Nanos execute{0};
  std::optional<cloud::TaskEnd> end;
};

class CloudKernel : public Kernel {
 public:
  CloudKernel(cloud::RobotLink& link, const Workload& workload, std::span<const Tensor> parameters,
              std::uint32_t chunk_bytes, Nanos patience)
      : link_(link), workload_(workload), patience_(patience) {
    body_.workload = workload.name;
    body_.spec = cloud::spec_digest(workload);
    if (parameters.empty()) return;
    auto bytes = std::make_shared<const cloud::Bytes>(cloud::encode_tensors(parameters));
    parameters_ = {.blob = {cloud::digest_of(*bytes), bytes->size(), chunk_bytes}, .bytes = bytes};
    body_.parameters = parameters_->blob;
  }
  ~CloudKernel() override { withdraw(); }

  void bind(std::span<const Tensor> inputs, std::span<Tensor> outputs) override {
    inputs_ = inputs;
    outputs_ = outputs;
  }

  void unbind() override {
    withdraw();
    inputs_ = {};
    outputs_ = {};
  }

  /// Until the server has the task.
  void upload() override {
    withdraw();
    const cloud::Bytes tensors = cloud::encode_tensors(inputs_);
    body_.tensors = tensors;
    bytes_ = std::make_shared<const cloud::Bytes>(encode(body_));
    body_.tensors = {};
    submit();
    wait([](const Flight& flight) { return flight.stored || flight.arrived; });
  }

  /// Until the reply comes; what the worker did not compute is the queue.
  std::optional<Nanos> execute(int repeats) override {
    Nanos queue{0};
    for (int i = 0; i < repeats; ++i) {
      if (flight_ == nullptr) submit();
      const Nanos begin = clock_.now();
      wait([](const Flight& flight) { return flight.arrived && flight.large; });
      const Nanos waited = clock_.now() - begin;
      queue += std::max(Nanos::zero(), waited - flight_->execute);
      if (!flight_->large || i + 1 < repeats) finish();
    }
    return queue;
  }

  /// Reads what did not come with the reply.
  void download() override {
    if (flight_ != nullptr) finish();
    const std::string problem = cloud::decode_tensors_into(last_.outputs, outputs_);
    if (!problem.empty()) {
      throw_environment(fmt::format("worker {} replied to {} with something else: {}", last_.worker,
                                    workload_.name, problem));
    }
  }

 private:
  void submit() {
    flight_ = std::make_shared<Flight>();
    cloud::Submission submission{.body = bytes_, .parameters = parameters_};
    submission.stored = [flight = flight_] {
      const std::lock_guard lock(flight->mutex);
      flight->stored = true;
      flight->changed.notify_all();
    };
    submission.arrived = [flight = flight_](const cloud::ReplyMessage& reply) {
      if (reply.kind != cloud::ReplyKind::kDone) return;
      const std::lock_guard lock(flight->mutex);
      flight->arrived = true;
      flight->execute = reply.execute;
      flight->large = std::holds_alternative<cloud::Blob>(reply.outputs);
      flight->changed.notify_all();
    };
    submission.ended = [flight = flight_](cloud::TaskEnd end) {
      const std::lock_guard lock(flight->mutex);
      flight->end = std::move(end);
      flight->changed.notify_all();
    };
    task_ = link_.submit(std::move(submission));
  }

  /// @throws Error{kEnvironment} once the task has ended without a result, or neither server nor
  /// worker was there for too long.
  template <typename Until>
  void wait(Until until) {
    Nanos lost{0};
    std::unique_lock lock(flight_->mutex);
    while (!until(*flight_) && !flight_->end) {
      if (flight_->changed.wait_for(lock, kLook) == std::cv_status::no_timeout) continue;
      if (link_.availability() != cloud::Availability::kDown) {
        lost = Nanos::zero();
        continue;
      }
      if (lost == Nanos::zero()) lost = clock_.now();
      if (clock_.now() - lost < patience_) continue;
      lock.unlock();
      const std::string why = link_.why_down();
      withdraw();
      throw_environment(workload_.name + " was not answered: " + why);
    }
    if (!flight_->end || flight_->end->how == cloud::CallEndKind::kDone) return;
    const std::string problem = flight_->end->problem;
    lock.unlock();
    flight_.reset();
    throw_environment(problem);
  }

  void finish() {
    wait([](const Flight&) { return false; });
    last_ = *std::move(flight_->end);
    flight_.reset();
  }

  void withdraw() {
    if (flight_ == nullptr) return;
    link_.cancel(task_);
    flight_.reset();
  }

  cloud::RobotLink& link_;
  const Workload& workload_;
  Nanos patience_;
  MachineClock clock_;
  cloud::TaskBody body_;
  std::optional<cloud::Parameters> parameters_;
  std::span<const Tensor> inputs_;
  std::span<Tensor> outputs_;
  std::shared_ptr<const cloud::Bytes> bytes_;
  cloud::TaskId task_;
  std::shared_ptr<Flight> flight_;
  cloud::TaskEnd last_;
};

DeviceInfo device_info(const std::string& server) {
  return {.name = "workers at " + server,
          .platform = "NATS JetStream",
          .version = "protocol " + std::to_string(cloud::kProtocol)};
}

struct CloudUnit {
  cloud::RobotOptions options;
  Nanos patience{0};
};

CloudUnit read_request(const UnitRequest& request) {
  CloudUnit unit;
  const auto specs = nats_options();
  unit.options.outbox_bytes =
      static_cast<std::uint64_t>(std::llround(1e6 * request.option(specs[0])));
  unit.patience = from_s(request.option(specs[1]));
  if (request.script.empty()) return unit;
  const YamlNode settings = parse_yaml("unit " + request.unit, request.script);
  settings.check_keys(nats_settings());
  cloud::ConnectionOptions& connection = unit.options.connection;
  const auto text = [&](const char* key, std::string& to) {
    if (settings.has(key)) to = settings.at(key).text();
  };
  text("server", connection.server);
  text("robot", unit.options.robot);
  text("ca", connection.ca);
  text("certificate", connection.certificate);
  text("key", connection.key);
  text("nkey", connection.nkey);
  text("nkey_seed", connection.nkey_seed);
  if (settings.has("insecure")) connection.insecure = settings.at("insecure").boolean();
  std::string outbox;
  text("outbox", outbox);
  unit.options.outbox = outbox;
  return unit;
}

class CloudDevice : public Device, public Remote {
 public:
  explicit CloudDevice(const CloudUnit& unit)
      : server_(cloud::public_url(unit.options.connection.server)),
        patience_(unit.patience),
        link_(unit.options) {
    // Who is not there yet may come.
    static_cast<void>(link_.wait_until_up(kOpening));
  }

  [[nodiscard]] DeviceInfo info() const override {
    DeviceInfo info = device_info(server_);
    info.remark = link_.why_down();
    return info;
  }
  [[nodiscard]] bool is_reachable() const override {
    return link_.availability() == cloud::Availability::kUp;
  }
  [[nodiscard]] Support supports(const Workload& workload) const override {
    const Support support = support_of(workload);
    if (!support.ok) return support;
    const std::string why = link_.why_not(workload.name, cloud::spec_digest(workload));
    return {why.empty(), why};
  }

 private:
  [[nodiscard]] std::unique_ptr<Kernel> make_kernel(const Workload& workload,
                                                    std::span<const Tensor> parameters) override {
    if (!link_.wait_until_up(std::min(kOpening, patience_))) throw_environment(link_.why_down());
    constexpr std::uint32_t kChunk = 256 << 10;  // a part of any server's limit
    return std::make_unique<CloudKernel>(link_, workload, parameters, kChunk, patience_);
  }

  std::string server_;
  Nanos patience_;
  cloud::RobotLink link_;
};

class NatsBackend : public Backend {
 public:
  [[nodiscard]] std::string_view name() const override { return "nats"; }
  [[nodiscard]] std::string_view description() const override {
    return "the cloud: workers elsewhere (pirt cloud-worker), over NATS JetStream";
  }
  [[nodiscard]] std::vector<Phase> phases() const override {
    return {kAllPhases.begin(), kAllPhases.end()};
  }
  [[nodiscard]] Probe probe() const override {
    return {true, "", {device_info("the unit's server")}};
  }
  [[nodiscard]] Support supports(const Workload& workload) const override {
    return support_of(workload);
  }
  [[nodiscard]] std::unique_ptr<Device> open(const UnitRequest& request) const override {
    const CloudUnit unit = read_request(request);
    return std::make_unique<CloudDevice>(unit);
  }
};

}  // namespace

std::unique_ptr<const Backend> make_nats_backend() { return std::make_unique<NatsBackend>(); }

}  // namespace pirt
