// pirt cloud-worker and pirt cloud-admin: the other side of a unit of role cloud.
#include <fmt/core.h>
#include <unistd.h>

#include <csignal>
#include <map>
#include <memory>
#include <optional>
#include <span>

#include "characterize/machine/build_info.h"
#include "characterize/profile/store/reader.h"
#include "cli/commands.h"
#include "cli/long_run.h"
#include "cli/options/duration.h"
#include "cli/options/files.h"
#include "cli/options/models.h"
#include "cli/options/output.h"
#include "cli/options/own.h"
#include "cli/options/shipped.h"
#include "cli/options/values.h"
#include "scheduler/runtime/time_limit.h"
#include "workloads/backends/nats/service/worker_link.h"
#include "workloads/backends/registry.h"
#include "workloads/base/error.h"
#include "workloads/catalog/catalog.h"
#include "workloads/catalog/own_list.h"
#include "workloads/model/own_operation.h"
#include "workloads/recognition/scene_workload.h"
#include "workloads/recognition/specs.h"

namespace pirt::cli {
namespace {

struct CloudFlags {
  OwnFiles own;
  cloud::ConnectionOptions connection;
  std::string name;
  std::string unit = "cpu";
  int slots = 1;
  std::int64_t cache_mb = 512, robot_mb = 512;
  std::string call_limit = "60s";
  std::optional<std::string> profile;
  ModelFlags model, classifier;
  std::vector<std::string> robots = {"robot"};
};

void add_connection(Command& command, cloud::ConnectionOptions& connection) {
  add_text(command, "--server", &connection.server, "URL",
           "The NATS server, nats://HOST:PORT, or tls://HOST:PORT")
      .shows_default();
  command.add_flag("--insecure", connection.insecure,
                   "Speak to a server beyond this machine without TLS: anybody on the way can read "
                   "and change tasks");
  add_input(command, "--ca", &connection.ca, "Certificates that the server's has to follow from");
  const Option certificate =
      add_input(command, "--certificate", &connection.certificate, "Of this client");
  const Option key = add_input(command, "--key", &connection.key, "Of the certificate");
  certificate.needs(key);
  key.needs(certificate);
  const Option nkey = add_text(command, "--nkey", &connection.nkey, "KEY",
                               "Public NKey of this client, in place of a certificate");
  const Option seed = add_input(command, "--nkey-seed", &connection.nkey_seed, "Its seed");
  nkey.needs(seed);
  seed.needs(nkey);
}

void add_computing(Command& command, CloudFlags& options) {
  add_workloads(command, options.own);
  add_text(command, "--units", &options.unit, "UNIT",
           "What computes: a backend of `pirt list backends`")
      .offers(offer_backends())
      .shows_default();
  add_value(
      command, "--cache-mb", &options.cache_mb, "NUMBER", not_within<std::int64_t>(1, 1'000'000),
      "What a slot keeps of parameters and kernels, and what a call's tensors may have, in MB")
      .shows_default();
  add_model(command, options.model, "",
            "a detector, to describe the scenes of robots that have the same models");
  add_fit(command, options.model);
  add_model(command, options.classifier, "classifier", "the classifier of those robots");
  command.option("--classifier").needs(command.option("--model"));
}

/// @throws Error{kEnvironment} in a build without the cloud.
void check_built() {
  const Probe probe = find_backend("nats").probe();
  if (!probe.available) throw_environment("backend nats is unavailable: " + probe.reason);
}

/// By the user's models, in the size that is announced.
std::optional<Workload> description(const CloudFlags& options) {
  if (!options.model.model) return std::nullopt;
  recognition::SceneModels models{.detector = options.model.options()};
  if (options.classifier.model) models.classifier = options.classifier.options();
  return recognition::make_describe(models, recognition::kPictureWidth,
                                    recognition::kPictureHeight);
}

/// Something that two workers do not share.
std::string default_name() {
  char host[64] = "host";
  static_cast<void>(::gethostname(host, sizeof host - 1));
  return fmt::format("{}-{}", host, ::getpid());
}

/// @param own  May be none; else there as long as what is returned.
std::vector<const Workload*> known_on(const Backend& backend, const std::optional<Workload>& own) {
  std::vector<const Workload*> known;
  for (const Workload& each : catalog()) known.push_back(&each);
  for (const Workload* each : own_workloads()) known.push_back(each);
  for (const Variant& variant : variants()) {
    for (const Workload* each : workloads_in_variant(variant.name)) known.push_back(each);
  }
  if (own) known.push_back(&*own);
  std::erase_if(known, [&](const Workload* each) { return !backend.supports(*each).ok; });
  if (own && (known.empty() || known.back() != &*own)) {
    throw_bad_input("scenes are described on backend cpu; leave --model out, or --units");
  }
  return known;
}

/// Of those that the profile has rows of, in the size in which they are known.
std::map<const Workload*, Nanos> call_limits(const CloudFlags& options,
                                             std::span<const Workload* const> known) {
  std::map<const Workload*, Nanos> limits;
  if (!options.profile) return limits;
  const Profile profile = ProfileReader(*options.profile).read();
  const auto longest = [&](const Workload& workload, Phase phase) {
    const PhaseRow* const row = profile.find(workload.name, options.unit, phase);
    return row != nullptr ? row->p99 : std::nullopt;  // Also of a busy machine: it is a limit.
  };
  for (const Workload* each : known) {
    const auto call = longest(*each, Phase::kCall);
    if (!call) continue;
    const OwnOperation* const own = own_operation(*each);
    const Nanos least = kLeastTimeLimit + (own != nullptr ? own->ends_by_itself : Nanos::zero());
    limits[each] =
        time_limit(*call + longest(*each, Phase::kPrepare).value_or(Nanos::zero()), least);
  }
  if (limits.empty()) {
    throw_bad_input("profile '" + *options.profile + "' has no rows of unit " + options.unit +
                    "; measure it here (pirt characterize), or leave --profile out");
  }
  return limits;
}

/// What every process of it is.
std::vector<std::string> slot_command(const CloudFlags& options) {
  std::vector<std::string> command = {"/proc/self/exe", "cloud-slot",
                                      "--units",        options.unit,
                                      "--cache-mb",     std::to_string(options.cache_mb)};
  for (const std::string& file : options.own.all()) {
    command.insert(command.end(), {"--workloads", file});
  }
  for (const auto& more :
       {options.model.arguments(""), options.classifier.arguments("classifier")}) {
    command.insert(command.end(), more.begin(), more.end());
  }
  return command;
}

/// @throws Error{kBadInput} for what is no unit of this machine's.
const Backend& computing_backend(const CloudFlags& options) {
  if (options.unit == "nats") {
    throw_bad_input("a worker computes itself; name cpu, or another unit of its machine");
  }
  return find_backend(options.unit);
}

/// A process of a worker's: what it computes may crash.
int work_in_slot(const CloudFlags& options) {
  // Its worker ends it, and lets it finish, also where all of a service hears them.
  for (const int each : {SIGINT, SIGTERM, SIGHUP}) std::signal(each, SIG_IGN);
  check_built();
  load(options.own.all());
  const Backend& backend = computing_backend(options);
  const auto bytes = static_cast<std::uint64_t>(options.cache_mb) << 20;
  const auto computer = cloud::make_device_computer(
      backend, {.unit = options.unit, .cores = {}, .device = {}, .script = {}}, bytes);
  const auto own = description(options);
  const auto known = known_on(backend, own);
  return cloud::serve_computer(*computer, cloud::Admission(known, bytes)) ? 0 : kExitEnvironment;
}

int work(const CloudFlags& options) {
  check_built();
  learn(options.own.all());
  const Backend& backend = computing_backend(options);
  if (const Probe probe = backend.probe(); !probe.available) throw_environment(probe.reason);
  const auto own = description(options);
  const auto known = known_on(backend, own);
  const auto limits = call_limits(options, known);
  const auto limit_of = [&limits,
                         other = parse_duration(options.call_limit)](const Workload& each) {
    const auto row = limits.find(&each);
    return row != limits.end() ? row->second : other;
  };
  cloud::WorkerOptions worker{.connection = options.connection,
                              .name = options.name.empty() ? default_name() : options.name,
                              .version = std::string(build_info().version),
                              .limits = {.slots = options.slots},
                              .call_bytes = static_cast<std::uint64_t>(options.cache_mb) << 20,
                              .make_computer = [&options, limit_of] {
                                return cloud::make_process_computer(
                                    {.command = slot_command(options), .call_limit = limit_of});
                              }};
  // Whether they are models that can be run shows now, and not at the first task.
  if (own) static_cast<void>(recognition::open_described(*own));
  const std::atomic<bool>* const stop = stop_on_signal();
  cloud::serve(
      worker, known, [stop] { return stop->load(); },
      [](const std::string& line) {
        try {
          emit_text(line + "\n", {});
        } catch (const Error&) {  // A full disk under what it says is no end of a service.
        }
      });
  return 0;
}

int administer(const CloudFlags& options, bool sets_up) {
  check_built();
  if (!sets_up) {
    emit_text(cloud::permissions(options.robots), {});
    return 0;
  }
  const auto done = cloud::administer(
      options.connection, {.robots = options.robots,
                           .robot_bytes = static_cast<std::uint64_t>(options.robot_mb) << 20});
  for (const std::string& line : done) emit_text(line + "\n", {});
  return 0;
}

}  // namespace

void add_cloud_worker(CLI::App& app, Action& action) {
  auto options = std::make_shared<CloudFlags>();
  Command command(app, "cloud-worker", "Compute the tasks that robots send to the cloud");
  add_connection(command, options->connection);
  add_computing(command, *options);
  add_value(command, "--slots", &options->slots, "NUMBER", not_within(1, 256),
            "Tasks at a time; the others stay with their robots")
      .shows_default();
  add_value(command, "--call-limit", &options->call_limit, "DURATION", no_duration,
            "How long a call may take; then its process is killed, and the call has failed a try")
      .shows_default();
  add_input(command, "--profile", &options->profile,
            "Profile database of this machine: a call may take 50 times what its row says, at "
            "least 5 s; those without a row have --call-limit");
  add_text(command, "--name", &options->name, "NAME",
           "Of this worker; default: the machine's and the process's");
  command.footer(
      "Ends on Ctrl-C: what it computes is finished, or given back to its robot after 5 s.\n"
      "Example: pirt cloud-worker --server nats://127.0.0.1:4222 --slots 2");
  command.runs(action, [options] { return work(*options); });
}

void add_cloud_slot(CLI::App& app, Action& action) {
  auto options = std::make_shared<CloudFlags>();
  Command command(app, "cloud-slot", "Computes what a cloud-worker hands to it");
  command.hide();
  add_computing(command, *options);
  command.runs(action, [options] { return work_in_slot(*options); });
}

void add_cloud_admin(CLI::App& app, Action& action) {
  auto options = std::make_shared<CloudFlags>();
  auto what = std::make_shared<std::string>();
  Command command(app, "cloud-admin",
                  "Make a NATS server ready for workers and robots, or say what each may do there");
  add_choice(command, "what", what.get(), "WHAT", {"setup", "permissions"},
             "setup: makes the robots' streams that are missing; permissions: writes the "
             "`authorization` part of the server's configuration")
      .required();
  add_connection(command, options->connection);
  add_list_of(command, "--robots", options->robots, "NAME,...", "The robots that there are")
      .shows_default();
  add_value(command, "--robot-mb", &options->robot_mb, "NUMBER",
            not_within<std::int64_t>(1, 1'000'000),
            "What each robot may have on the server of calls and parameters that are larger than a "
            "message, in MB")
      .shows_default();
  command.footer(
      "Example: pirt cloud-admin permissions --robots r1,r2 > permissions.conf\n"
      "         pirt cloud-admin setup --server nats://admin:PASSWORD@127.0.0.1:4222 --robots "
      "r1,r2");
  command.runs(action, [options, what] { return administer(*options, *what == "setup"); });
}

}  // namespace pirt::cli
