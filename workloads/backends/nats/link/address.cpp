#include <algorithm>
#include <cstdlib>
#include <filesystem>

#include "workloads/backends/nats/link/connection.h"
#include "workloads/backends/nats/wire/subjects.h"
#include "workloads/base/error.h"

namespace pirt::cloud {
namespace {

bool is_loopback(const std::string& host) {
  if (host == "localhost" || host == "::1") return true;
  const bool numeric = host.find_first_not_of("0123456789.") == std::string::npos;
  return numeric && host.starts_with("127.");
}

void check_file(const std::string& what, const std::string& file) {
  if (file.empty()) return;
  std::error_code error;
  if (!std::filesystem::is_regular_file(file, error)) {
    throw_bad_input(what + " '" + file + "' is no file that can be read");
  }
}

}  // namespace

Url parse_url(const std::string& server) {
  const auto refuse = [&](const std::string& why) {
    throw_bad_input("server '" + public_url(server) + "' " + why +
                    "; a server is nats://HOST:PORT, or tls://HOST:PORT");
  };
  Url url;
  const auto colon = server.find("://");
  if (colon == std::string::npos) refuse("has no scheme");
  url.scheme = server.substr(0, colon);
  if (url.scheme != "nats" && url.scheme != "tls") refuse("is of another scheme");
  std::string rest = server.substr(colon + 3);
  if (const auto at = rest.rfind('@'); at != std::string::npos) rest = rest.substr(at + 1);
  if (rest.find_first_of("/, \t?#") != std::string::npos) refuse("is more than a host and a port");
  std::string port;
  if (rest.starts_with('[')) {
    const auto close = rest.find(']');
    if (close == std::string::npos) refuse("has no end of its address");
    url.host = rest.substr(1, close - 1);
    port = rest.substr(close + 1);
  } else {
    const auto end = rest.rfind(':');
    url.host = rest.substr(0, end);
    if (end != std::string::npos) port = rest.substr(end);
  }
  if (url.host.empty()) refuse("has no host");
  if (!port.empty()) {
    const bool digits =
        port.size() > 1 && port.size() <= 6 && port[0] == ':' &&
        std::all_of(port.begin() + 1, port.end(), [](char c) { return c >= '0' && c <= '9'; });
    if (!digits || std::atoi(port.c_str() + 1) > 65535 || std::atoi(port.c_str() + 1) == 0) {
      refuse("has no port that there is");
    }
  }
  return url;
}

bool is_robot_name(std::string_view name) {
  constexpr std::size_t kLongest = 64;
  return !name.empty() && name.size() <= kLongest && std::ranges::all_of(name, [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' ||
           c == '-';
  });
}

void check_robot_name(std::string_view name) {
  if (is_robot_name(name)) return;
  throw_bad_input("robot '" + std::string(name) +
                  "' cannot be called that; a name is made of letters, digits, '_' and '-'");
}

std::string public_url(const std::string& server) {
  const auto begin = server.find("://");
  const auto at = server.rfind('@');
  if (begin == std::string::npos || at == std::string::npos) return server;
  return server.substr(0, begin + 3) + server.substr(at + 1);
}

void check_connection(const ConnectionOptions& options) {
  const Url url = parse_url(options.server);
  check_file("the certificate authority", options.ca);
  check_file("the certificate", options.certificate);
  check_file("the certificate's key", options.key);
  check_file("the NKey's seed", options.nkey_seed);
  if (options.certificate.empty() != options.key.empty()) {
    throw_bad_input("a certificate and its key belong together; give both, or neither");
  }
  if (options.nkey_seed.empty() != options.nkey.empty()) {
    throw_bad_input("an NKey and the file with its seed belong together; give both, or neither");
  }
  const bool tls = url.scheme == "tls" || !options.ca.empty();
  if (!tls && !options.insecure && !is_loopback(url.host)) {
    throw_bad_input("server '" + public_url(options.server) +
                    "' is beyond this machine and would be spoken to without TLS: anybody on the "
                    "way could read and change tasks; use tls://, or allow it (--insecure; of a "
                    "unit, insecure: true)");
  }
}

}  // namespace pirt::cloud
