// A qemu-hexagon that does not do what it should: backend dsp is not there, with its reason, and
// all else goes on.
#include <filesystem>

#include "tests/cli/program.h"
#include "tests/support/optional_backend.h"

namespace pirt::test {
namespace {

using testing::HasSubstr;
using testing::Not;

class BrokenEmulator : public testing::Test {
 protected:
  void SetUp() override {
    PIRT_BACKEND_OR_SKIP("dsp");
    std::filesystem::create_directory(scratch_.file("bin"));
  }
  void emulator(const std::string& script) {
    const auto path = scratch_.write("bin/qemu-hexagon", "#!/bin/sh\n" + script + "\n");
    std::filesystem::permissions(path, std::filesystem::perms::owner_all);
  }
  [[nodiscard]] Outcome with_it(const std::vector<std::string>& arguments) const {
    return pirt(arguments, "PATH=" + quoted(scratch_.file("bin")) + ":$PATH timeout 100");
  }
  void expect_no(const std::string& reason) const {
    const auto listed = with_it({"list", "backends", "--json", "-"});
    ASSERT_EQ(listed.exit_code, 0) << listed.err;
    for (const auto& row : listed.json()["backends"]) {
      if (row["name"] != "dsp") continue;
      EXPECT_EQ(row["available"], false);
      EXPECT_THAT(row.dump(), HasSubstr(reason));
    }
    const auto units = with_it({"list", "units", "--platform", board_});
    EXPECT_EQ(units.exit_code, 0) << units.err;
    EXPECT_THAT(units.out, HasSubstr(reason));
    const auto planned =
        with_it({"characterize", "--dry-run", "--platform", board_, "--filter", "^sobel$"});
    EXPECT_EQ(planned.exit_code, 0) << planned.err;
    EXPECT_THAT(planned.out, HasSubstr(reason));
  }

  const Scratch scratch_;
  const std::string board_ = scratch_.write(
      "board.yaml", "platform: b\nunits: {gpu: {backend: fake}, dsp: {backend: dsp}}\n");
};

TEST_F(BrokenEmulator, ThatHangsIsNotThere) {
  emulator("sleep 1000");
  expect_no("did not say its version");
}

TEST_F(BrokenEmulator, ThatPrintsRubbishIsNotThere) {
  emulator("echo rubbish");
  expect_no("does not say its version");
}

TEST_F(BrokenEmulator, ThatFailsIsNotThere) {
  emulator("exit 3");
  expect_no("does not run");
}

// As Debian 13's.
TEST_F(BrokenEmulator, ThatTakesNoPluginIsNotThere) {
  emulator("echo \"qemu: unknown option 'plugin'\" >&2; exit 1");
  expect_no("takes no plugin");
}

}  // namespace
}  // namespace pirt::test
