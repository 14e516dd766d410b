#include "app/identify/bench_log.hpp"

#include <lcm/lcm.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <equipoise/bench_t.hpp>
#include <memory>

#include "app/import/import.hpp"
#include "app/log/log_reader.hpp"
#include "app/text/errors.hpp"
#include "app/text/files.hpp"

namespace equipoise::app {
namespace {

constexpr const char* kChannel = "EQUIPOISE_BENCH";

void append(const std::string& path, const BenchSample& row, BenchLog* log) {
  if (!log->rows.empty() && !(row.t_s > log->rows.back().t_s)) {
    throw InputError(path + ": time does not advance at sample " + std::to_string(log->rows.size()));
  }
  log->rows.push_back(row);
}

BenchLog read_lcm(const std::string& path) {
  LogReader reader = LogReader::open(path);
  BenchLog log;
  bench_t message{};
  std::size_t events = 0;
  for (LogEvent event; reader.next(&event); ++events) {
    if (event.channel != kChannel) continue;
    if (message.decode(event.data.data(), 0, static_cast<int>(event.data.size())) < 0) {
      throw InputError(path + ": " + kChannel + " has messages of another version of bench_t");
    }
    if (log.rows.empty()) {
      log.axis = message.axis;
      log.radius_ratio = message.radius_ratio;
      log.bridge = message.bridge == 1   ? LoggedBridge::kDriveBrake
                   : message.bridge == 2 ? LoggedBridge::kDriveCoast
                                         : LoggedBridge::kUnknown;
    }
    const double t_s = 1e-6 * static_cast<double>(message.utime);
    append(path, {t_s, message.u, message.current_A, message.supply_V, message.angle_rad}, &log);
  }
  if (events == 0) throw InputError(path + ": is not an LCM event log, or holds no whole event");
  if (log.rows.empty())
    throw InputError(path + ": no " + kChannel + " channel; record it with motor-bench --log");
  return log;
}

struct Field {
  const char* name;
  double BenchSample::*value;
  bool optional;  // of a bench without the sensor
};

BenchLog read_csv(const std::string& path) {
  static constexpr std::array<Field, 5> kFields{{{"t_s", &BenchSample::t_s, false},
                                                 {"u", &BenchSample::u, false},
                                                 {"current_A", &BenchSample::current_A, true},
                                                 {"supply_V", &BenchSample::supply_V, true},
                                                 {"angle_rad", &BenchSample::angle_rad, false}}};
  const Table table = read_table(path, {});
  if (table.torn_rows > 0)
    throw InputError(path + ": " + std::to_string(table.torn_rows) + " rows have not a cell for each column");
  std::vector<BenchSample> rows(table.rows());
  for (const Field& field : kFields) {
    const bool there = std::count(table.names.begin(), table.names.end(), field.name) > 0;
    if (!there && !field.optional)
      throw InputError(path + ":1: no column " + field.name +
                       "; expected t_s,u,current_A,supply_V,angle_rad");
    const std::vector<double>* column = there ? &table.column(field.name) : nullptr;
    for (std::size_t k = 0; k < rows.size(); ++k) {
      double& value = rows[k].*field.value;
      value = there ? (*column)[k] : std::numeric_limits<double>::quiet_NaN();
      if (std::isnan(value) && !field.optional)
        throw InputError(path + ": " + field.name + " is missing in sample " + std::to_string(k));
    }
  }
  BenchLog log;
  for (const BenchSample& row : rows) append(path, row, &log);
  return log;
}

}  // namespace

void write_bench_log(const std::string& path, const BenchLog& log) {
  check_log(path);
  const std::unique_ptr<lcm_eventlog_t, void (*)(lcm_eventlog_t*)> file(
      lcm_eventlog_create(path.c_str(), "w"), lcm_eventlog_destroy);
  if (file == nullptr) throw InputError(path + ": log cannot be created: " + std::strerror(errno));
  bench_t message{};
  message.bridge = static_cast<std::int32_t>(log.bridge);
  message.axis = log.axis;
  message.radius_ratio = log.radius_ratio;
  std::vector<std::uint8_t> bytes(static_cast<std::size_t>(message.getEncodedSize()));
  for (const BenchSample& row : log.rows) {
    message.utime = std::llround(row.t_s * 1e6);
    message.u = row.u;
    message.current_A = row.current_A;
    message.supply_V = row.supply_V;
    message.angle_rad = row.angle_rad;
    message.encode(bytes.data(), 0, static_cast<int>(bytes.size()));
    lcm_eventlog_event_t event{};
    event.timestamp = message.utime;
    event.channellen = static_cast<std::int32_t>(std::strlen(kChannel));
    event.datalen = static_cast<std::int32_t>(bytes.size());
    event.channel = const_cast<char*>(kChannel);
    event.data = bytes.data();
    if (lcm_eventlog_write_event(file.get(), &event) != 0) throw InputError(path + ": cannot be written");
    ++message.tick;
  }
  if (std::fflush(file->f) != 0) throw InputError(path + ": cannot be written: " + std::strerror(errno));
}

BenchLog read_bench_table(const std::string& path, const std::string& map, int motor) {
  const ImportMap columns = read_bench_map(map);
  BenchLog log;
  log.rows = imported_bench(read_table(path, columns.table), columns, static_cast<std::size_t>(motor - 1));
  return log;
}

BenchLog read_bench_log(const std::string& path) {
  const bool csv = path.size() > 4 && path.compare(path.size() - 4, 4, ".csv") == 0;
  return csv ? read_csv(path) : read_lcm(path);
}

}  // namespace equipoise::app
