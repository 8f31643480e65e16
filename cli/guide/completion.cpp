#include "cli/guide/completion.h"

#include <algorithm>
#include <optional>
#include <string_view>

#include "workloads/base/text/text.h"

namespace pirt::cli {
namespace {

bool is_option(std::string_view word) { return word.size() > 1 && word.front() == '-'; }

const OptionDescription* find_option(const CommandDescription& command, std::string_view name) {
  for (const auto& option : command.options) {
    if (!option.positional && std::ranges::find(option.names, name) != option.names.end()) {
      return &option;
    }
  }
  return nullptr;
}

const CommandDescription* find_kind(const CommandDescription& command, std::string_view name) {
  for (const auto& kind : command.kinds) {
    if (kind.last_name() == name) return &kind;
  }
  return nullptr;
}

/// What the words before the last one have said.
struct Typed {
  const CommandDescription* command;
  std::vector<const OptionDescription*> options = {};
  std::vector<std::pair<const OptionDescription*, std::string>> values = {};
  const OptionDescription* awaits = nullptr;  ///< The option whose value the last word is.
  int arguments = 0;                          ///< That are positional.
  bool only_arguments = false;                ///< Behind "--".

  void read(const std::string& word);
};

void Typed::read(const std::string& word) {
  if (awaits != nullptr && !(is_option(word) && awaits->least_values == 0)) {
    values.emplace_back(awaits, word);
    awaits = nullptr;
    return;
  }
  awaits = nullptr;
  if (word == "--" && !only_arguments) {
    only_arguments = true;
    return;
  }
  if (is_option(word) && !only_arguments) {
    const auto equals = word.find('=');
    const auto* option = find_option(*command, word.substr(0, equals));
    if (option == nullptr) return;
    options.push_back(option);
    if (equals != std::string::npos) {
      values.emplace_back(option, word.substr(equals + 1));
    } else if (!option->type.empty()) {
      awaits = option;
    }
    return;
  }
  const auto* kind = arguments == 0 && !only_arguments ? find_kind(*command, word) : nullptr;
  if (kind == nullptr) {
    ++arguments;
    return;
  }
  *this = {.command = kind};
}

void add(Completion& completion, const std::string& typed, const std::string& word,
         const std::string& help) {
  if (word.starts_with(typed)) completion.candidates.push_back({word, help});
}

/// @param before  What the word has in front of the value: "--mode=".
void add_values(Completion& completion, const Typed& typed, const OptionDescription& option,
                const std::string& before, const std::string& value) {
  const OptionFacts& facts = option.facts;
  completion.files = facts.file.has_value();
  if (!facts.offer.names) return;
  const TypedValue given = [&](const std::string& name) -> std::optional<std::string> {
    for (const auto& [other, text] : typed.values) {
      if (std::ranges::find(other->names, name) != other->names.end()) return text;
    }
    return std::nullopt;
  };
  const bool listed = facts.with_commas || option.type.ends_with(",...");
  const auto comma = listed ? value.rfind(',') : std::string::npos;
  const std::string head = comma == std::string::npos ? "" : value.substr(0, comma + 1);
  const auto said = split(head, ',');
  completion.open = !facts.offer.suffix.empty();
  for (const std::string& name : facts.offer.names(given)) {
    const auto repeats = [&](const std::string& other) {
      return other == name || (completion.open && other.starts_with(name + facts.offer.suffix));
    };
    if (std::ranges::any_of(said, repeats)) continue;
    add(completion, before + value, before + head + name + facts.offer.suffix, "");
  }
}

void add_options(Completion& completion, const Typed& typed, const std::string& word) {
  const auto excluded = [&](const OptionDescription& option) {
    return std::ranges::any_of(typed.options, [&](const OptionDescription* given) {
      if (given == &option) return !option.repeatable;
      return std::ranges::any_of(given->excludes, [&](const std::string& name) {
        return std::ranges::find(option.names, name) != option.names.end();
      });
    });
  };
  for (const auto& option : typed.command->options) {
    if (option.positional || excluded(option)) continue;
    // A letter is for those who know it.
    const bool letter = word.size() == 2 && word[1] != '-';
    add(completion, word, letter ? option.names.front() : option.names.back(), option.help);
  }
}

void add_arguments(Completion& completion, const Typed& typed, const std::string& word) {
  if (typed.arguments == 0 && !typed.only_arguments) {
    for (const auto& kind : typed.command->kinds) {
      add(completion, word, kind.last_name(), kind.help);
    }
  }
  int room = typed.arguments;
  for (const auto& option : typed.command->options) {
    if (!option.positional) continue;
    room -= option.most_values;
    if (room >= 0) continue;
    add_values(completion, typed, option, "", word);
    return;
  }
}

}  // namespace

Completion complete(const CommandDescription& program, std::span<const std::string> words) {
  Completion completion;
  if (words.empty()) return completion;
  Typed typed{.command = &program};
  for (const auto& word : words.first(words.size() - 1)) typed.read(word);
  const std::string& last = words.back();
  const bool names_option = !last.empty() && last.front() == '-' && !typed.only_arguments;
  const auto equals = last.find('=');
  if (typed.awaits != nullptr && !(names_option && typed.awaits->least_values == 0)) {
    add_values(completion, typed, *typed.awaits, "", last);
  } else if (names_option && equals != std::string::npos) {
    const auto* option = find_option(*typed.command, last.substr(0, equals));
    if (option != nullptr && !option->type.empty()) {
      add_values(completion, typed, *option, last.substr(0, equals + 1), last.substr(equals + 1));
    }
  } else if (names_option) {
    add_options(completion, typed, last);
  } else {
    add_arguments(completion, typed, last);
  }
  return completion;
}

std::string completion_text(const Completion& completion) {
  std::string text;
  for (const Candidate& candidate : completion.candidates) {
    text += candidate.word + '\t' + candidate.help.substr(0, candidate.help.find('\n')) + '\n';
  }
  text += completion.files ? ":files" : completion.open ? ":open" : ":";
  return text + '\n';
}

}  // namespace pirt::cli
