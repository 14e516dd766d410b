#include <algorithm>
#include <sstream>

#include "app/cli/description.hpp"

namespace equipoise::app {

void for_each_command(const CommandDescription& command,
                      const std::function<void(const CommandDescription&)>& f) {
  f(command);
  for (const CommandDescription& below : command.commands) for_each_command(below, f);
}

namespace {

using Command = CommandDescription;

std::string joined(const std::vector<std::string>& words, const std::string& between) {
  std::string text;
  for (const std::string& word : words) text += (text.empty() ? "" : between) + word;
  return text;
}

std::string last_word(const std::string& name) { return name.substr(name.rfind(' ') + 1); }

std::string path_of(const Command& c) { return c.name.empty() ? "equipoise" : "equipoise " + c.name; }

/// "equipoise config show" -> "_equipoise_config_show".
std::string function_of(const Command& c) {
  std::string name = "_" + path_of(c);
  std::replace(name.begin(), name.end(), ' ', '_');
  std::replace(name.begin(), name.end(), '-', '_');
  return name;
}

/// `text` with a backslash before each of `special`.
std::string escaped(const std::string& text, const std::string& special) {
  std::string out;
  for (const char c : text) {
    if (special.find(c) != std::string::npos) out += '\\';
    out += c;
  }
  return out;
}

/// Inside single quotes of a POSIX shell.
std::string quoted(const std::string& text) {
  std::string out = "'";
  for (const char c : text) {
    if (c == '\'')
      out += "'\\''";
    else
      out += c;
  }
  return out + "'";
}

bool is_file(const OptionDescription& o) { return o.value == "FILE"; }

std::string bash(const Command& program) {
  std::vector<std::string> commands;
  std::ostringstream values;
  std::ostringstream words;
  for_each_command(program, [&](const Command& c) {
    std::vector<std::string> offered;
    for (const Command& below : c.commands) {
      commands.push_back('"' + path_of(below) + '"');
      offered.push_back(last_word(below.name));
    }
    for (const OptionDescription& o : c.options) {
      if (o.positional) continue;
      offered.insert(offered.end(), o.names.begin(), o.names.end());
      if (o.value.empty()) continue;
      for (const std::string& name : o.names)
        values << (&name == o.names.data() ? "  " : " | ") << '"' << path_of(c) << ' ' << name << '"';
      if (!o.choices.empty()) {
        values << ") COMPREPLY=($(compgen -W \"" << joined(o.choices, " ") << "\" -- \"$word\")) ;;\n";
      } else {
        values << ") " << (is_file(o) ? "COMPREPLY=($(compgen -f -- \"$word\"))" : "COMPREPLY=()") << " ;;\n";
      }
    }
    words << "  \"" << path_of(c) << "\") offered=\"" << joined(offered, " ") << "\" ;;\n";
  });
  std::ostringstream out;
  out << "# equipoise in bash; for this shell: source <(equipoise completion bash)\n"
         "_equipoise() {\n"
         "  local word=${COMP_WORDS[COMP_CWORD]} before=${COMP_WORDS[COMP_CWORD - 1]} path=equipoise "
         "offered= i\n"
         "  for ((i = 1; i < COMP_CWORD; ++i)); do\n"
         "    case \"$path ${COMP_WORDS[i]}\" in\n    "
      << joined(commands, " | ")
      << ") path=\"$path ${COMP_WORDS[i]}\" ;;\n"
         "    esac\n"
         "  done\n"
         "  case \"$path $before\" in\n"
      << values.str()
      << "  *)\n"
         "    case $path in\n"
      << words.str()
      << "    esac\n"
         "    COMPREPLY=($(compgen -W \"$offered\" -- \"$word\"))\n"
         "    [[ $word == -* ]] || COMPREPLY+=($(compgen -f -- \"$word\"))\n"
         "    ;;\n"
         "  esac\n"
         "}\n"
         "complete -o filenames -F _equipoise equipoise\n";
  return out.str();
}

/// What zsh's _arguments knows of one name of an option.
std::string zsh_argument(const OptionDescription& o, const std::string& name) {
  std::string action;
  if (!o.choices.empty()) {
    action = ":value:(" + joined(o.choices, " ") + ")";
  } else if (!o.value.empty()) {
    action = is_file(o) ? ":file:_files" : ":" + escaped(o.value, ":[]") + ":";
  }
  return quoted((o.repeats ? "*" : "") + name + "[" + escaped(o.help, "[]:") + "]" + action);
}

std::string zsh(const Command& program) {
  std::ostringstream out;
  out << "#compdef equipoise\n"
         "# equipoise in zsh; keep it as _equipoise in a folder of $fpath\n";
  for_each_command(program, [&](const Command& c) {
    out << function_of(c) << "() {\n";
    if (c.commands.empty()) {
      out << "  _arguments -s";
      for (const OptionDescription& o : c.options) {
        if (o.positional) {
          out << " \\\n    " << quoted("*:" + o.names.front() + ":_files");
          continue;
        }
        for (const std::string& name : o.names) out << " \\\n    " << zsh_argument(o, name);
      }
      out << "\n}\n";
      return;
    }
    out << "  local line state\n  _arguments -C '1: :->command' '*::argument:->arguments'\n"
           "  case $state in\n  command)\n    local -a commands=(\n";
    for (const Command& below : c.commands)
      out << "      " << quoted(escaped(last_word(below.name), ":") + ":" + below.help) << "\n";
    out << "    )\n    _describe command commands\n    ;;\n  arguments)\n    case $line[1] in\n";
    for (const Command& below : c.commands)
      out << "    " << last_word(below.name) << ") " << function_of(below) << " ;;\n";
    out << "    esac\n    ;;\n  esac\n}\n";
  });
  // zsh runs the file itself the first time; sourced, it only has to be told of.
  out << "if [ \"$funcstack[1]\" = _equipoise ]; then _equipoise \"$@\"; else compdef _equipoise equipoise; "
         "fi\n";
  return out.str();
}

std::string fish(const Command& program) {
  std::ostringstream out;
  out << "# equipoise in fish; for this shell: equipoise completion fish | source\n";
  for_each_command(program, [&](const Command& c) {
    std::string condition;
    std::istringstream parts(c.name);
    for (std::string part; parts >> part;)
      condition += (condition.empty() ? "" : "; and ") + ("__fish_seen_subcommand_from " + part);
    std::vector<std::string> below;
    for (const Command& child : c.commands) below.push_back(last_word(child.name));
    const std::string nothing_below =
        below.empty() ? "" : "not __fish_seen_subcommand_from " + joined(below, " ");
    const std::string here =
        condition + (condition.empty() || nothing_below.empty() ? "" : "; and ") + nothing_below;
    for (const Command& child : c.commands)
      out << "complete -c equipoise -f -n " << quoted(here) << " -a " << last_word(child.name) << " -d "
          << quoted(child.help) << "\n";
    for (const OptionDescription& o : c.options) {
      if (o.positional) continue;
      out << "complete -c equipoise -n " << quoted(here);
      for (const std::string& name : o.names)
        out << (name.rfind("--", 0) == 0 ? " -l " + name.substr(2) : " -s " + name.substr(1));
      if (!o.choices.empty()) {
        out << " -x -a " << quoted(joined(o.choices, " "));
      } else if (!o.value.empty()) {
        out << (is_file(o) ? " -r" : " -x");
      }
      out << " -d " << quoted(o.help) << "\n";
    }
  });
  return out.str();
}

}  // namespace

std::string completion(const Command& program, const std::string& shell) {
  if (shell == "bash") return bash(program);
  if (shell == "zsh") return zsh(program);
  return fish(program);
}

}  // namespace equipoise::app
