// Layers whose products are computed in fewer bits.
#include <algorithm>
#include <cmath>
#include <string>

#include "workloads/dnn/dnn.h"
#include "workloads/dnn/layers.h"

namespace pirt::dnn {
namespace {

/// Root mean square of the error of one product, relative to that of the product, where weights
/// spread evenly around zero and inputs evenly over their range, as make_parameters and make_input
/// make them. The products' errors add up like the products do, so that it is the sums' as well.
double product_error(Precision precision) {
  // Rounding to steps of q is off by q / sqrt(12); an even spread over +-a has a / sqrt(3).
  if (precision == Precision::kInt8) {
    // Weights in steps of peak / 63, the coarser of the two that CPUs without dot products of
    // 8 bits leave: pairs of products must fit 16 bits. Inputs in steps of peak / 127 or finer.
    constexpr double kWeights = 0.5 / 63, kInputs = 0.5 / 127;
    return std::hypot(kWeights, kInputs);
  }
  // 8 bits of mantissa: at most 2^-9 of either factor and, spread evenly, 1 / sqrt(3) of it.
  return 0x1p-9 * std::sqrt(2.0 / 3.0);
}

/// Of verify_close. As in sum_tolerance, an error that is a certain part of the sums' spread is the
/// same part of their peak where it is worst; the bound takes four times that. For a softmax it
/// moves logits, whose spread is sqrt(3), and the probabilities relative to themselves.
double tolerance(const Operation& operation, Precision precision) {
  const double error = 4.0 * product_error(precision);
  const auto* full = dynamic_cast<const FullyConnected*>(&operation);
  const bool softmax = full != nullptr && full->activation == Activation::kSoftmax;
  return softmax ? std::expm1(std::sqrt(3.0) * error) : error;
}

constexpr double kMostInt8 = 127;

}  // namespace

double int8_input_scale(ValueRange range) {
  return kMostInt8 / std::max(std::abs(double{range.low}), std::abs(double{range.high}));
}

std::vector<double> int8_weight_scales(std::span<const float> weights, std::size_t channels) {
  const std::size_t length = weights.size() / channels;
  std::vector<double> scales;
  for (std::size_t c = 0; c < channels; ++c) {
    double peak = 0;
    for (const float w : weights.subspan(c * length, length)) {
      peak = std::max(peak, std::abs(double{w}));
    }
    scales.push_back(peak > 0 ? kMostInt8 / peak : 1);
  }
  return scales;
}

std::optional<Workload> in_precision(const Workload& plain, Precision precision) {
  if (plain.kernel != "conv2d_relu" && plain.kernel != "fully_connected") return std::nullopt;
  Workload w = plain;
  w.precision = precision;
  w.description = std::string(to_string(precision)) + ": " + plain.description;
  w.verify = verify_close(tolerance(*plain.operation, precision));
  return w;
}

}  // namespace pirt::dnn
