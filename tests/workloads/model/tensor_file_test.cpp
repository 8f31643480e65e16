// What one process makes for the others to compute on arrives as it was.
#include "workloads/model/tensor_file.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>

#include "workloads/base/error.h"
#include "workloads/catalog/catalog.h"
#include "workloads/inputs/pictures/images.h"
#include "workloads/model/player.h"

namespace pirt {
namespace {

class TensorFiles : public testing::Test {
 protected:
  TensorFiles() { std::filesystem::create_directory(folder_); }
  ~TensorFiles() override { std::filesystem::remove_all(folder_); }
  const std::filesystem::path folder_ =
      std::filesystem::temp_directory_path() / ("pirt-tensor-file-" + std::to_string(::getpid()));
};

void expect_equal(const std::vector<Tensor>& a, const std::vector<Tensor>& b) {
  ASSERT_EQ(a.size(), b.size());
  for (std::size_t i = 0; i < a.size(); ++i) {
    EXPECT_EQ(a[i].rows(), b[i].rows());
    EXPECT_TRUE(std::ranges::equal(a[i].used_bytes(), b[i].used_bytes()));
  }
}

TEST_F(TensorFiles, KeepsInputsParametersAndNotesOfEveryFrame) {
  const auto images = generated_images(3);
  for (const char* name :
       {"gaussian_blur", "conv3", "track_features", "plan_path", "update_pose"}) {
    const Workload& workload = find_workload(name);
    auto frames = make_sequence(workload, {.seed = 3, .images = images.get()});
    frames.front().notes = {"input_resized", "and cropped"};
    const auto path = folder_ / name;
    const auto state = workload.state ? workload.make_state() : std::vector<Tensor>();
    write_data(path, frames, state);
    const auto read = read_data(path, workload);
    ASSERT_EQ(read.size(), frames.size()) << name;
    expect_equal(read_state(path, workload), state);
    for (std::size_t i = 0; i < frames.size(); ++i) {
      SCOPED_TRACE(name);
      expect_equal(read[i].inputs, frames[i].inputs);
      expect_equal(read[i].parameters, frames[i].parameters);
      EXPECT_EQ(read[i].notes, frames[i].notes);
    }
  }
}

TEST_F(TensorFiles, RefusesWhatIsOfAnotherWorkload) {
  const auto images = generated_images(3);
  const Workload& blur = find_workload("gaussian_blur");
  write_data(folder_ / "x", make_sequence(blur, {.seed = 3, .images = images.get()}), {});
  EXPECT_THROW(static_cast<void>(read_data(folder_ / "x", find_workload("conv3"))), Error);
}

}  // namespace
}  // namespace pirt
