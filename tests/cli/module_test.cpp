// Modules lie beside the program that asks for them: a build folder that was copied works, and no
// program looks into the folder that it was built in, which may be somebody else's by then.
#include <filesystem>

#include "tests/cli/program.h"

namespace pirt::test {
namespace {

namespace fs = std::filesystem;

TEST(Modules, OfACopiedBuildAreThoseBesideIt) {
  const Scratch scratch;
  fs::create_directory(scratch.file("build"));
  const std::string copy = scratch.file("build/pirt");
  fs::copy_file(kProgram, copy);
  const std::string generate = quoted(copy) + " generate --seed 1 --duration 1s --width 64 " +
                               "--height 64 " + quoted(scratch.file("sequence"));
  const auto without = run(generate);
  EXPECT_EQ(without.exit_code, 4) << without.out;
  EXPECT_THAT(without.err, testing::HasSubstr("libpirt_pictures.so"));

  fs::copy_file(fs::path(kProgram).parent_path() / "libpirt_pictures.so",
                scratch.file("build/libpirt_pictures.so"));
  const auto with = run(generate);
  EXPECT_EQ(with.exit_code, 0) << with.err;
}

TEST(Modules, ThatCannotBeReachedAreLookedForFurther) {
  const Scratch scratch;
  fs::create_directory(scratch.file("pirt"));
  const std::string copy = scratch.file("copy");
  fs::copy_file(kProgram, copy);
  const std::string loop = scratch.file("libpirt_pictures.so");
  fs::create_symlink(loop, loop);
  const std::string generate = quoted(copy) + " generate --seed 1 --duration 1s --width 64 " +
                               "--height 64 " + quoted(scratch.file("sequence"));
  const auto without = run(generate);
  EXPECT_EQ(without.exit_code, 4) << without.out;
  EXPECT_THAT(without.err, testing::HasSubstr("install pirt with it"));

  fs::copy_file(fs::path(kProgram).parent_path() / "libpirt_pictures.so",
                scratch.file("pirt/libpirt_pictures.so"));
  const auto with = run(generate);
  EXPECT_EQ(with.exit_code, 0) << with.err;
}

TEST(Modules, AreFoundThroughALinkToTheProgram) {
  const Scratch scratch;
  fs::create_symlink(kProgram, scratch.file("pirt"));
  const auto made = run(quoted(scratch.file("pirt")) +
                        " generate --seed 1 --duration 1s --width 64 --height 64 " +
                        quoted(scratch.file("sequence")));
  EXPECT_EQ(made.exit_code, 0) << made.err;
}

}  // namespace
}  // namespace pirt::test
