#include "bench_log.hpp"

#include <lcm/lcm.h>

#include <cerrno>
#include <cmath>
#include <cstring>
#include <equipoise/bench_t.hpp>
#include <memory>

#include "commands.hpp"

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

}  // namespace

void write_bench_log(const std::string& path, const BenchLog& log) {
  const LogFile file(lcm_eventlog_create(path.c_str(), "w"));
  if (file == nullptr) throw InputError(path + ": log cannot be created: " + std::strerror(errno));
  bench_t message{};
  message.bridge = static_cast<std::int32_t>(log.bridge);
  message.axis = log.axis;
  std::vector<std::uint8_t> bytes(static_cast<std::size_t>(message.getEncodedSize()));
  for (const BenchRow& row : log.rows) {
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

BenchLog read_bench_log(const std::string& path) {
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
      log.bridge = message.bridge == 1   ? LoggedBridge::kDriveBrake
                   : message.bridge == 2 ? LoggedBridge::kDriveCoast
                                         : LoggedBridge::kUnknown;
    }
    const double t_s = 1e-6 * static_cast<double>(message.utime);
    if (!log.rows.empty() && t_s <= log.rows.back().t_s) {
      throw InputError(path + ": " + kChannel + ": time does not advance at sample " +
                       std::to_string(log.rows.size()));
    }
    log.rows.push_back({t_s, message.u, message.current_A, message.supply_V, message.angle_rad});
  }
  if (events == 0) throw InputError(path + ": is not an LCM event log, or holds no whole event");
  if (log.rows.empty())
    throw InputError(path + ": no " + kChannel + " channel; record it with motor-bench --log");
  return log;
}

}  // namespace equipoise::app
