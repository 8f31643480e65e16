// What a workload of somebody else's is, as data: read from a module or a workload file, kept in a
// profile database, and turned into a Workload for a size.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "workloads/base/text/json.h"
#include "workloads/base/time.h"
#include "workloads/model/own_operation.h"
#include "workloads/model/workload.h"

namespace pirt::own {

/// In a shape: the width and the height that the workload is made for.
inline constexpr std::int64_t kWidth = -1, kHeight = -2;

/// What it computes with; empty in a process that computes nothing.
struct Functions {
  /// Inputs and parameters; empty = pictures and numbers.
  std::function<void(const DataRequest&, std::span<Tensor> inputs, std::span<Tensor> parameters)>
      make_inputs = {};
  std::function<void(std::span<Tensor>)> make_state = {};  ///< Empty = zeros.
  /// Outputs of the specs' elements, of which the definition makes f64 where it has to.
  std::function<void(const Data&, std::span<const Tensor> state, std::span<Tensor> next,
                     std::span<Tensor> outputs)>
      reference = {};
  std::function<std::unique_ptr<Kernel>(std::span<const Tensor> parameters, int threads)> cpu = {};
  std::optional<OpenclSource> opencl = std::nullopt;
  std::function<std::function<void()>(const OpenclUnit& unit)> opencl_function = {};
  Nanos ends_by_itself{0};  ///< As OwnOperation has it.
};

struct Size {
  int width = 0, height = 0;
  friend bool operator==(const Size&, const Size&) = default;
};
/// "1280x720"
[[nodiscard]] std::string to_string(Size size);
/// Within 1 and 65,536 each; absent for any other text.
[[nodiscard]] std::optional<Size> size_from(std::string_view text);

/// "sobel" of "sobel@1280x720@map".
[[nodiscard]] std::string plain_name(const std::string& workload);
/// Of "sobel@1280x720"; absent where another thing follows the name.
[[nodiscard]] std::optional<Size> size_in(const std::string& workload);

/// "u8", "f32"; absent for any other text.
[[nodiscard]] std::optional<Element> element_from(std::string_view text);

/// Of a shape: "480", "width", "height"; absent for any other text.
[[nodiscard]] std::optional<std::int64_t> extent_from(std::string_view text);
/// Of letters, digits and _-./: 1 to 100.
[[nodiscard]] bool is_tensor_name(std::string_view name);

/// With the width and height of @p size in place of kWidth and kHeight.
[[nodiscard]] std::vector<TensorSpec> at(std::vector<TensorSpec> specs, Size size);
/// The same of its global sizes, and with -DPIRT_WIDTH and -DPIRT_HEIGHT.
[[nodiscard]] OpenclSource at(OpenclSource source, Size size);

/// Setting up and calling for a minute, on a slow machine.
inline constexpr Nanos kDefaultLimit = std::chrono::seconds(120);

struct Definition {
  std::string name = {};         ///< "mine.sobel"
  std::string description = {};  ///< One line; may be empty.
  std::string source = {};       ///< The file that it comes from, absolute.
  std::string digest = {};       ///< Of what that held, as digest_of() has it (own.h).
  /// With kWidth, kHeight in shapes.
  std::vector<TensorSpec> inputs = {}, parameters = {}, outputs = {}, state = {};
  std::optional<Size> size = {};  ///< That it has by itself.
  int frames = 1;
  int slices = 1;
  double ops_per_element = 0;   ///< Of the first output; 0 = not known.
  double tolerance = 0;         ///< Relative to the peak; 0 = integers are equal, 1e-4 of others.
  bool verified = false;        ///< It has a reference.
  Nanos limit = kDefaultLimit;  ///< Of a process that measures it: then it hangs, and is killed.
  std::vector<std::string> backends = {};  ///< That have a kernel.
  /// For a size (0x0 where it has none); empty in a process that computes nothing.
  std::function<Functions(Size)> functions = {};
};

/// Before it is made for a size.
/// @throws Error{kBadInput} for arguments that are no tensors of the definition, or numbers beyond
/// their type, and sizes that are none.
void check(const OpenclSource& source, const Definition& definition, const std::string& where);

/// @param where  The definition's place, for messages.
/// @throws Error{kBadInput} for a name without a dot or of other characters, extents or numbers out
/// of range, names of tensors that are there twice, no backend, or no output of a device's.
void check(const Definition& definition, const std::string& where);

/// With floating-point elements in f64, as references have them.
[[nodiscard]] std::vector<Tensor> widened(std::span<const Tensor> tensors);

/// For `definition.size`, and Workload::at_size for others.
[[nodiscard]] Workload to_workload(const Definition& definition);

[[nodiscard]] Json to_json(const Definition& definition);
/// Without functions.
/// @throws Error{kBadInput} if it is none of this version, as JsonError, or as check().
[[nodiscard]] Definition definition_from(const Json& json);

/// "u8[480,640]", "f32[<=500,2]", "i16[height,width]"
/// @throws Error{kBadInput} "TEXT is no tensor: ..."
[[nodiscard]] TensorSpec tensor_from(const std::string& name, std::string_view text);
[[nodiscard]] std::string tensor_text(const TensorSpec& spec);

}  // namespace pirt::own
