#include "workloads/base/text/markup.h"

#include "workloads/base/text/printable.h"

namespace pirt {

std::string escape_markup(std::string_view text) {
  std::string out;
  std::string spaced(text);
  for (char& c : spaced) {
    if (static_cast<unsigned char>(c) < 0x20 && c != '\n') c = ' ';
  }
  // XML has no bytes that are not UTF-8, nor these two, which are.
  for (const std::string_view none : {"\xef\xbf\xbe", "\xef\xbf\xbf"}) {
    for (auto at = spaced.find(none); at != std::string::npos; at = spaced.find(none, at)) {
      spaced.replace(at, none.size(), "?");
    }
  }
  for (const char c : printable(spaced, "\n")) {
    switch (c) {
      case '<':
        out += "&lt;";
        break;
      case '>':
        out += "&gt;";
        break;
      case '&':
        out += "&amp;";
        break;
      case '"':
        out += "&quot;";
        break;
      case '\n':
        out += "&#10;";
        break;
      default:
        out += c;
    }
  }
  return out;
}

}  // namespace pirt
