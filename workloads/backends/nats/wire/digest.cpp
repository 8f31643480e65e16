#include "workloads/backends/nats/wire/digest.h"

#include <fmt/format.h>
#include <openssl/evp.h>

#include "workloads/base/error.h"

namespace pirt::cloud {

std::string Digest::hex() const {
  std::string text;
  for (const std::uint8_t byte : bytes) text += fmt::format("{:02x}", byte);
  return text;
}

Digest digest_of(std::span<const std::byte> bytes) {
  Digest digest;
  unsigned size = 0;
  if (EVP_Digest(bytes.data(), bytes.size(), digest.bytes.data(), &size, EVP_sha256(), nullptr) !=
          1 ||
      size != digest.bytes.size()) {
    throw_environment("OpenSSL computes no SHA-256; is its library damaged, or in FIPS mode?");
  }
  return digest;
}

}  // namespace pirt::cloud
