#include "workloads/backends/nats/link/administration.h"

#include <fmt/core.h>

#include <algorithm>
#include <utility>

#include "workloads/backends/nats/wire/subjects.h"
#include "workloads/base/error.h"
#include "workloads/base/text/json.h"

namespace pirt::cloud {
namespace {

constexpr std::int64_t kDay = std::chrono::nanoseconds(std::chrono::hours(24)).count();
constexpr int kStreamNameExists = 10058;
constexpr const char* kConsumerDelivered = "deliver_subject";

struct Answer {
  Json json;
  int error = 0;  ///< JetStream's code; 0 = none.
  std::string description = {};
};

Answer ask(Connection& connection, const std::string& api, const Json& what) {
  const auto answer = connection.request("$JS.API." + api, json_text(what), Connection::kAnswer);
  if (!answer.came) {
    throw_environment("the server did not answer to " + api +
                      "; is it there, and may this user ask that (pirt cloud-admin permissions)?");
  }
  if (answer.status != 0) {
    throw_environment("the server has no JetStream; start it with -js, or `jetstream {}`");
  }
  auto json = try_parse_json(text_of(answer.data));
  if (!json || !json->is_object()) {
    throw_environment("the server's answer to " + api + " is no JSON");
  }
  Answer read{*std::move(json)};
  if (read.json.contains("error") && read.json.at("error").is_object()) {
    const Json& error = read.json.at("error");
    read.error = error.value("err_code", 1);
    read.description = error.value("description", "refused");
  }
  return read;
}

Json stream(const std::string& name, const std::vector<std::string>& subjects, const Setup& setup,
            std::uint64_t bytes) {
  return {{"name", name},
          {"subjects", Json(subjects)},
          {"retention", "workqueue"},
          {"max_consumers", -1},
          {"max_msgs", -1},
          {"max_msgs_per_subject", -1},
          {"max_bytes", bytes},
          {"max_age", 7 * kDay},
          {"max_msg_size", -1},
          {"discard", "new"},
          {"storage", setup.in_memory ? "memory" : "file"},
          {"num_replicas", 1},
          {"duplicate_window", std::chrono::nanoseconds(std::chrono::minutes(2)).count()}};
}

/// Whether it has all that was asked for.
bool is_within(const Json& asked, const Json& is) {
  return std::ranges::all_of(asked.items(), [&](const JsonMember& each) {
    return is.contains(each.key) && is.at(each.key) == each.value;
  });
}

std::string make_stream(Connection& connection, const Json& config) {
  const auto name = config.at("name").get<std::string>();
  const Answer known = ask(connection, "STREAM.INFO." + name, Json::object());
  if (known.error == 0) {
    if (is_within(config, known.json.at("config"))) return "";
  }
  const std::string api = known.error == 0 ? "STREAM.UPDATE." : "STREAM.CREATE.";
  const Answer made = ask(connection, api + name, config);
  if (made.error == kStreamNameExists) return "";  // Another one was faster.
  if (made.error != 0) {
    throw_environment("stream " + name + ": " + made.description +
                      "; if it was made otherwise, remove it first");
  }
  return (known.error == 0 ? "changed stream " : "made stream ") + name;
}

std::string make_consumer(Connection& connection, const std::string& of, const Json& config) {
  const auto name = config.at("durable_name").get<std::string>();
  const Answer known = ask(connection, "CONSUMER.INFO." + of + "." + name, Json::object());
  if (known.error == 0) {
    if (is_within(config, known.json.at("config"))) return "";
  }
  const Answer made = ask(connection, "CONSUMER.DURABLE.CREATE." + of + "." + name,
                          {{"stream_name", of}, {"config", config}});
  if (made.error != 0) {
    throw_environment("consumer " + name + " of stream " + of + ": " + made.description);
  }
  return (known.error == 0 ? "changed consumer " : "made consumer ") + name + " of " + of;
}

Json consumer(const std::string& name, Nanos redelivered) {
  return {{"durable_name", name},     {"deliver_policy", "all"},
          {"ack_policy", "explicit"}, {"ack_wait", redelivered.count()},
          {"max_deliver", -1},        {"replay_policy", "instant"},
          {"max_ack_pending", 10000}};
}

}  // namespace

std::vector<std::string> set_up(Connection& connection, const Setup& setup) {
  for (const std::string& robot : setup.robots) {
    if (!is_robot_name(robot)) {
      throw_bad_input("robot '" + robot +
                      "' cannot be called that; a name is made of letters, digits, '_' and '-'");
    }
  }
  std::vector<std::string> done;
  const auto note = [&](std::string line) {
    if (!line.empty()) done.push_back(std::move(line));
  };
  note(make_stream(connection, stream(kTaskStream, {task_subject("*")}, setup, setup.task_bytes)));
  note(make_stream(connection, stream(kWithdrawStream, {withdraw_subject("*")}, setup,
                                      std::uint64_t{16} << 20)));
  note(make_stream(connection,
                   stream(kReplyStream, {reply_subject("*")}, setup, setup.reply_bytes)));
  Json blobs = stream(kBlobStream, {"pirt.in.*.*.*", "pirt.par.*.*.*", "pirt.out.*.*.*"}, setup,
                      setup.blob_bytes);
  blobs["retention"] = "limits";
  blobs["max_msgs_per_subject"] = 1;
  blobs["max_age"] = kDay;
  blobs["allow_direct"] = true;
  note(make_stream(connection, blobs));
  note(make_consumer(connection, kTaskStream, consumer(kWorkers, setup.redelivered)));
  note(make_consumer(connection, kWithdrawStream, consumer(kWorkers, setup.redelivered)));
  for (const std::string& robot : setup.robots) {
    Json replies = consumer(robot_consumer(robot), std::chrono::seconds(30));
    replies["filter_subject"] = reply_subject(robot);
    replies[kConsumerDelivered] = deliver_subject(robot);
    note(make_consumer(connection, kReplyStream, replies));
  }
  return done;
}

void remove_robot(Connection& connection, const std::string& robot) {
  const Answer removed =
      ask(connection, fmt::format("CONSUMER.DELETE.{}.{}", kReplyStream, robot_consumer(robot)),
          Json::object());
  if (removed.error != 0) throw_environment("robot " + robot + ": " + removed.description);
}

std::string what_is_missing(Connection& connection, const std::string& robot) {
  const std::string remedy = "; an administrator runs `pirt cloud-admin setup --robots " +
                             (robot.empty() ? "NAME,..." : robot) + "`";
  const std::string name = robot.empty() ? kWorkers : robot_consumer(robot);
  const char* const of = robot.empty() ? kTaskStream : kReplyStream;
  const Answer known =
      ask(connection, fmt::format("CONSUMER.INFO.{}.{}", of, name), Json::object());
  if (known.error == 0) return "";
  return fmt::format("consumer {} of stream {}: {}{}", name, of, known.description, remedy);
}

std::string permissions(std::span<const std::string> robots) {
  const auto list = [](const std::vector<std::string>& subjects) {
    std::string text = "[";
    for (const std::string& subject : subjects) {
      text += (text.size() > 1 ? ", \"" : "\"") + subject + "\"";
    }
    return text + "]";
  };
  const auto user = [&](const std::string& name, const std::string& variable,
                        const std::vector<std::string>& publish,
                        const std::vector<std::string>& subscribe) {
    return fmt::format(
        "    {{ user: \"{}\", password: ${}, permissions: {{\n"
        "        publish: {{ allow: {} }}\n"
        "        subscribe: {{ allow: {} }} }} }}\n",
        name, variable, list(publish), list(subscribe));
  };
  std::string text =
      "# Who may say what (pirt cloud-admin permissions). A password is an environment variable of "
      "the server.\n"
      "authorization {\n  users = [\n"
      "    { user: \"admin\", password: $PIRT_ADMIN }\n";
  text += user("worker", "PIRT_WORKER",
               {"pirt.reply.*", "pirt.running.*", "pirt.hello", "pirt.gone.*", "pirt.out.*.*.*",
                "$JS.API.CONSUMER.MSG.NEXT.PIRT_TASKS.workers",
                "$JS.API.CONSUMER.MSG.NEXT.PIRT_WITHDRAWN.workers",
                "$JS.API.CONSUMER.INFO.PIRT_TASKS.workers", "$JS.ACK.PIRT_TASKS.workers.>",
                "$JS.ACK.PIRT_WITHDRAWN.workers.>", "$JS.API.DIRECT.GET.PIRT_BLOBS.>",
                "$JS.API.STREAM.MSG.GET.PIRT_TASKS", "$JS.API.STREAM.MSG.DELETE.PIRT_TASKS",
                "$JS.API.STREAM.PURGE.PIRT_BLOBS"},
               {"_INBOX.>", "pirt.gone.*"});
  for (const std::string& robot : robots) {
    if (!is_robot_name(robot)) {
      throw_bad_input("robot '" + robot +
                      "' cannot be called that; a name is made of letters, digits, '_' and '-'");
    }
    std::string variable = "PIRT_ROBOT_";
    for (const char c : robot) {
      variable += c == '-' ? '_' : static_cast<char>(c >= 'a' && c <= 'z' ? c - 'a' + 'A' : c);
    }
    const std::string own = robot;
    text +=
        user(robot, variable,
             {task_subject(own), withdraw_subject(own), "pirt.in." + own + ".*.*",
              "pirt.par." + own + ".*.*",
              fmt::format("$JS.ACK.{}.{}.>", kReplyStream, robot_consumer(own)),
              fmt::format("$JS.API.CONSUMER.INFO.{}.{}", kReplyStream, robot_consumer(own)),
              fmt::format("$JS.API.DIRECT.GET.{}.pirt.out.{}.>", kBlobStream, own)},
             {deliver_subject(own), running_subject(own), kHelloSubject, "_INBOX_" + own + ".>"});
  }
  return text + "  ]\n}\n";
}

}  // namespace pirt::cloud
