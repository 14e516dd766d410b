// What the command line offers, as data: for shell completion, manual pages and the reference. In: the
// parser's own options, so that nothing is said twice -> out: a tree of commands. Start-up only.
#pragma once

#include <functional>
#include <string>
#include <vector>

namespace equipoise::app {

struct OptionDescription {
  std::vector<std::string> names;    // "-s", "--long"; of a positional: its one name
  std::string value;                 // FILE, NUMBER, ...; empty: a flag
  std::vector<std::string> choices;  // all there are; empty: any value
  std::string range;                 // "-5 to 5"; empty: none
  std::string standard;              // without the option; empty: not said
  std::string help;
  bool positional = false;
  bool required = false;
  bool repeats = false;
};

struct CommandDescription {
  std::string name;  // "config show": without the program's
  std::string help;
  std::string example;
  std::vector<OptionDescription> options;
  std::vector<CommandDescription> commands;

  std::string last_word() const { return name.substr(name.rfind(' ') + 1); }
};

/// f(command) for the root and all below, parents first.
void for_each_command(const CommandDescription& command,
                      const std::function<void(const CommandDescription&)>& f);

/// A script for the shell, bash, zsh or fish, which asks for offers().
std::string completion(const std::string& shell);

/// What the last of these words may become, a line each: the word, a tab, its help.
std::string offers(const CommandDescription& program, const std::vector<std::string>& words);

/// "equipoise-config-show", as its manual page is called.
std::string page_name(const CommandDescription& command);
/// Manual page of a command or, of the root, of the program: roff, section 1.
std::string manual_page(const CommandDescription& command, const std::string& version);

/// All commands in one page, Markdown.
std::string reference_page(const CommandDescription& program);

}  // namespace equipoise::app
