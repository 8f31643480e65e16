#include "workloads/backends/nats/wire/digest.h"

#include <openssl/evp.h>

#include <stdexcept>

namespace pirt::cloud {
namespace {

void check(int result) {
  if (result != 1) throw std::runtime_error("OpenSSL cannot compute SHA-256");
}

}  // namespace

struct Digester::Context {
  EVP_MD_CTX* handle = EVP_MD_CTX_new();
  Context() = default;
  Context(const Context&) = delete;
  Context& operator=(const Context&) = delete;
  ~Context() { EVP_MD_CTX_free(handle); }
};

std::string Digest::hex() const {
  constexpr std::string_view kDigits = "0123456789abcdef";
  std::string text;
  text.reserve(2 * bytes.size());
  for (const std::uint8_t byte : bytes) {
    text += kDigits[byte >> 4];
    text += kDigits[byte & 15];
  }
  return text;
}

Digester::Digester() : context_(std::make_unique<Context>()) {
  check(EVP_DigestInit_ex(context_->handle, EVP_sha256(), nullptr));
}

Digester::~Digester() = default;

Digester& Digester::add(std::span<const std::byte> bytes) {
  check(EVP_DigestUpdate(context_->handle, bytes.data(), bytes.size()));
  return *this;
}

Digester& Digester::add(std::uint64_t value) {
  std::array<std::byte, 8> bytes{};
  for (std::size_t i = 0; i < bytes.size(); ++i) {
    bytes[i] = static_cast<std::byte>(value >> (8 * i));
  }
  return add(std::span<const std::byte>(bytes));
}

Digester& Digester::add(std::string_view text) {
  add(std::uint64_t{text.size()});
  return add(std::as_bytes(std::span(text)));
}

Digest Digester::value() {
  Digest digest;
  check(EVP_DigestFinal_ex(context_->handle, digest.bytes.data(), nullptr));
  return digest;
}

Digest digest_of(std::span<const std::byte> bytes) { return Digester().add(bytes).value(); }

}  // namespace pirt::cloud
