#include "workloads/backends/nats/link/stream.h"

#include <fmt/core.h>

#include <algorithm>
#include <atomic>
#include <cctype>
#include <cstring>
#include <map>
#include <mutex>
#include <regex>
#include <thread>
#include <utility>

#include "nats_files.h"
#include "workloads/base/error.h"
#include "workloads/base/system/thread.h"

namespace pirt::cloud {
namespace {

constexpr std::uint32_t kWindow = 4;  ///< Chunks under way.

/// @throws Error{kEnvironment} where nobody answers.
StreamAnswer ask_server(Connection& connection, const std::string& api, const Json& what) {
  const std::string text = json_text(what);
  auto read = read_answer(connection.request("$JS.API." + api, std::as_bytes(std::span(text))));
  if (read.error == kNobody) throw_environment(read.why);
  return read;
}

/// Calls @p work with each number below @p count, some at a time, until one says no.
/// @param work  bool(std::uint32_t). @return  Whether all said yes.
template <typename Work>
bool in_window(std::uint32_t count, const Work& work) {
  std::atomic<std::uint32_t> next = 0, done = 0;
  const auto run = [&] {
    for (std::uint32_t number = next++; number < count; number = next++) {
      work(number) ? ++done : next = count;
    }
  };
  {
    std::vector<std::jthread> others;
    for (std::uint32_t i = 1; i < std::min(kWindow, count); ++i) {
      others.push_back(start_thread(run));
    }
    run();
  }
  return done == count;
}

/// Asks until there is an answer, as long as that may help.
Connection::Answer ask(Connection& connection, const std::string& subject, ByteView data,
                       const std::function<bool()>& stop, Nanos no_step) {
  const MachineClock clock;
  for (const Nanos begin = clock.now(); !stop();) {
    auto answer = connection.request(subject, data);
    if (answer.came || clock.now() - begin >= no_step) return answer;
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
  }
  return {};
}

template <typename Byte>
std::span<Byte> part(std::span<Byte> bytes, std::uint32_t chunk_bytes, std::uint32_t number) {
  const std::size_t from = std::size_t{number} * chunk_bytes;
  return bytes.subspan(from, std::min<std::size_t>(chunk_bytes, bytes.size() - from));
}

}  // namespace

std::vector<std::string> set_up(Connection& connection, const Setup& setup) {
  std::ranges::for_each(setup.robots, check_robot_name);
  std::vector<std::string> made;
  for (const std::string& robot : setup.robots) {
    const std::string name = blob_stream(robot);
    // What is oldest goes first, and what is older than an hour: its robot sends it again, or is
    // gone. A blob has no more small chunks, its last one, than others: what says else would fill
    // the server's memory with their subjects.
    const Json config = {
        {"name", name},
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
    made.push_back(fmt::format("stream {} of {} MB", name, setup.robot_bytes >> 20));
    // In this order: to make one that is there takes its room a second time.
    StreamAnswer answer = ask_server(connection, "STREAM.UPDATE." + name, config);
    if (answer.error == kNoStream) answer = ask_server(connection, "STREAM.CREATE." + name, config);
    if (answer.error == 0) continue;
    throw_environment(made.back() + ": " + answer.why +
                      "; or give each robot less (pirt cloud-admin setup --robot-mb); if it was "
                      "made otherwise, remove it first");
  }
  return made;
}

std::vector<std::string> administer(const ConnectionOptions& options, const Setup& setup) {
  Connection connection(options, {});
  if (!connection.wait_until_up(Connection::kAnswer)) {
    throw_environment("no connection to server " + public_url(options.server) + ": " +
                      connection.why_down());
  }
  return set_up(connection, setup);
}

std::string permissions(std::span<const std::string> robots) {
  const std::string one(nats_files::files().front().text);
  const std::size_t begin = one.find("    { user: \"robot\""), end = one.find("  ]\n", begin);
  const std::regex name("robot"), variable_of_it("ROBOT_ROBOT");
  std::string text = one.substr(0, begin);
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
    text += std::regex_replace(
        std::regex_replace(one.substr(begin, end - begin), variable_of_it, "ROBOT_" + variable),
        name, robot);
  }
  return text + one.substr(end);
}

StreamAnswer read_answer(const Connection::Answer& answer) {
  if (!answer.came || answer.status == kNobody) {
    return {.error = kNobody,
            .why = answer.came ? "the server has no JetStream; start it with -js"
                               : "the server does not answer; is it there, the link fast enough, "
                                 "and may this user say that (pirt cloud-admin permissions)?"};
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

std::string put_blob(Connection& connection, const std::string& prefix, const Blob& blob,
                     ByteView bytes, const std::function<bool()>& stop, Nanos no_step) {
  if (blob.chunk_bytes < kLeastChunkBytes || blob.chunk_bytes > connection.chunk_bytes()) {
    return connection.why_no_chunks();
  }
  std::mutex mutex;
  std::string problem;
  const bool all = in_window(blob.chunks(), [&](std::uint32_t number) {
    const auto answer = ask(connection, prefix + "." + std::to_string(number),
                            part(bytes, blob.chunk_bytes, number), stop, no_step);
    std::string why = read_answer(answer).why;
    if (answer.came && answer.status == kNobody) {
      why = fmt::format(
          "robot '{0}' has no stream any more, or the server no JetStream; run `pirt cloud-admin "
          "setup --robots {0}`",
          robot_of(prefix));
    }
    if (why.empty()) return true;
    const std::lock_guard lock(mutex);
    if (problem.empty()) problem = why;
    return false;
  });
  return all || !problem.empty() ? problem : "no memory was left to send it";
}

Connection::Answer fetch_blob(Connection& connection, const std::string& prefix, const Blob& blob,
                              const std::function<bool()>& stop, Nanos no_step) {
  Bytes bytes(static_cast<std::size_t>(blob.size_bytes));
  const std::string direct =
      fmt::format("$JS.API.DIRECT.GET.{}.{}.", blob_stream(robot_of(prefix)), prefix);
  std::atomic<bool> answered = true;
  const bool all = in_window(blob.chunks(), [&](std::uint32_t number) {
    const auto answer = ask(connection, direct + std::to_string(number), {}, stop, no_step);
    const auto to = part(std::span(bytes), blob.chunk_bytes, number);
    if (!answer.came || answer.status == kNobody) answered = false;
    if (!answer.came || answer.status != 0 || answer.data.size() != to.size()) return false;
    std::memcpy(to.data(), answer.data.data(), to.size());
    return true;
  });
  if (!answered) return {};
  if (!all || digest_of(bytes) != blob.digest) return {.came = true, .status = 404};
  return {.came = true, .data = std::move(bytes)};
}

void remove_blob(Connection& connection, const std::string& prefix) {
  const std::string text = json_text(Json::object({{"filter", prefix + ".>"}}));
  connection.publish("$JS.API.STREAM.PURGE." + blob_stream(robot_of(prefix)),
                     std::as_bytes(std::span(text)));
}

}  // namespace pirt::cloud
