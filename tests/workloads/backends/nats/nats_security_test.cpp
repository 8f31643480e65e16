// Who may say what to a real server, and whom robots and workers speak to.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <fstream>
#include <sstream>

#include "tests/support/paths.h"
#include "tests/workloads/backends/nats/nats_server.h"
#include "workloads/backends/nats/wire/wire.h"
#include "workloads/base/error.h"
#include "workloads/base/text/json.h"
#include "workloads/model/remote.h"

namespace pirt::cloud::test {
namespace {

using namespace std::chrono_literals;
using ::testing::HasSubstr;
constexpr Nanos kLong = 30s;

std::string fault_of(const ConnectionOptions& options) {
  try {
    check_connection(options);
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kBadInput);
    return error.what();
  }
  return "";
}

TEST(CloudConnection, IsRefusedBeyondThisMachineWithoutTls) {
  for (const char* loopback : {"nats://127.0.0.1:4222", "nats://localhost", "nats://[::1]:4222",
                               "nats://u:p@127.1.2.3:1"}) {
    EXPECT_EQ(fault_of({.server = loopback}), "") << loopback;
  }
  for (const char* beyond :
       {"nats://10.0.0.1:4222", "nats://robots.example:4222", "nats://127.0.0.1.example.org:4222",
        "nats://[::2]:4222", "nats://127.0.0.1@example.org:4222", "nats://localhost.example:1"}) {
    EXPECT_THAT(fault_of({.server = beyond}), HasSubstr("without TLS")) << beyond;
    EXPECT_EQ(fault_of({.server = beyond, .insecure = true}), "") << beyond;
  }
  EXPECT_EQ(fault_of({.server = "tls://robots.example:4222"}), "");
}

// As with `ca`: a certificate is shown to nobody without TLS.
TEST(CloudConnection, HasTlsWhereItHasACertificate) {
  const std::string file = pirt::test::kSourceFolder + std::string("/README.md");
  EXPECT_EQ(fault_of({.server = "nats://10.0.0.1:4222", .certificate = file, .key = file}), "");
}

TEST(CloudConnection, TellsNobodyItsPassword) {
  EXPECT_EQ(public_url("nats://robot:secret@127.0.0.1:4222"), "nats://127.0.0.1:4222");
  EXPECT_EQ(public_url("tls://robots.example"), "tls://robots.example");
  EXPECT_EQ(fault_of({.server = "nats://robot:secret@10.0.0.1"}).find("secret"), std::string::npos);
  for (const char* wrong : {"http://robot:secret@10.0.0.1", "robot:secret@10.0.0.1:4222",
                            "nats:robot:secret@10.0.0.1", "robot:secret@nats://10.0.0.1"}) {
    EXPECT_EQ(fault_of({.server = wrong}).find("secret"), std::string::npos) << wrong;
  }
}

// libnats 3.4.1 never comes back from there.
TEST(CloudConnection, IsGivenUpWhereAServerFallsSilentHalfWay) {
  MuteServer server;
  const Connection connection({.server = server.url()}, {});
  server.greet();
  EXPECT_TRUE(eventually([&] {
    return connection.why_down().find("it does not answer; is it stopped") != std::string::npos;
  })) << connection.why_down();
}

TEST(CloudConnection, NamesWhatIsNoServer) {
  for (const char* wrong :
       {"", "4222", "http://127.0.0.1", "nats://", "nats://127.0.0.1:0", "nats://127.0.0.1:99999",
        "nats://127.0.0.1:x", "nats://127.0.0.1/a", "nats://[::1", "nats://127.0.0.1:"}) {
    EXPECT_THAT(fault_of({.server = wrong}), HasSubstr("a server is nats://HOST:PORT")) << wrong;
  }
  EXPECT_THAT(fault_of({.server = "tls://h", .ca = "/nowhere/ca.pem"}),
              HasSubstr("'/nowhere/ca.pem' is no file"));
  EXPECT_THAT(fault_of({.server = "tls://h", .nkey = "U"}), HasSubstr("belong together"));
}

class CloudPermissions : public ::testing::Test {
 protected:
  void SetUp() override {
    if (nats_server_program().empty()) GTEST_SKIP() << "skipped: nats-server is not installed";
    const std::vector<std::string> robots = {"r1", "r2"};
    server_ = std::make_unique<NatsServer>(permissions(robots));
    ASSERT_TRUE(
        server_->start({"PIRT_ADMIN=a", "PIRT_WORKER=w", "PIRT_ROBOT_R1=one", "PIRT_ROBOT_R2=two"}))
        << server_->log();
    admin_ = connect("admin", "a", "_INBOX");
    ASSERT_TRUE(admin_->wait_until_up(kLong)) << server_->log();
    set_up(*admin_, {.robots = robots});
  }

