// Subcommand-line options without the parser's header: a subcommand declares typed options and one action.
// In: argv -> out: exit code: 0 success, 1 a job that failed, 2 bad usage (said on stderr). Numbers are
// checked: NaN, infinity, a sign where none belongs and values that do not fit are refused. Start-up only.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <variant>
#include <vector>

#include "app/cli/description.hpp"
#include "equipoise/no_copy.hpp"

namespace CLI {
class App;
class Option;
}  // namespace CLI

namespace equipoise::app {

/// A handle: copies name the same option.
class Option {
 public:
  Option required() const;
  Option show_default() const;
  Option range(double low, double high) const;
  Option one_of(const std::vector<std::string>& names) const;
  Option excludes(const Option& other) const;
  Option needs(const Option& other) const;
  Option count(int values) const;  // exactly so many values
  Option file() const;             // its value names a file
  bool given() const;              // in the action: the user named it

 private:
  friend class Subcommand;
  explicit Option(CLI::Option* impl) : impl_(impl) {}
  CLI::Option* impl_;
};

/// A handle: copies name the same command. `name` of an option as "--long", "-s,--long" or, positional,
/// "file".
class Subcommand {
 public:
  /// Where an option's value goes, by its type.
  using Value =
      std::variant<std::reference_wrapper<std::string>, std::reference_wrapper<double>,
                   std::reference_wrapper<int>, std::reference_wrapper<std::int64_t>,
                   std::reference_wrapper<std::uint64_t>, std::reference_wrapper<std::vector<std::string>>,
                   std::reference_wrapper<std::vector<double>>, std::reference_wrapper<std::vector<int>>>;

  Subcommand subcommand(const std::string& name, const std::string& help) const;
  void require_subcommand() const;

  Option option(const std::string& name, Value value, const std::string& help = "") const;
  /// "--yes" or "--yes,!--no".
  Option flag(const std::string& name, bool& value, const std::string& help = "") const;

  /// A line that works, for help and manual.
  Subcommand example(const std::string& line) const;

  /// Everything below, as it stands now. Of the root.
  CommandDescription describe() const;

  /// Runs when the command was named; returns the exit code.
  void action(std::function<int()> run) const;

 private:
  friend class CommandLine;
  Subcommand(CLI::App* impl, int* status) : impl_(impl), status_(status) {}
  CLI::App* impl_;
  int* status_;
};

class CommandLine : NoCopy {
 public:
  CommandLine(const std::string& help, const std::string& version);
  ~CommandLine();

  Subcommand root();
  /// Exit code. What an action throws is the caller's.
  int run(int argc, char** argv);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace equipoise::app
