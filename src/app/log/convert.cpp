#include <unistd.h>

#include <cerrno>
#include <charconv>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <set>

#include "app/cli/commands.hpp"
#include "app/log/run_log.hpp"
#include "app/text/files.hpp"
#include "app/text/format.hpp"
#include "equipoise/runtime/log_parts.hpp"
#include "equipoise/runtime/wire.hpp"

namespace equipoise::app {
namespace {

using runtime::TickRecord;
namespace fields = runtime::fields;

struct ConvertArguments {
  std::string log;
  std::string to;
  std::string out;
};

/// Shortest text that reads back as the same number.
constexpr auto text_of = [](auto value) -> std::string {
  if constexpr (std::is_same_v<decltype(value), bool>) {
    return value ? "1" : "0";
  } else {
    char text[40];
    return {text, std::to_chars(std::begin(text), std::end(text), value).ptr};
  }
};

/// each(name, value) of every number of a message: its field, or field_0, field_1, ... of an array.
constexpr auto each_number = [](auto message, const auto& record, auto&& each) {
  decltype(message)::visit(record, [&](const std::string& name, const auto& value) {
    if constexpr (std::is_arithmetic_v<std::decay_t<decltype(value)>>) {
      each(name, value);
    } else {
      std::size_t i = 0;
      for (const auto& element : value) each(name + "_" + std::to_string(i++), element);
    }
  });
};

/// One row per tick; columns channel.field. What a tick lacks is an empty cell.
class CsvRows {
 public:
  explicit CsvRows(const std::string& path) {
    LogReader reader = LogReader::open(path);
    for (LogEvent event; reader.next(&event);) {
      has_truth_ = has_truth_ || event.channel == fields::kTruthChannel;
      has_faults_ = has_faults_ || event.channel == fields::kFaultsChannel;
      if (event.channel.rfind(fields::kComparedChannel, 0) == 0)
        estimators_.insert(short_name(event.channel.substr(fields::kComparedChannel.size())));
    }
  }

  std::string head() const {
    std::string line = "t_s,tick";
    const auto add = [&line](const std::string& channel, auto message, const auto& record) {
      each_number(message, record,
                  [&](const std::string& name, auto) { line += "," + channel + "." + name; });
    };
    const TickRecord none{};
    fields::each_message(none, [&](auto message, const char* channel, const auto& record) {
      add(short_name(channel), message, record);
    });
    if (has_truth_) add("truth", fields::State{}, none.truth);
    if (has_faults_) add("faults", fields::Faults{}, none.faults);
    for (const std::string& estimator : estimators_)
      add("state_" + estimator, fields::State{}, none.estimate);
    return line + "\n";
  }

  const std::string& row(const TickRecord& tick, const std::vector<std::string>& others) {
    const auto cells = [this](auto message, const auto& record, bool has) {
      each_number(message, record, [&](const std::string&, auto value) {
        row_ += ',';
        if (has) row_ += text_of(value);
      });
    };
    row_ = format("%.6f,", static_cast<double>(tick.now_ns) * 1e-9) + text_of(tick.tick);
    fields::each_message(
        tick, [&](auto message, const char*, const auto& record) { cells(message, record, true); });
    if (has_truth_) cells(fields::State{}, tick.truth, tick.has_truth);
    if (has_faults_) cells(fields::Faults{}, tick.faults, tick.faults.bound > 0.0);
    for (const std::string& estimator : estimators_) {
      const auto found = std::find(others.begin(), others.end(), estimator);
      const auto i = static_cast<std::size_t>(found - others.begin());
      const bool has = found != others.end() && (tick.compared & (1U << i)) != 0;
      cells(fields::State{}, tick.others[has ? i : 0], has);
    }
    row_ += '\n';
    return row_;
  }

 private:
  bool has_truth_ = false, has_faults_ = false;
  std::set<std::string> estimators_;
  std::string row_;
};

std::int64_t write_csv(const std::string& path, std::ostream& out) {
  CsvRows rows(path);
  out << rows.head();
  RunLog log(path);
  log.show_progress("convert");
  std::int64_t ticks = 0;
  for (TickRecord tick; log.next(&tick); ++ticks) out << rows.row(tick, log.estimators());
  return ticks;
}

/// Becomes the Python package's converter: in the interpreter of the build, if this is one, else the user's.
[[noreturn]] void convert_in_python(const ConvertArguments& a) {
  constexpr const char* kProgram = R"(import importlib, sys
sys.path[:] = [folder for folder in sys.path if folder]  # nothing from where the user happens to be
to, extra = sys.argv.pop(1), sys.argv.pop(1)
try:
    main = importlib.import_module("equipoise_robot." + to).main
except ModuleNotFoundError as error:
    install = f"in a clone of Equipoise: pip install '.[{extra}]'"
    print(f"error: --to {to} needs the Python module {error.name}; {install}", file=sys.stderr)
    sys.exit(2)
sys.exit(main()))";
  const std::filesystem::path own =
      std::filesystem::read_symlink("/proc/self/exe").parent_path().parent_path() / "venv/bin/python";
  const std::string python = std::filesystem::exists(own) ? own.string() : "python3";
  const char* const extra = a.to == "rosbag2" ? "ros" : a.to.c_str();  // of pyproject.toml
  std::vector<const char*> arguments{python.c_str(), "-c", kProgram, a.to.c_str(), extra, a.log.c_str()};
  if (!a.out.empty()) arguments.insert(arguments.end(), {"--out", a.out.c_str()});
  arguments.push_back(nullptr);
  execvp(python.c_str(), const_cast<char* const*>(arguments.data()));
  throw InputError(python + ": " + std::strerror(errno) + "; --to " + a.to + " needs Python 3");
}

int convert(ConvertArguments a) {
  TickRecord first;
  if (!RunLog(a.log).next(&first)) throw InputError(a.log + ": holds no whole tick");
  if (a.to == "rosbag2" || a.to == "lerobot") convert_in_python(a);
  if (a.out.empty()) a.out = std::filesystem::path(a.log).replace_extension(a.to).string();
  for (const std::string& part : runtime::existing_log_parts(a.log)) {
    std::error_code ignored;
    if (std::filesystem::equivalent(part, a.out, ignored))
      throw InputError("--out " + a.out + ": is the log itself; choose another name");
  }
  check_output(a.out, {a.to == "csv" ? "t_s,tick" : "\x89MCAP"}, a.to);
  if (a.to == "mcap") convert_in_python(a);
  std::ofstream file(a.out, std::ios::binary);
  const std::int64_t ticks = write_csv(a.log, file);
  if (!file.flush()) throw InputError(a.out + ": cannot be written");
  std::printf("%s: %lld ticks\n", a.out.c_str(), static_cast<long long>(ticks));
  return 0;
}

}  // namespace

void add_convert(Subcommand app) {
  const Subcommand command = app.subcommand("convert", "Converts a log for other tools")
                                 .example("equipoise convert logs/latest/run.lcm --to mcap");
  auto a = std::make_shared<ConvertArguments>();
  command.option("log", a->log, "LCM event log of sim or run; its further parts are found").file().required();
  command
      .option("--to", a->to, "mcap (Foxglove), csv, rosbag2 (ROS 2; a folder) or lerobot (LeRobot; a folder)")
      .required()
      .one_of({"mcap", "csv", "rosbag2", "lerobot"});
  command.option("--out", a->out, "where to (default: beside the log)").file();
  command.action([=] { return convert(*a); });
}

}  // namespace equipoise::app
