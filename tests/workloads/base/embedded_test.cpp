// Files compiled into the binary: text as it is, and binary ones to the last byte.
#include "workloads/base/embedded.h"

#include <embedded_samples.h>
#include <gtest/gtest.h>

#include <string>

#include "tests/support/paths.h"
#include "workloads/base/text/text.h"

namespace pirt {
namespace {

TEST(Embedded, FilesAreThereByteForByte) {
  for (const std::string name : {"program.bin", "note.txt"}) {
    const std::string path =
        std::string(test::kSourceFolder) + "/tests/workloads/base/embedded_samples/" + name;
    const auto found = find_embedded(embedded_samples::files(), name);
    ASSERT_TRUE(found) << name;
    EXPECT_EQ(*found, read_file(path)) << name;
  }
  EXPECT_NE(find_embedded(embedded_samples::files(), "program.bin")->find('\0'),
            std::string_view::npos);
}

}  // namespace
}  // namespace pirt
