#include <algorithm>

#include "app/cli/description.hpp"

namespace equipoise::app {

void for_each_command(const CommandDescription& command,
                      const std::function<void(const CommandDescription&)>& f) {
  f(command);
  for (const CommandDescription& below : command.commands) for_each_command(below, f);
}

namespace {

// Each asks the program; where it offers nothing, a file's name may follow.
constexpr const char* kBash = R"shell(# equipoise in bash; for this shell: source <(equipoise completion bash)
_equipoise() {
  local IFS=$'\n'
  COMPREPLY=($(equipoise completion words -- "${COMP_WORDS[@]:1:COMP_CWORD}" | cut -f1))
}
complete -o default -F _equipoise equipoise
)shell";
constexpr const char* kZsh = R"shell(#compdef equipoise
# equipoise in zsh; keep it as _equipoise in a folder of $fpath
_equipoise() {
  local -a offers=(${(f)"$(equipoise completion words -- "${(@)words[2,CURRENT]}")"})
  offers=("${(@)offers/$'\t'/:}")
  if (( $#offers )); then _describe equipoise offers; else _files; fi
}
if [ "$funcstack[1]" = _equipoise ]; then _equipoise "$@"; else compdef _equipoise equipoise; fi
)shell";
constexpr const char* kFish = R"shell(# equipoise in fish; for this shell: equipoise completion fish | source
complete -c equipoise -a '(equipoise completion words -- (commandline -opc)[2..] "$(commandline -ct)")'
)shell";

/// The option of this name that has a value; nullptr: none.
const OptionDescription* option_with_value(const CommandDescription& command, const std::string& name) {
  const auto found =
      std::find_if(command.options.begin(), command.options.end(), [&](const OptionDescription& o) {
        return !o.positional && !o.value.empty() &&
               std::find(o.names.begin(), o.names.end(), name) != o.names.end();
      });
  return found == command.options.end() ? nullptr : &*found;
}

}  // namespace

std::string offers(const CommandDescription& program, const std::vector<std::string>& words) {
  const std::string begun = words.empty() ? "" : words.back();
  const CommandDescription* command = &program;
  const OptionDescription* asks = nullptr;  // for a value
  for (std::size_t i = 0; i + 1 < words.size(); ++i) {
    asks = option_with_value(*command, words[i]);
    for (const CommandDescription& below : command->commands)
      if (below.last_word() == words[i]) command = &below;
  }
  std::string text;
  const auto offer = [&](const std::string& word, const std::string& help) {
    if (word.rfind(begun, 0) == 0) text += word + "\t" + help + "\n";
  };
  const auto offer_choices = [&](const OptionDescription& o) {
    for (const std::string& choice : o.choices) offer(choice, "");
  };
  if (asks != nullptr) {
    offer_choices(*asks);
    return text;
  }
  for (const CommandDescription& below : command->commands) offer(below.last_word(), below.help);
  for (const OptionDescription& o : command->options) {
    if (o.positional) offer_choices(o);
    for (const std::string& name : o.names)
      if (!o.positional) offer(name, o.help);
  }
  return text;
}

std::string completion(const std::string& shell) {
  if (shell == "bash") return kBash;
  return shell == "zsh" ? kZsh : kFish;
}

}  // namespace equipoise::app
