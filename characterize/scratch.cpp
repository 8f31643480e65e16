#include "characterize/scratch.h"

#include <fmt/format.h>
#include <stdlib.h>

#include <cerrno>
#include <cstring>
#include <string>

#include "workloads/base/error.h"

namespace pirt {

ScratchFolder::ScratchFolder() {
  std::string name = (std::filesystem::temp_directory_path() / "pirt-XXXXXX").string();
  if (::mkdtemp(name.data()) == nullptr) {
    throw_environment(
        fmt::format("cannot make a scratch folder '{}': {}; set TMPDIR to a folder with space",
                    name, std::strerror(errno)));
  }
  path_ = name;
}

ScratchFolder::~ScratchFolder() {
  std::error_code ignored;
  std::filesystem::remove_all(path_, ignored);
}

}  // namespace pirt
