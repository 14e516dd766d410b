#include "app/identify/bench_log.hpp"

#include <lcm/lcm.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <equipoise/bench_t.hpp>
#include <limits>
#include <memory>
#include <sstream>

#include "app/cli/commands.hpp"
#include "app/text/files.hpp"

namespace equipoise::app {
namespace {

constexpr const char* kChannel = "EQUIPOISE_BENCH";

struct CloseLog {
  void operator()(lcm_eventlog_t* log) const { lcm_eventlog_destroy(log); }
};
using LogFile = std::unique_ptr<lcm_eventlog_t, CloseLog>;

struct FreeEvent {
  void operator()(lcm_eventlog_event_t* event) const { lcm_eventlog_free_event(event); }
};

void append(const std::string& path, const BenchSample& row, BenchLog* log) {
  if (!log->rows.empty() && !(row.t_s > log->rows.back().t_s)) {
    throw InputError(path + ": time does not advance at sample " + std::to_string(log->rows.size()));
  }
  log->rows.push_back(row);
}

}  // namespace

void write_bench_log(const std::string& path, const BenchLog& log) {
  const LogFile file(lcm_eventlog_create(path.c_str(), "w"));
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

namespace {

BenchLog read_lcm(const std::string& path) {
  const LogFile file(lcm_eventlog_create(path.c_str(), "r"));
  if (file == nullptr) throw InputError(path + ": cannot be opened: " + std::strerror(errno));
  BenchLog log;
  bench_t message{};
  std::size_t events = 0;
  while (auto event =
             std::unique_ptr<lcm_eventlog_event_t, FreeEvent>(lcm_eventlog_read_next_event(file.get()))) {
    ++events;
    if (std::string(event->channel, static_cast<std::size_t>(event->channellen)) != kChannel) continue;
    if (message.decode(event->data, 0, event->datalen) < 0) {
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

std::vector<std::string> cells(const std::string& line) {
  std::vector<std::string> out;
  std::istringstream stream(line);
  for (std::string cell; std::getline(stream, cell, ',');) {
    cell.erase(std::remove_if(cell.begin(), cell.end(), [](unsigned char c) { return std::isspace(c); }),
               cell.end());
    out.push_back(cell);
  }
  return out;
}

BenchLog read_csv(const std::string& path) {
  static constexpr std::array<double BenchSample::*, 5> kFields{
      &BenchSample::t_s, &BenchSample::u, &BenchSample::current_A, &BenchSample::supply_V,
      &BenchSample::angle_rad};
  static const std::array<std::string, 5> kNames{"t_s", "u", "current_A", "supply_V", "angle_rad"};
  std::istringstream text(read_text(path));
  std::string line;
  std::getline(text, line);
  const std::vector<std::string> head = cells(line);
  std::array<std::size_t, 5> column{};
  for (std::size_t f = 0; f < kNames.size(); ++f) {
    column[f] = static_cast<std::size_t>(std::find(head.begin(), head.end(), kNames[f]) - head.begin());
    const bool optional = kNames[f] == "current_A" || kNames[f] == "supply_V";
    if (column[f] == head.size() && !optional) {
      throw InputError(path + ":1: no column " + kNames[f] + "; expected t_s,u,current_A,supply_V,angle_rad");
    }
  }
  BenchLog log;
  for (int number = 2; std::getline(text, line); ++number) {
    const std::vector<std::string> row = cells(line);
    if (row.empty()) continue;
    BenchSample sample;
    for (std::size_t f = 0; f < kNames.size(); ++f) {
      sample.*kFields[f] = std::numeric_limits<double>::quiet_NaN();
      if (column[f] == head.size()) continue;
      const std::string cell = column[f] < row.size() ? row[column[f]] : "";
      char* end = nullptr;
      sample.*kFields[f] = std::strtod(cell.c_str(), &end);
      if (cell.empty() || *end != '\0') {
        std::string where = path;
        where.append(":").append(std::to_string(number)).append(": ").append(kNames[f]);
        throw InputError(where.append(": \"").append(cell).append("\" is not a number"));
      }
    }
    append(path, sample, &log);
  }
  return log;
}

}  // namespace

BenchLog read_bench_log(const std::string& path) {
  const bool csv = path.size() > 4 && path.compare(path.size() - 4, 4, ".csv") == 0;
  return csv ? read_csv(path) : read_lcm(path);
}

}  // namespace equipoise::app
