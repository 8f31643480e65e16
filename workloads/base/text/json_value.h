// JSON as a value, for files that take it apart or put it together; who only hands it on includes
// json.h. What the library's templates become is compiled in json.cpp, not in each of them.
#pragma once

#include <nlohmann/json.hpp>

#include "workloads/base/text/json.h"

extern template class nlohmann::basic_json<nlohmann::ordered_map>;
