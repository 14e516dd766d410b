#include "app/cli/command_line.hpp"

#include <CLI/CLI.hpp>
#include <charconv>
#include <cmath>

namespace equipoise::app {
namespace {

CLI::Option* option_of(void* impl) { return static_cast<CLI::Option*>(impl); }
CLI::App* app_of(void* impl) { return static_cast<CLI::App*>(impl); }

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

template <class T>
CLI::Option* add(void* impl, const std::string& name, T& value, const std::string& help) {
  return app_of(impl)->add_option(name, value, help);
}

template <class Number, class T>
CLI::Option* add_numbers(void* impl, const std::string& name, T& value, const std::string& help) {
  CLI::Option* option = add(impl, name, value, help);
  CLI::Validator check(number_error<Number>, std::string{});
  option->check(check);
  return option;
}

}  // namespace

Option Option::required() const {
  option_of(impl_)->required();
  return *this;
}
Option Option::show_default() const {
  option_of(impl_)->capture_default_str();
  return *this;
}
Option Option::range(double low, double high) const {
  option_of(impl_)->check(CLI::Range(low, high));
  return *this;
}
Option Option::one_of(const std::vector<std::string>& names) const {
  option_of(impl_)->check(CLI::IsMember(names));
  return *this;
}
Option Option::excludes(const Option& other) const {
  option_of(impl_)->excludes(option_of(other.impl_));
  return *this;
}
Option Option::needs(const Option& other) const {
  option_of(impl_)->needs(option_of(other.impl_));
  return *this;
}
Option Option::count(int values) const {
  option_of(impl_)->expected(values);
  return *this;
}
bool Option::given() const { return option_of(impl_)->count() > 0; }

Subcommand Subcommand::subcommand(const std::string& name, const std::string& help) const {
  return {app_of(impl_)->add_subcommand(name, help), status_};
}
void Subcommand::require_subcommand() const { app_of(impl_)->require_subcommand(1); }

Option Subcommand::option(const std::string& name, std::string& value, const std::string& help) const {
  return Option(add(impl_, name, value, help));
}
Option Subcommand::option(const std::string& name, double& value, const std::string& help) const {
  return Option(add_numbers<double>(impl_, name, value, help));
}
Option Subcommand::option(const std::string& name, int& value, const std::string& help) const {
  return Option(add_numbers<int>(impl_, name, value, help));
}
Option Subcommand::option(const std::string& name, std::int64_t& value, const std::string& help) const {
  return Option(add_numbers<std::int64_t>(impl_, name, value, help));
}
Option Subcommand::option(const std::string& name, std::uint64_t& value, const std::string& help) const {
  return Option(add_numbers<std::uint64_t>(impl_, name, value, help));
}
Option Subcommand::option(const std::string& name, std::vector<std::string>& value,
                          const std::string& help) const {
  return Option(add(impl_, name, value, help));
}
Option Subcommand::option(const std::string& name, std::vector<double>& value,
                          const std::string& help) const {
  return Option(add_numbers<double>(impl_, name, value, help));
}
Option Subcommand::option(const std::string& name, std::vector<int>& value, const std::string& help) const {
  return Option(add_numbers<int>(impl_, name, value, help));
}
Option Subcommand::flag(const std::string& name, bool& value, const std::string& help) const {
  return Option(app_of(impl_)->add_flag(name, value, help));
}
void Subcommand::action(std::function<int()> run) const {
  app_of(impl_)->callback([run = std::move(run), status = status_] { *status = run(); });
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
    impl_->app.exit(error);
    return error.get_exit_code() == 0 ? 0 : 2;
  }
}

}  // namespace equipoise::app
