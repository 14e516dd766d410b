#include "app/cli/command_line.hpp"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <sstream>

#include "app/text/files.hpp"
#include "config/nearest.hpp"

namespace equipoise::app {
namespace {

/// Whole text as a T that is finite and fits; the reason why not otherwise.
template <class T>
std::string number_error(const std::string& text) {
  const char* first = text.data();
  const char* const last = first + text.size();
  if (first != last && *first == '+') ++first;
  T value{};
  const auto [end, error] = std::from_chars(first, last, value);
  if (error == std::errc::result_out_of_range) return "\"" + text + "\" does not fit";
  if (error != std::errc{} || end != last) {
    return "\"" + text + "\" is not a " + (std::is_integral_v<T> ? "whole number" : "number") +
           (std::is_unsigned_v<T> ? " of 0 or more" : "");
  }
  if constexpr (std::is_floating_point_v<T>) {
    if (!std::isfinite(value)) return "\"" + text + "\" is not a finite number";
  }
  return "";
}

/// LCM would replace that file, take any provider from the environment, and abort when a TCP server is gone.
std::string url_error(const std::string& url) {
  if (url.empty()) return "names no link";
  if (url.rfind("file:", 0) == 0) return url + ": a file is no link; --log FILE writes one";
  return url.rfind("tcpq:", 0) == 0 ? url + ": ends the program when its server does; use udpm" : "";
}

void checked(CLI::Option* option, std::string (*error)(const std::string&)) {
  option->check(CLI::Validator(error, std::string{}));
}

constexpr const char* kFileType = "FILE";
const std::string kExample = "Example: ";

/// "TEXT:{dmp,own}" or "FLOAT:FLOAT in [-5 - 5]", as the parser shows it: value, choices, range.
void describe_values(const std::string& shown, OptionDescription* out) {
  out->value = shown.substr(0, shown.find(':'));
  if (out->value == "FLOAT" || out->value == "INT" || out->value == "UINT") out->value = "NUMBER";
  const std::size_t brace = shown.find('{');
  if (brace != std::string::npos) {
    std::istringstream names(shown.substr(brace + 1, shown.rfind('}') - brace - 1));
    for (std::string name; std::getline(names, name, ',');) out->choices.push_back(name);
  }
  const std::size_t range = shown.find(" in [");
  if (range != std::string::npos) {
    out->range = shown.substr(range + 5, shown.find(']', range) - range - 5);
    const std::size_t dash = out->range.find(" - ");
    if (dash != std::string::npos) out->range.replace(dash, 3, " to ");
  }
}

OptionDescription described(const CLI::Option& option) {
  OptionDescription out;
  for (const std::string& name : option.get_snames()) out.names.push_back("-" + name);
  for (const std::string& name : option.get_lnames()) out.names.push_back("--" + name);
  out.positional = option.get_positional();
  if (out.positional) out.names.push_back(option.get_name());
  if (option.get_items_expected_max() > 0) describe_values(option.get_type_name(), &out);
  out.help = option.get_description();
  out.standard = option.get_default_str();
  out.required = option.get_required();
  out.repeats = option.get_expected_max() > 1;
  return out;
}

CommandDescription described(const CLI::App& app, const std::string& name) {
  CommandDescription out;
  out.name = name;
  out.help = app.get_description();
  if (app.get_footer().rfind(kExample, 0) == 0) out.example = app.get_footer().substr(kExample.size());
  for (const CLI::Option* option : app.get_options({})) out.options.push_back(described(*option));
  for (const CLI::App* below : app.get_subcommands(std::function<bool(const CLI::App*)>{}))
    out.commands.push_back(described(*below, name + (name.empty() ? "" : " ") + below->get_name()));
  return out;
}

/// The first word that is no option or command, and what may have been meant.
struct Mistake {
  std::string where;  // "equipoise config"
  std::string word;   // empty: there is none
  std::string meant;  // empty: nothing is near
};

Mistake mistake_in(const CLI::App& root, int argc, char** argv) {
  const CLI::App* app = &root;
  std::string where = "equipoise";
  for (int i = 1; i < argc; ++i) {
    const std::string word(argv[i]);
    const std::string name = word.substr(0, word.find('='));
    if (name == "--") break;
    std::vector<std::string> known;
    const bool is_option =
        word.size() > 1 && word[0] == '-' && std::isdigit(static_cast<unsigned char>(word[1])) == 0;
    if (is_option) {
      const CLI::Option* option = app->get_option_no_throw(name);
      if (option != nullptr) {
        if (option->get_items_expected_max() > 0 && name.size() == word.size())
          i += option->get_items_expected_min();
        continue;
      }
      for (const CLI::Option* each : app->get_options({}))
        for (const std::string& one : each->get_lnames()) known.push_back("--" + one);
    } else {
      const auto below = app->get_subcommands(std::function<bool(const CLI::App*)>{});
      if (below.empty()) continue;  // an argument, or too many of them
      const auto found = std::find_if(below.begin(), below.end(),
                                      [&](const CLI::App* each) { return each->get_name() == word; });
      if (found != below.end()) {
        app = *found;
        where += " " + word;
        continue;
      }
      for (const CLI::App* each : below) known.push_back(each->get_name());
    }
    return Mistake{where, name, config::nearest(name, known)};
  }
  return {where, "", ""};
}

}  // namespace

Option Option::required() const { return Option(impl_->required()); }
Option Option::show_default() const { return Option(impl_->capture_default_str()); }
Option Option::range(double low, double high) const { return Option(impl_->check(CLI::Range(low, high))); }
Option Option::one_of(const std::vector<std::string>& names) const {
  return Option(impl_->check(CLI::IsMember(names)));
}
Option Option::excludes(const Option& other) const { return Option(impl_->excludes(other.impl_)); }
Option Option::needs(const Option& other) const { return Option(impl_->needs(other.impl_)); }
Option Option::count(int values) const { return Option(impl_->expected(values)); }
Option Option::file() const { return Option(impl_->type_name(kFileType)); }
bool Option::given() const { return impl_->count() > 0; }

Subcommand Subcommand::subcommand(const std::string& name, const std::string& help) const {
  return {impl_->add_subcommand(name, help), status_};
}
void Subcommand::require_subcommand() const { impl_->require_subcommand(1); }

Option Subcommand::option(const std::string& name, Value value, const std::string& help) const {
  const auto add = [&](auto reference) {
    using T = typename decltype(reference)::type;
    CLI::Option* option = impl_->add_option(name, reference.get(), help);
    if constexpr (std::is_same_v<T, std::string>) {
      if (name == "--json") checked(option, json_output_error);  // before the job
      if (name == "--telemetry" || name == "--command-url" || name == "--url") checked(option, url_error);
    } else if constexpr (std::is_arithmetic_v<T>) {
      checked(option, number_error<T>);
    } else if constexpr (std::is_arithmetic_v<typename T::value_type>) {
      checked(option, number_error<typename T::value_type>);
    }
    return Option(option);
  };
  return std::visit(add, value);
}
Option Subcommand::flag(const std::string& name, bool& value, const std::string& help) const {
  return Option(impl_->add_flag(name, value, help));
}
Subcommand Subcommand::example(const std::string& line) const {
  impl_->footer(kExample + line);
  return *this;
}
CommandDescription Subcommand::describe() const { return described(*impl_, ""); }
void Subcommand::action(std::function<int()> run) const {
  impl_->callback([run = std::move(run), status = status_] { *status = run(); });
}

struct CommandLine::Impl {
  explicit Impl(const std::string& help) : app(help) {}
  CLI::App app;
  int status = 0;
};

CommandLine::CommandLine(const std::string& help, const std::string& version)
    : impl_(std::make_unique<Impl>(help)) {
  impl_->app.set_version_flag("--version", version);
  impl_->app.require_subcommand(1);
  impl_->app.fallthrough(false);
}
CommandLine::~CommandLine() = default;

Subcommand CommandLine::root() { return {&impl_->app, &impl_->status}; }

int CommandLine::run(int argc, char** argv) {
  try {
    impl_->app.parse(argc, argv);
    return impl_->status;
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == 0) return impl_->app.exit(error);
    std::string what = error.what();
    std::replace(what.begin(), what.end(), '\n', ' ');
    const Mistake m = mistake_in(impl_->app, argc, argv);
    if (!m.word.empty()) {
      what = m.word + (m.word[0] == '-' ? " is no option of " : " is no command of ") + m.where +
             (m.meant.empty() ? "" : "; did you mean " + m.meant + "?");
    }
    std::fprintf(stderr, "equipoise: %s (%s --help lists what there is)\n", printable(what).c_str(),
                 m.where.c_str());
    return 2;
  }
}

}  // namespace equipoise::app
