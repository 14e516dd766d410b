#include <unistd.h>

#include <cerrno>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <set>

#include "app/cli/commands.hpp"
#include "app/log/mcap_writer.hpp"
#include "app/log/run_log.hpp"
#include "app/text/files.hpp"
#include "app/text/json.hpp"
#include "equipoise/runtime/log_parts.hpp"
#include "equipoise/runtime/wire.hpp"

namespace equipoise::app {
namespace {

using runtime::StateRecord;
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

struct Number {
  std::string name;  // field, or field_0, field_1, ... of an array
  const char* unit;
  std::string text;
  bool finite;
};

template <class Message, class Record>
std::vector<Number> numbers_of(Message, const Record& record) {
  std::vector<Number> numbers;
  const auto add = [&](std::string name, const char* unit, auto value) {
    numbers.push_back({std::move(name), unit, text_of(value), std::isfinite(static_cast<double>(value))});
  };
  Message::visit(record, [&](const char* name, const char* unit, const auto& value) {
    if constexpr (std::is_arithmetic_v<std::decay_t<decltype(value)>>) {
      add(name, unit, value);
    } else {
      std::size_t i = 0;
      for (const auto& element : value) add(std::string(name) + "_" + std::to_string(i++), unit, element);
    }
  });
  return numbers;
}

/// Which channels a log has, in alphabetical order.
std::set<std::string, std::less<>> channels_of(const std::string& path) {
  std::set<std::string, std::less<>> channels;
  LogReader reader = LogReader::open(path);
  for (LogEvent event; reader.next(&event);) {
    channels.emplace(event.channel);
  }
  return channels;
}

/// One row per tick; columns channel.field. What a tick lacks is an empty cell.
class CsvRows {
 public:
  explicit CsvRows(const std::string& path) {
    for (const std::string& channel : channels_of(path)) {
      has_truth_ = has_truth_ || channel == fields::kTruthChannel;
      has_faults_ = has_faults_ || channel == fields::kFaultsChannel;
      if (channel.rfind(fields::kComparedChannel, 0) == 0)
        estimators_.push_back(short_name(channel.substr(fields::kComparedChannel.size())));
    }
  }

  std::string head() const {
    std::string line = "t_s,tick";
    const auto add = [&line](const std::string& channel, const std::vector<Number>& numbers) {
      for (const Number& n : numbers) line += "," + channel + "." + n.name;
    };
    const TickRecord none{};
    fields::each_message(none, [&](auto message, const char* channel, const auto& record) {
      add(short_name(channel), numbers_of(message, record));
    });
    if (has_truth_) add("truth", numbers_of(fields::State{}, none.truth));
    if (has_faults_) add("faults", numbers_of(fields::Faults{}, none.faults));
    for (const std::string& estimator : estimators_)
      add("state_" + estimator, numbers_of(fields::State{}, none.estimate));
    return line + "\n";
  }

  const std::string& row(const TickRecord& tick, const std::vector<std::string>& others) {
    row_.clear();
    char time[32];
    std::snprintf(time, sizeof time, "%.6f", static_cast<double>(tick.now_ns) * 1e-9);
    row_ += time;
    row_ += ',';
    row_ += text_of(tick.tick);
    fields::each_message(tick, [&](auto message, const char*, const auto& record) {
      cells(numbers_of(message, record), true);
    });
    if (has_truth_) cells(numbers_of(fields::State{}, tick.truth), tick.has_truth);
    if (has_faults_) cells(numbers_of(fields::Faults{}, tick.faults), tick.faults.bound > 0.0);
    for (const std::string& estimator : estimators_) {
      const auto found = std::find(others.begin(), others.end(), estimator);
      const auto i = static_cast<std::size_t>(found - others.begin());
      const bool has = found != others.end() && (tick.compared & (1U << i)) != 0;
      cells(numbers_of(fields::State{}, tick.others[has ? i : 0]), has);
    }
    row_ += '\n';
    return row_;
  }

 private:
  void cells(const std::vector<Number>& numbers, bool has) {
    for (const Number& n : numbers) {
      row_ += ',';
      if (has) row_ += n.text;
    }
  }

  bool has_truth_ = false, has_faults_ = false;
  std::vector<std::string> estimators_;
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

/// Every message of the log as JSON numbers: what Foxglove plots without a plug-in.
class McapMessages {
 public:
  explicit McapMessages(std::ostream& out) : mcap_(out) {}

  void run(const runtime::RunInfo& run) {
    std::map<std::string, std::string> entries;
    fields::Run::visit(run, [&](const char* name, const char*, const auto& value) {
      if constexpr (std::is_arithmetic_v<std::decay_t<decltype(value)>>) {
        entries[name] = text_of(value);
      } else {
        entries[name] = value;
      }
    });
    mcap_.metadata("run", entries);
  }

  void event(const LogEvent& event) {
    const bool state =
        event.channel == fields::kTruthChannel || event.channel.rfind(fields::kComparedChannel, 0) == 0;
    const auto take = [&](auto type, auto& record) {
      std::int64_t utime = 0;
      std::int64_t tick = 0;
      if (runtime::decode(type, event.data, &record, &utime, &tick))
        message(event, utime, tick, numbers_of(type, record));
    };
    if (state) take(fields::State{}, tick_.truth);
    if (event.channel == fields::kFaultsChannel) take(fields::Faults{}, tick_.faults);
    if (event.channel == fields::kHistogramChannel) take(fields::Histogram{}, histogram_);
    if (event.channel == fields::kEndChannel) take(fields::End{}, end_);
    fields::each_message(tick_, [&](auto type, std::string_view channel, auto& record) {
      if (channel == event.channel) take(type, record);
    });
  }

  void finish() { mcap_.finish(); }

 private:
  void message(const LogEvent& event, std::int64_t utime, std::int64_t tick,
               const std::vector<Number>& numbers) {
    json_ = "{\"tick\":" + text_of(tick);
    for (const Number& n : numbers)
      json_ += ",\"" + n.name + "\":" + (n.finite ? n.text : "null");  // JSON knows no other word for it
    json_ += '}';
    mcap_.message(channel(event.channel, numbers), utime * 1000, json_);
  }

  std::uint16_t channel(std::string_view name, const std::vector<Number>& numbers) {
    const auto known = channels_.find(name);
    if (known != channels_.end()) return known->second;
    nlohmann::json schema = {{"type", "object"}, {"properties", {{"tick", {{"type", "integer"}}}}}};
    for (const Number& n : numbers) {
      schema["properties"][n.name] = {{"type", "number"}};
      if (*n.unit != '\0') schema["properties"][n.name]["description"] = n.unit;
    }
    const std::uint16_t id = mcap_.add_channel("equipoise/" + short_name(name), schema.dump());
    channels_.emplace(name, id);
    return id;
  }

  McapWriter mcap_;
  std::map<std::string, std::uint16_t, std::less<>> channels_;
  TickRecord tick_{};
  fields::HistogramRecord histogram_{};
  runtime::EndRecord end_;
  std::string json_;
};

std::int64_t write_mcap(const std::string& path, std::ostream& out) {
  McapMessages messages(out);
  messages.run(RunLog(path).run());
  LogReader reader = LogReader::open(path);
  reader.show_progress("convert");
  std::int64_t ticks = 0;
  for (LogEvent event; reader.next(&event);) {
    messages.event(event);
    ticks += event.channel == fields::kSensorsChannel ? 1 : 0;
  }
  messages.finish();
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
  std::ofstream file(a.out, std::ios::binary);
  const std::int64_t ticks = a.to == "csv" ? write_csv(a.log, file) : write_mcap(a.log, file);
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
