#include "workloads/base/text/name_filter.h"

#include <fmt/core.h>
#include <re2/re2.h>

#include "workloads/base/error.h"

namespace pirt {
namespace {

/// What another matcher would take, said as such; otherwise what RE2 says.
std::string problem_of(const re2::RE2& expression) {
  const std::string& part = expression.error_arg();
  if (expression.error_code() == re2::RE2::ErrorBadEscape && part.size() == 2 && part[1] >= '1' &&
      part[1] <= '9') {
    return fmt::format("back-references such as {} are not supported", part);
  }
  if (part.starts_with("(?=") || part.starts_with("(?!") || part.starts_with("(?<")) {
    return fmt::format("look-ahead and look-behind such as {} are not supported", part);
  }
  return expression.error();
}

}  // namespace

NameFilter::NameFilter(const std::string& text) {
  if (text.size() > kLongestFilter) {
    throw_bad_input(fmt::format("--filter is {} characters long, and at most {} are read",
                                text.size(), kLongestFilter));
  }
  re2::RE2::Options options;
  options.set_log_errors(false);
  expression_ = std::make_shared<const re2::RE2>(text, options);
  if (!expression_->ok()) {
    throw_bad_input(
        fmt::format("--filter '{}' is not a regular expression ({}); try a workload's name, or "
                    "'conv[12]|sobel'",
                    text, problem_of(*expression_)));
  }
}

bool NameFilter::picks(std::string_view name) const {
  return re2::RE2::PartialMatch(re2::StringPiece(name.data(), name.size()), *expression_);
}

}  // namespace pirt
