// Seeded randomness. Every stream is a pure function of (seed, index), so that generation can be
// split and repeated.
#pragma once

#include <cstdint>
#include <string_view>

namespace pirt {

/// splitmix64's finalizer over a counter. @source Steele, Lea, Flood: Fast Splittable Pseudorandom
/// Number Generators, OOPSLA 2014.
[[nodiscard]] constexpr std::uint64_t hash_u64(std::uint64_t seed, std::uint64_t index) {
  std::uint64_t z = seed + (index + 1) * 0x9e3779b97f4a7c15ULL;
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ULL;
  z = (z ^ (z >> 27)) * 0x94d049bb133111ebULL;
  return z ^ (z >> 31);
}

/// Of the point of a lattice, negative ones included.
[[nodiscard]] constexpr std::uint64_t hash_lattice(std::uint64_t seed, int a, int b) {
  return hash_u64(
      seed, std::uint64_t{static_cast<std::uint32_t>(a)} << 32U | static_cast<std::uint32_t>(b));
}

/// A seed of its own for the thing called @p name (FNV-1a over the name, mixed with @p seed).
[[nodiscard]] constexpr std::uint64_t derive_seed(std::uint64_t seed, std::string_view name) {
  std::uint64_t h = 0xcbf29ce484222325ULL;
  for (const char c : name) h = (h ^ static_cast<unsigned char>(c)) * 0x100000001b3ULL;
  return hash_u64(seed, h);
}

/// A sequential generator over hash_u64.
class Random {
 public:
  explicit constexpr Random(std::uint64_t seed) : seed_(seed) {}
  constexpr std::uint64_t next() { return hash_u64(seed_, index_++); }
  /// Uniform in [0, 1).
  constexpr double uniform() { return static_cast<double>(next() >> 11) * 0x1p-53; }
  constexpr double uniform(double low, double high) { return low + (high - low) * uniform(); }
  /// Uniform in [0, n); n >= 1. The bias of at most n/2^64 is below what anything here can see.
  constexpr std::uint64_t below(std::uint64_t n) { return next() % n; }

 private:
  std::uint64_t seed_;
  std::uint64_t index_ = 0;
};

}  // namespace pirt
