// What a library is linked with, read from files made here: nothing is loaded.
#include "workloads/own/libraries.h"

#include <elf.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <link.h>
#include <stdlib.h>

#include <cstddef>
#include <cstring>
#include <fstream>
#include <string>

namespace pirt::test {
namespace {

namespace fs = std::filesystem;
using testing::ElementsAre;
using testing::IsEmpty;

constexpr ElfW(Addr) kAddress = 0x1000;  // of its first byte

/// A library that needs one other.
struct Image {
  ElfW(Ehdr) header{};
  ElfW(Phdr) segments[2]{};
  ElfW(Dyn) entries[4]{};
  char strings[64]{};
};

std::string library(const std::string& needed, const std::string& run_path) {
  Image image;
  std::memcpy(image.header.e_ident, ELFMAG, SELFMAG);
  image.header.e_ident[EI_CLASS] = sizeof(void*) == 8 ? ELFCLASS64 : ELFCLASS32;
  image.header.e_phoff = offsetof(Image, segments);
  image.header.e_phnum = 2;
  image.segments[0].p_type = PT_LOAD;
  image.segments[0].p_vaddr = kAddress;
  image.segments[0].p_filesz = sizeof(Image);
  image.segments[1].p_type = PT_DYNAMIC;
  image.segments[1].p_offset = offsetof(Image, entries);
  needed.copy(image.strings + 1, 30);
  run_path.copy(image.strings + 32, 30);
  image.entries[0].d_tag = DT_NEEDED;
  image.entries[0].d_un.d_val = 1;
  image.entries[1].d_tag = DT_RUNPATH;
  image.entries[1].d_un.d_val = 32;
  image.entries[2].d_tag = DT_STRTAB;
  image.entries[2].d_un.d_ptr = kAddress + offsetof(Image, strings);
  return std::string(reinterpret_cast<const char*>(&image), sizeof(image));
}

class LinkedLibraries : public testing::Test {
 protected:
  LinkedLibraries() {
    std::string name = (fs::temp_directory_path() / "pirt-libraries-XXXXXX").string();
    folder_ = ::mkdtemp(name.data());
    fs::create_directory(folder_ / "core");
  }
  ~LinkedLibraries() override { fs::remove_all(folder_); }
  fs::path write(const std::string& name, const std::string& bytes) const {
    std::ofstream(folder_ / name, std::ios::binary) << bytes;
    return folder_ / name;
  }
  fs::path folder_;
};

TEST_F(LinkedLibraries, LieBesideOrInTheRunPathAndHaveTheirOwn) {
  const auto wrapper = write("libmine.so", library("libcore.so.1", "/none:$ORIGIN/core"));
  EXPECT_THAT(linked_libraries(wrapper), IsEmpty()) << "it may be the system's";
  // The run path comes first, and whoever needs each other is there once.
  write("libcore.so.1", "beside");
  const auto core = write("core/libcore.so.1", library("libmath.so", "${ORIGIN}/.."));
  const auto math = write("libmath.so", library("libmine.so", ""));
  EXPECT_THAT(linked_libraries(wrapper), ElementsAre(folder_ / "core" / "libcore.so.1",
                                                     folder_ / "core" / ".." / "libmath.so"));
  fs::remove(core);
  EXPECT_THAT(linked_libraries(wrapper), ElementsAre(folder_ / "libcore.so.1"));
  EXPECT_THAT(linked_libraries(math), ElementsAre(wrapper, folder_ / "libcore.so.1"));
}

TEST_F(LinkedLibraries, OfWhatIsCutOffOrNoLibraryAreNone) {
  write("libcore.so.1", "beside");
  const std::string whole = library("libcore.so.1", "");
  for (std::size_t size = 0; size < whole.size(); size += 5) {
    EXPECT_THAT(linked_libraries(write("cut.so", whole.substr(0, size))).size(), testing::Le(1U));
  }
  std::string spoilt = whole;
  for (std::size_t i = EI_NIDENT; i < spoilt.size(); ++i) spoilt[i] = '\xff';
  EXPECT_THAT(linked_libraries(write("spoilt.so", spoilt)), IsEmpty());
  EXPECT_THAT(linked_libraries(write("text", "hello")), IsEmpty());
}

}  // namespace
}  // namespace pirt::test
