// Which server is spoken to, and whether it may be: what is said of a connection before there is
// one.
#pragma once

#include <chrono>
#include <string>

#include "workloads/base/time.h"

namespace pirt::cloud {

struct ConnectionOptions {
  std::string server = "nats://127.0.0.1:4222";  ///< tls:// for TLS.
  std::string name = "pirt";                     ///< For whoever looks at the server.
  std::string inbox = "_INBOX";                  ///< What answers come to begins with it.
  bool insecure = false;                         ///< Beyond loopback without TLS is not refused.
  // Files; empty = none.
  std::string ca = {};                     ///< That the server's certificate follows from.
  std::string certificate = {}, key = {};  ///< Of this client.
  std::string nkey_seed = {};              ///< Of this client, in place of a certificate.
  std::string nkey = {};                   ///< The public key of the seed.
  Nanos reconnect_wait = std::chrono::milliseconds(200);
};

struct Url {
  std::string scheme, host;
};
/// @throws Error{kBadInput} for what is no URL of a server.
[[nodiscard]] Url parse_url(const std::string& server);

/// Without a user and a password: for messages, profiles, reports.
[[nodiscard]] std::string public_url(const std::string& server);

/// @throws Error{kBadInput} for what is no URL of a server, for one beyond loopback without TLS
/// that is not said to be insecure, and for files that are not there or not complete.
void check_connection(const ConnectionOptions& options);

}  // namespace pirt::cloud
