#include <algorithm>
#include <sstream>

#include "app/cli/description.hpp"
#include "app/text/format.hpp"

namespace equipoise::app {
namespace {

constexpr const char* kAbout =
    "Keeps a robot upright on a ball (MBBR) or on two wheels (eduMIP): on a BeagleBone, against another "
    "physics engine, or in a simulated world.";

std::string upper(std::string text) {
  for (char& c : text) c = static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
  return text;
}

/// Text of a line in roff.
std::string roff(const std::string& text) {
  std::string out;
  for (const char c : text) {
    if (c == '\\')
      out += "\\e";
    else if (c == '-')
      out += "\\-";
    else
      out += c;
  }
  if (!out.empty() && (out.front() == '.' || out.front() == '\'')) out.insert(0, "\\&");
  return out;
}

/// What is known of an option's values, as a sentence or two.
std::string facts(const OptionDescription& o) {
  std::string text;
  const auto add = [&text](const std::string& fact) { text += (text.empty() ? "" : "; ") + fact; };
  if (o.required) add("required");
  if (!o.choices.empty()) add("one of: " + joined(o.choices));
  if (!o.range.empty()) add("from " + o.range);
  if (!o.standard.empty()) add("default: " + o.standard);
  if (o.repeats) add("may be repeated");
  return text;
}

std::string sentence(std::string text) {
  if (text.empty()) return text;
  text.front() = static_cast<char>(std::toupper(static_cast<unsigned char>(text.front())));
  if (text.back() != '.' && text.back() != '?') text += '.';
  return text;
}

/// A help that begins with a value keeps it as it is typed: "mbbr: ...", "dmp or own".
std::string help_of(const OptionDescription& o) {
  const std::string first = o.help.substr(0, o.help.find_first_of(" ,;"));
  const bool value = first.find_first_of(":_") != std::string::npos ||
                     std::find(o.choices.begin(), o.choices.end(), first) != o.choices.end();
  return value ? o.help + "." : sentence(o.help);
}

std::vector<OptionDescription> sorted(const CommandDescription& c, bool positional) {
  std::vector<OptionDescription> chosen;
  for (const OptionDescription& o : c.options)
    if (o.positional == positional) chosen.push_back(o);
  return chosen;
}

void roff_options(std::ostringstream& out, const CommandDescription& c) {
  for (const bool positional : {true, false}) {
    const auto options = sorted(c, positional);
    if (options.empty()) continue;
    out << ".SH " << (positional ? "ARGUMENTS" : "OPTIONS") << "\n";
    for (const OptionDescription& o : options) {
      out << ".TP\n";
      for (const std::string& name : o.names)
        out << (&name == o.names.data() ? "" : ", ") << "\\fB" << roff(name) << "\\fR";
      if (!o.value.empty() && !positional) out << " \\fI" << roff(o.value) << "\\fR";
      out << "\n" << roff(help_of(o)) << "\n";
      if (const std::string known = facts(o); !known.empty()) out << roff(sentence(known)) << "\n";
    }
  }
}

}  // namespace

std::string page_name(const CommandDescription& c) {
  std::string name = c.name.empty() ? "equipoise" : "equipoise-" + c.name;
  std::replace(name.begin(), name.end(), ' ', '-');
  return name;
}

std::string manual_page(const CommandDescription& c, const std::string& version) {
  std::ostringstream out;
  const std::string title = c.name.empty() ? "firmware and simulator of balancing robots" : c.help;
  out << ".TH " << roff(upper(page_name(c))) << " 1 \"\" \"equipoise " << version << "\" \"User Commands\"\n"
      << ".SH NAME\n"
      << roff(page_name(c)) << " \\- " << roff(title) << "\n.SH SYNOPSIS\n.B equipoise"
      << (c.name.empty() ? "" : " " + roff(c.name)) << "\n"
      << (c.commands.empty() ? "" : ".I command\n") << ".RI [ options ]\n";
  for (const OptionDescription& o : sorted(c, true)) out << ".I " << roff(o.names.front()) << "\n";
  out << ".SH DESCRIPTION\n" << roff(c.name.empty() ? kAbout : sentence(c.help)) << "\n";
  roff_options(out, c);
  if (!c.commands.empty()) {
    out << ".SH COMMANDS\n";
    for (const CommandDescription& below : c.commands)
      out << ".TP\n.BR " << roff(page_name(below)) << " (1)\n" << roff(sentence(below.help)) << "\n";
  }
  if (!c.example.empty()) out << ".SH EXAMPLE\n.nf\n" << roff(c.example) << "\n.fi\n";
  out << ".SH EXIT STATUS\n0 success, 1 a job that failed, 2 bad usage or input.\n";
  if (c.name.empty()) {
    out << ".SH FILES\n.TP\n.I /etc/default/equipoise\nWhat the service runs.\n"
           ".TP\n.I /etc/equipoise\nRobot configurations and board files.\n";
  } else {
    out << ".SH SEE ALSO\n.BR equipoise (1)\n";
  }
  return out.str();
}

std::string reference_page(const CommandDescription& program) {
  std::ostringstream out;
  out << "# Commands\n`equipoise COMMAND --help` says the same. Exit status: 0 success, 1 a job that failed, "
         "2 bad usage "
         "or input.\n";
  const auto cell = [](std::string text) {
    for (std::size_t at = 0; (at = text.find_first_of("|<", at)) != std::string::npos; at += 2)
      text.insert(at, "\\");
    return text;
  };
  for_each_command(program, [&](const CommandDescription& c) {
    if (c.name.empty()) return;
    out << "\n## equipoise " << c.name << "\n" << sentence(c.help) << "\n";
    if (!c.example.empty()) out << "\n```sh\n" << c.example << "\n```\n";
    if (c.options.size() > 1 || c.commands.empty()) out << "\n| option | what |\n|---|---|\n";
    for (const OptionDescription& o : c.options) {
      if (c.options.size() == 1 && !c.commands.empty()) break;
      std::string names;
      for (const std::string& name : o.names) names += (names.empty() ? "" : "`, `") + name;
      if (!o.value.empty() && !o.positional) names += " " + o.value;
      const std::string known = facts(o);
      out << "| `" << names << "` | " << cell(help_of(o))
          << (known.empty() ? "" : " " + cell(sentence(known))) << " |\n";
    }
  });
  return out.str();
}

}  // namespace equipoise::app
