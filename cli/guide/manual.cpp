#include "cli/guide/manual.h"

#include <algorithm>

#include "workloads/base/error.h"
#include "workloads/base/text/text.h"

namespace pirt::cli {
namespace {

/// Text that troff takes as it stands.
std::string roff(const std::string& text) {
  std::string out;
  for (const char c : text) {
    if ((c == '.' || c == '\'') && (out.empty() || out.back() == '\n')) out += "\\&";
    if (c == '\\') {
      out += "\\e";
    } else if (c == '-') {
      out += "\\-";
    } else if (c == '~') {
      out += "\\(ti";
    } else if (c == '^') {
      out += "\\(ha";
    } else if (c == '`') {
      out += "\\(ga";
    } else if (c == '\'') {
      out += "\\(aq";
    } else {
      out += c;
    }
  }
  return out;
}

std::string page_name(const CommandDescription& command) {
  std::string name = command.name;
  std::ranges::replace(name, ' ', '-');
  return name;
}

std::string bold(const std::string& text) { return "\\fB" + roff(text) + "\\fR"; }
std::string italic(const std::string& text) { return "\\fI" + roff(text) + "\\fR"; }

std::string reference(const CommandDescription& command) {
  return "\\fB" + roff(page_name(command)) + "\\fR(1)";
}

const CommandDescription* find_page(const CommandDescription& command, const std::string& name) {
  if (page_name(command) == name) return &command;
  for (const auto& kind : command.kinds) {
    if (const auto* found = find_page(kind, name)) return found;
  }
  return nullptr;
}

/// The page that lists @p command; null for the program's.
const CommandDescription* parent_of(const CommandDescription& program,
                                    const CommandDescription& command) {
  for (const auto& kind : program.kinds) {
    if (&kind == &command) return &program;
    if (const auto* found = parent_of(kind, command)) return found;
  }
  return nullptr;
}

std::string synopsis(const CommandDescription& command) {
  std::string text = ".SH SYNOPSIS\n" + bold(command.name) + " [" + italic("OPTION") + "]...";
  for (const auto& option : command.options) {
    if (!option.positional) continue;
    const std::string dots = option.most_values > 1 ? "..." : "";
    const std::string name = italic(option.names.front()) + dots;
    text += option.required ? " " + name : " [" + name + "]";
  }
  text += '\n';
  if (!command.kinds.empty()) {
    text +=
        ".br\n" + bold(command.name) + " " + italic("COMMAND") + " [" + italic("OPTION") + "]...\n";
  }
  return text;
}

std::string option_entry(const OptionDescription& option) {
  std::vector<std::string> names;
  for (const auto& name : option.names) {
    names.push_back(option.positional ? italic(name) : bold(name));
  }
  std::string text = ".TP\n" + join(names, ", ");
  const bool may_miss = option.least_values == 0;
  if (!option.type.empty()) {
    text += may_miss && !option.positional ? " [" + italic(option.type) + "]"
                                           : " " + italic(option.type);
  }
  text += "\n" + roff(option.help);
  if (!option.standard.empty()) text += " (default: " + roff(option.standard) + ")";
  if (option.required) text += " (required)";
  if (!option.needs.empty()) text += ".\nWith " + bold(join(option.needs, ", ")) + " only";
  return text + ".\n";
}

std::string entries(const CommandDescription& command, bool positional, const std::string& title) {
  std::string text;
  for (const auto& option : command.options) {
    if (option.positional == positional) text += option_entry(option);
  }
  return text.empty() ? "" : ".SH " + title + "\n" + text;
}

/// Its lines: those that begin with "Example: " or "First steps: " are commands to type, the others
/// say what is to be known.
std::string footer(const std::string& text) {
  std::string notes, examples;
  for (const auto& line : split(text, '\n')) {
    if (line.empty()) continue;
    const auto colon = line.find(": ");
    const auto head = line.substr(0, colon);
    if (head == "Example" || head == "First steps") {
      examples += ".PP\n.nf\n" + roff(line.substr(colon + 2)) + "\n.fi\n";
    } else {
      notes += ".PP\n" + roff(line) + "\n";
    }
  }
  if (!notes.empty()) notes = ".SH NOTES\n" + notes.substr(4);  // a heading begins a paragraph
  if (!examples.empty()) examples = ".SH EXAMPLES\n" + examples.substr(4);
  return notes + examples;
}

/// What NAME says: one line without a stop, which whatis(1) shows.
std::string purpose(const CommandDescription& command) {
  std::string text = command.help;
  std::ranges::replace(text, '\n', ' ');
  if (text.ends_with('.')) text.pop_back();
  return text;
}

void collect(const CommandDescription& command, std::vector<std::string>& names) {
  names.push_back(page_name(command));
  for (const auto& kind : command.kinds) collect(kind, names);
}

}  // namespace

std::vector<std::string> manual_names(const CommandDescription& program) {
  std::vector<std::string> names;
  collect(program, names);
  return names;
}

std::string manual_page(const CommandDescription& program, const std::string& name,
                        const std::string& version) {
  const auto* command = find_page(program, name);
  if (command == nullptr) {
    throw_bad_input("there is no page '" + name + "'" + suggestion(name, manual_names(program)));
  }
  std::string title = name;
  std::ranges::transform(title, title.begin(), [](char c) {
    return c >= 'a' && c <= 'z' ? static_cast<char>(c - 32) : c;
  });
  std::string text = ".TH " + roff(title) + " 1 \"\" \"pirt " + roff(version) + "\" \"pirt\"\n";
  text += ".SH NAME\n" + roff(name) + " \\- " + roff(purpose(*command)) + "\n";
  text += synopsis(*command);
  text += entries(*command, true, "ARGUMENTS");
  if (!command->kinds.empty()) {
    text += ".SH COMMANDS\n";
    for (const auto& kind : command->kinds) {
      text += ".TP\n" + reference(kind) + "\n" + roff(purpose(kind)) + ".\n";
    }
  }
  text += entries(*command, false, "OPTIONS");
  text += footer(command->footer);
  const auto* parent = parent_of(program, *command);
  if (parent != nullptr) text += ".SH SEE ALSO\n" + reference(*parent) + "\n";
  return text;
}

}  // namespace pirt::cli
