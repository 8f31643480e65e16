// A headless Chromium that tests and benchmarks drive as a user would: keys, windows, colours.
//
// Speaks WebDriver with Debian's chromedriver over a local connection; both are packages of their
// own (chromium, chromium-driver), and whoever needs them looks first whether they are there.
//
// @source W3C, WebDriver; Chrome DevTools Protocol for what it does not have (Emulation).
#pragma once

#include <arpa/inet.h>
#include <netinet/in.h>
#include <signal.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string>

namespace pirt::test {

/// Why there is no browser here; empty if there is one.
inline std::string no_browser() {
  for (const char* program : {"/usr/bin/chromium", "/usr/bin/chromedriver"}) {
    if (::access(program, X_OK) != 0) {
      return std::string("skipped: no ") + program + " (Debian: chromium, chromium-driver)";
    }
  }
  return "";
}

/// A running chromedriver; ended with this, and the browser with it.
class DriverProcess {
 public:
  DriverProcess() {
    int out[2];
    if (::pipe(out) != 0) throw std::runtime_error("no pipe");
    process_ = ::fork();
    if (process_ == 0) {
      ::setpgid(0, 0);
      ::dup2(out[1], STDOUT_FILENO);
      ::close(out[0]);
      ::close(out[1]);
      ::execl("/usr/bin/chromedriver", "chromedriver", "--port=0", nullptr);
      ::_exit(127);
    }
    ::close(out[1]);
    output_ = ::fdopen(out[0], "r");
    char line[512];
    while (output_ != nullptr && std::fgets(line, sizeof line, output_) != nullptr) {
      const std::string text = line;
      const std::string mark = "started successfully on port ";
      const auto at = text.find(mark);
      if (at == std::string::npos) continue;
      port_ = std::atoi(text.c_str() + at + mark.size());
      return;
    }
    end();
    throw std::runtime_error("chromedriver did not start");
  }
  ~DriverProcess() { end(); }
  DriverProcess(const DriverProcess&) = delete;
  DriverProcess& operator=(const DriverProcess&) = delete;
  [[nodiscard]] int port() const { return port_; }

 private:
  void end() {
    if (process_ > 0) {
      ::kill(-process_, SIGTERM);
      ::waitpid(process_, nullptr, 0);
    }
    if (output_ != nullptr) std::fclose(output_);
    process_ = -1;
    output_ = nullptr;
  }

  pid_t process_ = -1;
  std::FILE* output_ = nullptr;
  int port_ = 0;
};

/// One window. Throws std::runtime_error with what the driver says where something fails.
class Browser {
 public:
  using Json = nlohmann::json;

  /// @param width, height  Of the window in pixels, as a phone would have it: the page sees them.
  Browser(int width, int height) {
    const Json options = {
        {"args", {"--headless=new", "--no-sandbox", "--disable-gpu", "--hide-scrollbars"}},
        {"mobileEmulation",
         {{"deviceMetrics",
           {{"width", width}, {"height", height}, {"pixelRatio", 1.0}, {"touch", false}}}}}};
    const Json always = {{"goog:chromeOptions", options},
                         {"goog:loggingPrefs", {{"browser", "ALL"}}}};
    const auto made = call("POST", "/session", {{"capabilities", {{"alwaysMatch", always}}}});
    session_ = "/session/" + made.at("sessionId").get<std::string>();
  }
  ~Browser() {
    try {
      call("DELETE", session_);
    } catch (const std::exception&) {
      return;  // the driver ends its browser when it is ended
    }
  }
  Browser(const Browser&) = delete;
  Browser& operator=(const Browser&) = delete;

  void open(const std::string& file) {
    post("/url", {{"url", "file://" + std::filesystem::absolute(file).string()}});
  }
  /// What the function body @p script returns; arguments[0] is @p argument.
  Json run(const std::string& script, const Json& argument = nullptr) {
    return post("/execute/sync", {{"script", script}, {"args", Json::array({argument})}});
  }
  /// Presses and releases a key of what has the focus: "Tab" is "\uE004", ArrowDown "\uE015".
  void press(const std::string& key) {
    const Json down = {{"type", "keyDown"}, {"value", key}},
               up = {{"type", "keyUp"}, {"value", key}};
    const Json keyboard = {{"type", "key"}, {"id", "keys"}, {"actions", Json::array({down, up})}};
    post("/actions", {{"actions", Json::array({keyboard})}});
  }
  /// "light" or "dark", as the system would say it.
  void prefer(const std::string& colors) {
    const Json feature = {{"name", "prefers-color-scheme"}, {"value", colors}};
    devtools("Emulation.setEmulatedMedia", {{"features", Json::array({feature})}});
  }
  /// As if it were printed.
  void emulate_print() { devtools("Emulation.setEmulatedMedia", {{"media", "print"}}); }
  /// What the console got since it was asked last: {"level", "message"}.
  Json console() { return post("/se/log", {{"type", "browser"}}); }
  /// A PNG in base64.
  std::string screenshot() { return call("GET", session_ + "/screenshot").get<std::string>(); }

 private:
  Json devtools(const std::string& command, const Json& parameters) {
    return post("/goog/cdp/execute", {{"cmd", command}, {"params", parameters}});
  }
  Json post(const std::string& path, const Json& body) {
    return call("POST", session_ + path, body);
  }

  Json call(const std::string& method, const std::string& path, const Json& body = Json::object()) {
    const std::string text = method == "POST" ? body.dump() : "";
    const std::string answer = exchange(
        method + " " + path + " HTTP/1.1\r\nHost: 127.0.0.1\r\nConnection: close\r\n" +
        "Content-Type: application/json\r\nContent-Length: " + std::to_string(text.size()) +
        "\r\n\r\n" + text);
    const auto begin = answer.find("\r\n\r\n");
    const Json json =
        Json::parse(begin == std::string::npos ? "" : answer.substr(begin + 4), nullptr, false);
    if (json.is_discarded()) throw std::runtime_error("chromedriver: " + answer.substr(0, 500));
    const Json& value = json.at("value");
    if (value.is_object() && value.contains("error")) {
      throw std::runtime_error("chromedriver: " + value.dump().substr(0, 500));
    }
    return value;
  }

  std::string exchange(const std::string& request) const {
    const int connection = ::socket(AF_INET, SOCK_STREAM, 0);
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(static_cast<std::uint16_t>(driver_.port()));
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    const timeval patience{60, 0};
    ::setsockopt(connection, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
    const auto* to = reinterpret_cast<const sockaddr*>(&address);
    if (connection < 0 || ::connect(connection, to, sizeof address) != 0) {
      throw std::runtime_error("chromedriver takes no connection");
    }
    for (std::size_t sent = 0; sent < request.size();) {
      const auto n = ::send(connection, request.data() + sent, request.size() - sent, MSG_NOSIGNAL);
      if (n <= 0) break;
      sent += static_cast<std::size_t>(n);
    }
    std::string answer;
    char part[65536];
    for (ssize_t n = 0; (n = ::recv(connection, part, sizeof part, 0)) > 0;) {
      answer.append(part, static_cast<std::size_t>(n));
      if (complete(answer)) break;  // the driver keeps connections open
    }
    ::close(connection);
    return answer;
  }

  static bool complete(const std::string& answer) {
    const auto begin = answer.find("\r\n\r\n");
    const std::string mark = "Content-Length:";
    const auto length = answer.find(mark);
    return begin != std::string::npos && length < begin &&
           answer.size() >=
               begin + 4 + std::strtoull(answer.c_str() + length + mark.size(), nullptr, 10);
  }

  DriverProcess driver_;
  std::string session_;
};

}  // namespace pirt::test
