#include <cstring>

#include "workloads/backends/dsp/kernels.h"
#include "workloads/base/contract.h"

namespace pirt::dsp {

MappedTensor make_picture(ProgramSession& session, const TensorSpec& tensor) {
  constexpr std::size_t kUnit = PIRT_DSP_ALIGNMENT;
  const auto rows = static_cast<std::size_t>(tensor.shape[0]);
  const auto columns = static_cast<std::size_t>(tensor.shape[1]);
  const std::size_t column_bytes = static_cast<std::size_t>(tensor.size_bytes()) / (rows * columns);
  const std::size_t pitch = (columns + kUnit - 1) / kUnit * kUnit * column_bytes;
  return {session.allocate(rows * pitch, tensor.describe()), rows, columns * column_bytes, pitch};
}

MappedTensor make_dense(ProgramSession& session, const TensorSpec& tensor) {
  const auto bytes = static_cast<std::size_t>(tensor.size_bytes());
  return {session.allocate(bytes, tensor.describe()), 1, bytes, bytes};
}

Cost run(ProgramSession& session, const Call& call) {
  return session.run(call.kernel, call.buffers, call.values, call.name);
}

void copy_in(ProgramSession& session, const MappedTensor& to, std::span<const std::byte> from) {
  expect(from.size() == to.rows * to.row_bytes, "a tensor of another size than its place");
  std::byte* const at = session.bytes(to.buffer).data();
  for (std::size_t row = 0; row < to.rows; ++row) {
    std::memcpy(at + row * to.pitch_bytes, from.data() + row * to.row_bytes, to.row_bytes);
  }
}

void copy_out(const ProgramSession& session, const MappedTensor& from, std::span<std::byte> to) {
  expect(to.size() == from.rows * from.row_bytes, "a tensor of another size than its place");
  const std::byte* const at = session.bytes(from.buffer).data();
  for (std::size_t row = 0; row < from.rows; ++row) {
    std::memcpy(to.data() + row * from.row_bytes, at + row * from.pitch_bytes, from.row_bytes);
  }
}

}  // namespace pirt::dsp
