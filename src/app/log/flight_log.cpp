#include "app/log/flight_log.hpp"

#include <algorithm>

#include "app/cli/commands.hpp"
#include "app/log/log_reader.hpp"

namespace equipoise::app {
namespace {

enum Seen : unsigned {
  kSensors = 1,
  kCommand = 2,
  kEstimate = 4,
  kReference = 8,
  kMotors = 16,
  kHealth = 32
};
constexpr unsigned kWhole = kSensors | kCommand | kEstimate | kReference | kMotors | kHealth;

template <class Message>
bool decode(std::string_view data, Message* message) {
  const auto size = static_cast<int>(data.size());
  return message->decode(data.data(), 0, size) == size;
}

template <std::size_t N, class To>
void copy(const double (&from)[N], To& to) {
  std::copy(std::begin(from), std::end(from), std::begin(to));
}

/// Decodes into the current tick; a message of another tick is not taken.
template <class Message>
void take(std::string_view data, Message* to, unsigned flag, LoggedTick* tick) {
  Message message;
  if (!decode(data, &message) || message.tick != tick->sensors.tick) return;
  *to = message;
  tick->seen |= flag;
}

void take(const LogEvent& event, LoggedTick* tick) {
  if (event.channel == "EQUIPOISE_COMMAND") take(event.data, &tick->command, kCommand, tick);
  if (event.channel == "EQUIPOISE_STATE") take(event.data, &tick->estimate, kEstimate, tick);
  if (event.channel == "EQUIPOISE_REFERENCE") take(event.data, &tick->reference, kReference, tick);
  if (event.channel == "EQUIPOISE_MOTORS") take(event.data, &tick->motors, kMotors, tick);
  if (event.channel == "EQUIPOISE_HEALTH") take(event.data, &tick->health, kHealth, tick);
  if (event.channel == "EQUIPOISE_TRUTH") {
    const unsigned before = tick->seen;
    take(event.data, &tick->truth, 1U << 31U, tick);
    tick->has_truth = tick->seen != before;
    tick->seen = before;
  }
}

}  // namespace

FlightLog parse_flight_log(std::string_view bytes, const std::string& origin) {
  FlightLog log;
  LogReader reader(bytes);
  LogEvent event;
  bool has_run = false;
  LoggedTick tick;
  const auto finish = [&] {
    if (tick.seen == kWhole) log.ticks.push_back(tick);
    if (tick.seen != 0 && tick.seen != kWhole) ++log.incomplete_ticks;
    tick = LoggedTick{};
  };
  while (reader.next(&event)) {
    if (event.channel == "EQUIPOISE_RUN" && !has_run) {
      has_run = decode(event.data, &log.run);
    } else if (event.channel == "EQUIPOISE_SENSORS") {
      finish();
      if (decode(event.data, &tick.sensors)) tick.seen = kSensors;
    } else if (tick.seen != 0) {
      take(event, &tick);
    }
  }
  finish();
  log.damaged_bytes = reader.damaged_bytes();
  if (!has_run) throw InputError(origin + ": is no log of a run (no EQUIPOISE_RUN of this version in it)");
  return log;
}

FlightLog read_flight_log(const std::string& path) { return parse_flight_log(read_log_parts(path), path); }

RawSample raw_of(const sensors_t& m) noexcept {
  RawSample raw{};
  raw.t_ns = m.t_ns;
  copy(m.gyro_counts, raw.gyro_counts);
  copy(m.accel_counts, raw.accel_counts);
  copy(m.encoder_counts, raw.encoder_counts);
  copy(m.attitude_wxyz, raw.attitude_wxyz);
  raw.battery_counts = m.battery_counts;
  raw.valid = static_cast<std::uint32_t>(m.valid);
  raw.health = static_cast<std::uint32_t>(m.health);
  return raw;
}

Command command_of(const command_t& m) noexcept {
  Command c;
  c.velocity_W_m_s = Vec2(m.velocity_W_m_s[0], m.velocity_W_m_s[1]);
  c.yaw_rate_rad_s = m.yaw_rate_rad_s;
  c.arm = m.arm != 0;
  c.heading_reset = m.heading_reset != 0;
  return c;
}

runtime::StateRecord state_of(const state_t& m) noexcept {
  runtime::StateRecord s{};
  copy(m.theta_rad, s.theta_rad);
  copy(m.omega_B_rad_s, s.omega_B_rad_s);
  copy(m.phi_rad, s.phi_rad);
  copy(m.phi_dot_rad_s, s.phi_dot_rad_s);
  copy(m.position_W_m, s.position_W_m);
  s.normalized_innovation = m.normalized_innovation;
  return s;
}

}  // namespace equipoise::app
