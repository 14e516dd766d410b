// `equipoise completion` and `equipoise man`: what the command line offers, for shells and readers.
#include <cstdio>
#include <filesystem>
#include <fstream>

#include "app/cli/commands.hpp"
#include "app/text/version.hpp"

namespace equipoise::app {
namespace {

void write_pages(const CommandDescription& program, const std::string& folder) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  for_each_command(program, [&](const CommandDescription& c) {
    const std::string path = folder + "/" + page_name(c) + ".1";
    std::ofstream file(path);
    if (!(file << manual_page(c, version()) << std::flush)) throw InputError(path + ": cannot be written");
  });
}

}  // namespace

void add_completion(Subcommand app) {
  const Subcommand command =
      app.subcommand("completion", "Prints a script with which a shell completes commands and options")
          .example("source <(equipoise completion bash)");
  auto shell = std::make_shared<std::string>();
  auto words = std::make_shared<std::vector<std::string>>();
  command.option("shell", *shell, "bash, zsh, fish; words: what such a script asks for, the ways to go on")
      .required()
      .one_of({"bash", "zsh", "fish", "words"});
  command.option("line", *words, "the words so far, behind --; the last is begun");
  command.action([=] {
    const bool asked = *shell == "words";
    std::printf("%s", (asked ? offers(app.describe(), *words) : completion(*shell)).c_str());
    return 0;
  });
}

void add_man(Subcommand app) {
  const Subcommand command =
      app.subcommand("man", "Writes the manual: a page for every command, or all of it in one")
          .example("equipoise man --out man1 && man -l man1/equipoise-sim.1");
  struct Arguments {
    std::string to = "roff";
    std::string out;
  };
  auto a = std::make_shared<Arguments>();
  command.option("--to", a->to, "roff (a page for each), or markdown (one page, printed)")
      .show_default()
      .one_of({"roff", "markdown"});
  const Option out = command.option("--out", a->out, "folder for the pages of roff").file();
  command.action([=] {
    const CommandDescription program = app.describe();
    if (a->to == "markdown") {
      std::printf("%s", reference_page(program).c_str());
    } else if (out.given()) {
      write_pages(program, a->out);
    } else {
      throw InputError("man: roff needs a folder for its pages: --out DIRECTORY");
    }
    return 0;
  });
}

}  // namespace equipoise::app
