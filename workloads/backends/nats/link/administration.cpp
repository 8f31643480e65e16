#include "workloads/backends/nats/link/administration.h"

#include <fmt/core.h>

#include <algorithm>
#include <cctype>
#include <map>
#include <string>
#include <utility>

#include "workloads/backends/nats/wire/subjects.h"
#include "workloads/base/error.h"

namespace pirt::cloud {
namespace {

constexpr int kNameExists = 10058;

/// @throws Error{kEnvironment} where nobody answers.
StreamAnswer ask_server(Connection& connection, const std::string& api, const Json& what) {
  const auto answer = connection.request("$JS.API." + api, json_text(what));
  if (!answer.came) {
    throw_environment("the server did not answer to " + api +
                      "; is it there, and may this user ask that (pirt cloud-admin permissions)?");
  }
  StreamAnswer read = read_answer(answer);
  if (read.error == kNobody) throw_environment(read.why);
  return read;
}

/// Whether it has all that was asked for.
bool is_within(const Json& asked, const Json& is) {
  return std::ranges::all_of(asked.items(), [&](const JsonMember& each) {
    return is.contains(each.key) && is.at(each.key) == each.value;
  });
}

/// What is oldest goes first, and what is older than an hour: its robot sends it again, or is gone.
/// A blob has no more small chunks, its last one, than others: what says else would fill the
/// server's memory with their subjects.
Json stream_of(const std::string& robot, const Setup& setup) {
  return {{"name", blob_stream(robot)},
          {"subjects", Json(std::vector<std::string>{blob_subject(robot, "*", "*.*")})},
          {"retention", "limits"},
          {"max_msgs_per_subject", 1},
          {"max_bytes", setup.robot_bytes},
          {"max_msgs", 2 * (setup.robot_bytes / kLeastChunkBytes + 1)},
          {"max_age", Nanos(std::chrono::hours(1)).count()},
          {"discard", "old"},
          {"allow_direct", true},
          {"storage", "file"},
          {"num_replicas", 1}};
}

std::string make_stream(Connection& connection, const std::string& robot, const Setup& setup) {
  const Json config = stream_of(robot, setup);
  const std::string name = blob_stream(robot);
  const StreamAnswer known = ask_server(connection, "STREAM.INFO." + name, Json::object());
  if (known.error != 0 && known.error != kNoStream) throw_environment(name + ": " + known.why);
  if (known.error == 0 && is_within(config, known.json.at("config"))) return "";
  const char* const api = known.error == 0 ? "STREAM.UPDATE." : "STREAM.CREATE.";
  const StreamAnswer made = ask_server(connection, api + name, config);
  if (made.error == kNameExists) return "";  // Another one was faster.
  if (made.error != 0) {
    throw_environment(fmt::format(
        "stream {} of {} MB: {}; or give each robot less (pirt cloud-admin setup --robot-mb); if "
        "it was made otherwise, remove it first",
        name, setup.robot_bytes >> 20, made.why));
  }
  return (known.error == 0 ? "changed stream " : "made stream ") + name;
}

// A password is an environment variable of the server.
constexpr const char* kUsers = R"(# Who may say what (pirt cloud-admin permissions).
authorization {
  users = [
    { user: "admin", password: $PIRT_ADMIN }
    { user: "worker", password: $PIRT_WORKER, permissions: {
        publish: { allow: ["pirt.hello", "pirt.claim.*", "pirt.answer.*", "pirt.blob.*.out.*.*", "$JS.API.DIRECT.GET.*.pirt.blob.*.in.*.*", "$JS.API.DIRECT.GET.*.pirt.blob.*.par.*.*"] }
        subscribe: { allow: ["pirt.offer.*", "pirt.task.*.*", "pirt.cancel.*", "_INBOX.>"] } } }
)";
constexpr const char* kRobotUser = R"(    {{ user: "{0}", password: $PIRT_ROBOT_{1}, permissions: {{
        publish: {{ allow: ["pirt.offer.{0}", "pirt.task.{0}.*", "pirt.cancel.{0}", "pirt.blob.{0}.in.*.*", "pirt.blob.{0}.par.*.*", "$JS.API.STREAM.INFO.PIRT_{0}", "$JS.API.STREAM.PURGE.PIRT_{0}", "$JS.API.DIRECT.GET.PIRT_{0}.pirt.blob.{0}.out.*.*"] }}
        subscribe: {{ allow: ["pirt.hello", "pirt.claim.{0}", "pirt.answer.{0}", "_INBOX_{0}.>"] }} }} }}
)";

}  // namespace

std::vector<std::string> set_up(Connection& connection, const Setup& setup) {
  for (const std::string& robot : setup.robots) check_robot_name(robot);
  std::vector<std::string> done;
  for (const std::string& robot : setup.robots) {
    if (std::string line = make_stream(connection, robot, setup); !line.empty()) {
      done.push_back(std::move(line));
    }
  }
  return done;
}

std::vector<std::string> administer(const ConnectionOptions& options, const Setup& setup) {
  Connection connection(options, {});
  if (!connection.wait_until_up(Connection::kAnswer)) {
    throw_environment("no connection to server " + public_url(options.server) + ": " +
                      connection.why_down());
  }
  return set_up(connection, setup);
}

StreamAnswer read_answer(const Connection::Answer& answer) {
  if (answer.status == kNobody) {
    return {.error = kNobody, .why = "the server has no JetStream; start it with -js"};
  }
  StreamAnswer read{try_parse_json(text_of(answer.data)).value_or(Json()), 1, {}};
  if (!read.json.is_object()) {
    read.why = "an answer that is none of JetStream's";
  } else if (!read.json.contains("error")) {
    read.error = 0;
  } else {
    const Json& error = read.json.at("error");
    const auto said = [&](const char* key) { return error.contains(key) ? error.at(key) : Json(); };
    const Json code = said("err_code"), why = said("description");
    read.error = code.is_number_integer() ? code.get<int>() : 1;
    read.why = why.is_string() ? why.get<std::string>() : "refused";
  }
  const auto says = [&](const char* what) { return read.why.find(what) != std::string::npos; };
  if (says("not enabled for account")) {
    read.why += "; enable it there (accounts: { NAME: { jetstream: enabled } })";
  } else if (says("not enabled")) {
    read.why += "; the server has no JetStream; start it with -js";
  } else if (says("resources") || says("maximum")) {
    read.why += "; give JetStream more room (max_file_store, the account's limits)";
  }
  return read;
}

std::string permissions(std::span<const std::string> robots) {
  std::string text = kUsers;
  std::map<std::string, std::string> variables;
  for (const std::string& robot : robots) {
    check_robot_name(robot);
    std::string variable = robot;
    for (char& c : variable) {
      c = c == '-' ? '_' : static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
    }
    if (variable == "ADMIN" || variable == "WORKER") {
      throw_bad_input("robot '" + robot + "' would be another user; call it otherwise");
    }
    if (const auto [other, is_new] = variables.emplace(variable, robot); !is_new) {
      throw_bad_input("robots '" + other->second + "' and '" + robot +
                      "' would have one password, $PIRT_ROBOT_" + variable +
                      "; call one of them otherwise");
    }
    text += fmt::format(fmt::runtime(kRobotUser), robot, variable);
  }
  return text + "  ]\n}\n";
}

}  // namespace pirt::cloud
