// Inside of workloads/dnn: the double-precision definitions of the layers, on plain values, and
// what their specs share.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "workloads/dnn/dnn.h"

namespace pirt::dnn {

/// max(0, conv + bias). @param in [in_c,in_h,in_w]. @return [out_c,out_h,out_w].
[[nodiscard]] std::vector<double> conv2d_relu(const ConvShape& shape, std::span<const double> in,
                                              std::span<const float> weights,
                                              std::span<const float> bias);

/// @param in [channels,in_h,in_w]. @return [channels,out_h,out_w].
[[nodiscard]] std::vector<double> max_pool(const MaxPool& op, std::span<const double> in);

/// @param in [in]. @return [out], after the activation.
[[nodiscard]] std::vector<double> fully_connected(const FullyConnected& op,
                                                  std::span<const double> in,
                                                  std::span<const float> weights,
                                                  std::span<const float> bias);

/// The layer that @p layer's operation says. @param parameters  Its own, in its order.
[[nodiscard]] std::vector<double> run_layer(const Workload& layer, std::span<const double> in,
                                            std::span<const Tensor> parameters);

/// The output of @p workload, a layer or a chain. @param parameters  As Workload::parameters.
[[nodiscard]] std::vector<double> run_layers(const Workload& workload, std::vector<double> values,
                                             std::span<const Tensor> parameters);

/// Fills in data, reference and tags of a one-layer workload whose kernel, operation and specs are
/// set.
[[nodiscard]] Workload finish_layer(Workload layer);

/// The layers one after the other as one workload named @p name; tags "dnn" and, if the first layer
/// takes one, "image".
/// @param relative_to_peak  Of verify_close.
[[nodiscard]] Workload make_sequence(std::string name, std::string description,
                                     std::vector<Workload> layers, double relative_to_peak);

/// Where the values of make_input lie, a picture's or an activation's.
[[nodiscard]] ValueRange input_range(bool picture);

/// Input of @p layer: a picture where it has three channels, otherwise positive like what a ReLU
/// leaves.
[[nodiscard]] Tensor make_input(const Workload& layer, const DataRequest& request,
                                std::vector<std::string>& notes);

/// Weights and biases of @p layer as a function of the seed and the layer's name, so that a layer
/// has the same ones alone and within a chain. @param prefix  Put before the tensors' names.
[[nodiscard]] std::vector<Tensor> make_parameters(const Workload& layer, std::uint64_t seed,
                                                  const std::string& prefix);

/// Bound of verify_close for outputs that sum @p terms products in f32.
///
/// Rounding errors of a running sum in any order grow like a random walk: u * sqrt(terms / 6) of
/// the outputs' spread with u = 2^-24, and the worst of some 10^5 outputs lies about as many
/// spreads out as the peak does, so that the figure relative to the peak is the same (Higham and
/// Mary, A new approach to probabilistic rounding error analysis, 2019). The bound takes ten times
/// that, 4 * u * sqrt(terms). Observed with oneDNN 2.6: at most 0.2 of it (conv1, conv4).
[[nodiscard]] double sum_tolerance(std::int64_t terms);

/// The same after a softmax: an absolute error of the logits is a relative one of the
/// probabilities, and the largest logits are below 10. Observed with oneDNN 2.6: 1.4e-6 where this
/// gives 1.5e-4 (fc8), since few errors of logits come near their own bound.
[[nodiscard]] double softmax_tolerance(std::int64_t terms);

}  // namespace pirt::dnn
