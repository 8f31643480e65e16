#include "cli/options/sysfs.h"

#include <cstdlib>

namespace pirt::cli {

std::filesystem::path sysfs_root() {
  const char* root = std::getenv("PIRT_SYSFS");
  return root == nullptr || *root == '\0' ? "/sys" : root;
}

}  // namespace pirt::cli
