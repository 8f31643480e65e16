#include "tests/support/paths.h"

namespace pirt::test {

const char* const kSourceFolder = PIRT_SOURCE_FOLDER;
const char* const kProgram = PIRT_PROGRAM;
const char* const kTestWorker = PIRT_TEST_WORKER;

}  // namespace pirt::test