  [[nodiscard]] std::string url_of(const std::string& user, const std::string& password) const {
    return "nats://" + user + ":" + password + "@127.0.0.1:" + std::to_string(server_->port());
  }
  [[nodiscard]] std::unique_ptr<Connection> connect(const std::string& user,
                                                    const std::string& password,
                                                    const std::string& inbox) const {
    return std::make_unique<Connection>(
        ConnectionOptions{.server = url_of(user, password), .inbox = inbox},
        Connection::Listener{});
  }
  std::int64_t messages(const std::string& stream) {
    const auto answer = admin_->request("$JS.API.STREAM.INFO." + stream, {}, 5s);
    return parse_json(text_of(answer.data)).at("state").at("messages").get<std::int64_t>();
  }

  std::unique_ptr<NatsServer> server_;
  std::unique_ptr<Connection> admin_;
};

TEST(CloudPermissionFile, IsWhatTheCommandWrites) {
  std::ostringstream file;
  file << std::ifstream(std::string(pirt::test::kSourceFolder) +
                        "/workloads/backends/nats/link/permissions.conf")
              .rdbuf();
  const std::vector<std::string> robots = {"robot"};
  EXPECT_EQ(file.str(), permissions(robots));
}

TEST_F(CloudPermissions, LetARobotAndAWorkerDoAllThatTheyNeed) {
  const Workload small = adding("small", 1000), large = adding("large", 3'000'000),
                 weighed = adding("weighed", 100, 1'500'000);
  const std::vector<const Workload*> known = {&small, &large, &weighed};
  const WorkerLink worker(worker_options(url_of("worker", "w")), known);
  const auto device = open_unit(url_of("r1", "one"), "robot: r1");
  for (const Workload* each : known) {
    const std::uint8_t parameter = each->parameters.empty() ? 0 : 2;
    const auto kernel = device->prepare(*each, parameters_of(*each, parameter));
    EXPECT_EQ(call_and_check(*kernel, *each, {.value = 5}, parameter), "") << each->name;
  }
  EXPECT_EQ(worker.connection().problem(), "");
  EXPECT_EQ(server_->log().find("Violation"), std::string::npos) << server_->log();
}

TEST_F(CloudPermissions, BindARobotToItsOwnSubjects) {
  const auto robot = connect("r2", "two", "_INBOX_r2");
  ASSERT_TRUE(robot->wait_until_up(kLong));
  std::atomic<int> heard = 0;
  const auto hears = [&](const std::string& what) {
    admin_->subscribe(what, [&](const Incoming&) { ++heard; });
  };
  for (const char* each : {"pirt.offer.r1", "pirt.task.r1.*", "pirt.cancel.r1", "pirt.answer.*",
                           "pirt.claim.*", "pirt.hello", "pirt.blob.r1.>"}) {
    hears(each);
  }
  std::atomic<int> spied = 0;
  for (const char* each : {"pirt.claim.r1", "pirt.answer.r1", "_INBOX.>", "pirt.>"}) {
    robot->subscribe(each, [&](const Incoming&) { ++spied; });
  }
  const Bytes frame = encode(CancelMessage{{1, 2}});
  for (const char* each :
       {"pirt.offer.r1", "pirt.task.r1.a", "pirt.cancel.r1", "pirt.answer.r2", "pirt.claim.r2",
        "pirt.hello", "pirt.blob.r1.par.x.0", "pirt.blob.r2.out.x.0", "_INBOX.x"}) {
    robot->publish(each, frame);
  }
  const auto refused = [&](const std::string& subject, std::string_view text = "") {
    return !robot->request(subject, std::as_bytes(std::span(text)), 300ms).came;
  };
  EXPECT_TRUE(refused("$JS.API.STREAM.PURGE.PIRT_r1"));
  EXPECT_TRUE(refused("$JS.API.STREAM.DELETE.PIRT_r2"));
  EXPECT_TRUE(refused("$JS.API.STREAM.CREATE.MINE", R"({"name":"MINE"})"));
  EXPECT_TRUE(refused("$JS.API.STREAM.MSG.GET.PIRT_r1", R"({"seq":1})"));
  EXPECT_TRUE(refused("$JS.API.DIRECT.GET.PIRT_r1.pirt.blob.r1.par.x.0"));
  EXPECT_EQ(messages("PIRT_r1"), 0);
  // Its own it may.
  EXPECT_TRUE(robot->request("pirt.blob.r2.par.x.0", frame, 5s).came);
  EXPECT_EQ(messages("PIRT_r2"), 1);
  EXPECT_TRUE(robot->request("$JS.API.STREAM.PURGE.PIRT_r2", {}, 5s).came);
  EXPECT_EQ(messages("PIRT_r2"), 0);
  admin_->publish("pirt.answer.r1", frame);
  EXPECT_TRUE(admin_->request("$JS.API.INFO", {}, 5s).came);
  std::this_thread::sleep_for(50ms);
  EXPECT_EQ(heard, 1) << "what the administrator itself said";
  EXPECT_EQ(spied, 0);
  EXPECT_THAT(server_->log(), HasSubstr("Violation"));
}

TEST(CloudPermissionNames, OfTwoRobotsAreTwoUsers) {
  const auto problem = [](const std::vector<std::string>& robots) {
    return error_of([&] { static_cast<void>(permissions(robots)); });
  };
  EXPECT_EQ(problem({"r1", "r2"}), "");
  EXPECT_THAT(problem({"r-1", "r_1"}), HasSubstr("would have one password, $PIRT_ROBOT_R_1"));
  EXPECT_THAT(problem({"r1", "R1"}), HasSubstr("would have one password"));
  EXPECT_THAT(problem({"r1", "r1"}), HasSubstr("would have one password"));
  EXPECT_THAT(problem({"admin"}), HasSubstr("would be another user"));
  EXPECT_THAT(problem({"Worker"}), HasSubstr("would be another user"));
}

// The server answers where it is told to, whoever may publish there. What a robot has made a worker
// store would be another robot's offer, task or answer.
TEST_F(CloudPermissions, ARobotSaysNothingInAnothersNameByTheServersAnswers) {
  const Workload small = adding("small", 1000);
  const std::vector<const Workload*> known = {&small};
  const WorkerLink worker(worker_options(url_of("worker", "w")), known);
  const auto device = open_unit(url_of("r1", "one"), "robot: r1");
  const auto kernel = device->prepare(small, {});
  std::atomic<int> stolen = 0;
  admin_->subscribe("pirt.claim.r1", [&](const Incoming& message) {
    stolen += is_frame_of<ClaimMessage>(message.data) ? 1 : 0;
  });
  const std::string offer(text_of(encode(OfferMessage{7, 99})));
  ASSERT_TRUE(admin_->request("pirt.blob.r2.out.x.0", std::as_bytes(std::span(offer))).came);
  const RawClient robot(server_->port(), "r2", "two");
  for (const char* victim : {"pirt.offer.r1", "pirt.answer.r1", "pirt.claim.r1", "pirt.hello"}) {
    robot.publish("$JS.API.DIRECT.GET.PIRT_r2.pirt.blob.r2.out.x.0", {}, victim);
    robot.publish("pirt.blob.r2.in.x.0", {}, victim);
    robot.publish("$JS.API.STREAM.INFO.PIRT_r2", {}, victim);
  }
  robot.flush();
  EXPECT_TRUE(eventually([&] { return worker.counts().malformed >= 2; }))
      << "answers without headers are no messages";
  EXPECT_EQ(stolen, 0) << "the worker took the offer for the other robot's";
  EXPECT_EQ(call_and_check(*kernel, small, {.value = 5}), "");
  EXPECT_EQ(dynamic_cast<const Remote&>(*device).link().late_replies, 0);
}

// The key pair is the one that the documentation of NATS prints.
TEST(CloudNKey, LetsInWhoHasTheSeedAndNobodyElse) {
  if (nats_server_program().empty()) GTEST_SKIP() << "skipped: nats-server is not installed";
  const std::string key = "UDXU4RCSJNZOIQHZNWXHXORDPRTGNJAHAHFRGZNEEJCPQTT2M7NLCNF4";
  NatsServer server("authorization { users = [ { nkey: " + key +
                    ", permissions: { publish: { allow: [\"pirt.offer.r1\", \"$JS.API.INFO\"] }, "
                    "subscribe: { allow: [\"_INBOX.>\"] } } } ] }\n");
  const auto file = [&](const std::string& name, const std::string& text) {
    std::ofstream(server.folder() / name) << text;
    return (server.folder() / name).string();
  };
  const ConnectionOptions right{
      .server = server.url(),
      .nkey_seed = file("seed", "SUACSSL3UAHUDXKFSNVUZRF5UHPMWZ6BFDTJ7M6USDXIEDNPPQYYYCU3VY"),
      .nkey = key};
  ASSERT_TRUE(server.start()) << server.log();
  Connection good(right, {});
  ASSERT_TRUE(good.wait_until_up(kLong)) << server.log();
  EXPECT_TRUE(good.request("$JS.API.INFO", {}, 5s).came);
  good.publish("pirt.offer.r2", Bytes(3));
  EXPECT_TRUE(good.request("$JS.API.INFO", {}, 5s).came);
  EXPECT_THAT(server.log(), HasSubstr("pirt.offer.r2")) << "it may not, and the server says so";
  ConnectionOptions nobody = right;
  nobody.nkey = nobody.nkey_seed = "";
  EXPECT_FALSE(Connection(nobody, {}).wait_until_up(1s)) << "no key";
  ConnectionOptions other = right;
  other.nkey_seed = file("other", "SUAMLK2ZNL35WSMW37E7UD4VZ7ELPKW7DHC3BWBSD2GCZ7IUQQXZIORRBU");
  EXPECT_FALSE(Connection(other, {}).wait_until_up(1s)) << "another's seed";
}

TEST(CloudTls, VerifiesTheServerAndShowsTheClientsCertificate) {
  if (nats_server_program().empty()) GTEST_SKIP() << "skipped: nats-server is not installed";
  if (std::system("openssl version > /dev/null 2>&1") != 0) {  // NOLINT: a test's tool
    GTEST_SKIP() << "skipped: openssl, which makes the certificates, is not installed";
  }
  NatsServer server(
      R"(tls { cert_file: "cert.pem", key_file: "key.pem", ca_file: "cert.pem", verify: true }
)");
  const auto in = [&](const std::string& name) { return (server.folder() / name).string(); };
  const auto make = [&](const std::string& name) {
    const std::string command =
        "openssl req -x509 -newkey rsa:2048 -nodes -days 2 -subj /CN=" + name +
        " -addext subjectAltName=DNS:localhost -keyout " + in(name + "key.pem") + " -out " +
        in(name + "cert.pem") + " > /dev/null 2>&1";
    return std::system(command.c_str()) == 0;  // NOLINT
  };
  ASSERT_TRUE(make(""));
  ASSERT_TRUE(make("other"));
  std::filesystem::current_path(server.folder());
  const bool started = server.start();
  std::filesystem::current_path(pirt::test::kSourceFolder);
  ASSERT_TRUE(started) << server.log();
  const std::string url = "tls://localhost:" + std::to_string(server.port());
  const ConnectionOptions right{
      .server = url, .ca = in("cert.pem"), .certificate = in("cert.pem"), .key = in("key.pem")};
  Connection good(right, {});
  EXPECT_TRUE(good.wait_until_up(kLong)) << server.log();
  ConnectionOptions wrong_ca = right;
  wrong_ca.ca = in("othercert.pem");
  Connection other(wrong_ca, {});
  EXPECT_FALSE(other.wait_until_up(1s)) << "another server's certificate";
  EXPECT_TRUE(eventually([&] {
    return other.why_down().find("no TLS with it; its certificate has to") != std::string::npos;
  })) << other.why_down();
  ConnectionOptions wrong_host = right;
  wrong_host.server = "tls://127.0.0.1:" + std::to_string(server.port());
  EXPECT_FALSE(Connection(wrong_host, {}).wait_until_up(1s)) << "it is localhost's";
  ConnectionOptions nobody = right;
  nobody.certificate = nobody.key = "";
  EXPECT_FALSE(Connection(nobody, {}).wait_until_up(1s)) << "no certificate";
  const ConnectionOptions plain{.server = "nats://127.0.0.1:" + std::to_string(server.port())};
  EXPECT_FALSE(Connection(plain, {}).wait_until_up(1s)) << "no TLS";
}

}  // namespace
}  // namespace pirt::cloud::test
