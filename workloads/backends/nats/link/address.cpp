#include <filesystem>
#include <regex>

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
  static const std::regex kUrl(
      R"((nats|tls)://([^/?#\s]*@)?(\[([^\]/?#\s@]+)\]|[^\[\]:/?#\s@]+)(:([1-9][0-9]{0,4}))?)");
  std::smatch parts;
  const bool fits = server.size() <= 1024 && std::regex_match(server, parts, kUrl) &&
                    (!parts[6].matched || std::stoi(parts[6]) <= 65535);
  if (!fits) {
    throw_bad_input("server '" + public_url(server) +
                    "' is none; a server is nats://HOST:PORT, or tls://HOST:PORT");
  }
  return {parts[1], parts[4].matched ? parts[4] : parts[3]};
}

bool is_robot_name(std::string_view name) {
  constexpr std::size_t kLongest = 64;
  constexpr const char* kGood = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789_-";
  return !name.empty() && name.size() <= kLongest && name.find_first_not_of(kGood) == name.npos;
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
