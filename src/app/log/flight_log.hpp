// A run's log as ticks. In: path -> out: what the run was, and per tick what went in and came out; InputError
// when the file is no log of ours. A tick counts when its sensors, command, state, motors and health are
// there.
#pragma once

#include <string>
#include <vector>

#include "equipoise/command_t.hpp"
#include "equipoise/health_t.hpp"
#include "equipoise/motors_t.hpp"
#include "equipoise/run_t.hpp"
#include "equipoise/runtime/record.hpp"
#include "equipoise/sensors_t.hpp"
#include "equipoise/state_t.hpp"

namespace equipoise::app {

struct LoggedTick {
  sensors_t sensors{};
  command_t command{};
  state_t estimate{};
  state_t reference{};
  state_t truth{};
  motors_t motors{};
  health_t health{};
  bool has_truth = false;
  unsigned seen = 0;  // internal: which messages have arrived
};

struct FlightLog {
  run_t run{};
  std::vector<LoggedTick> ticks;
  std::size_t damaged_bytes = 0;
  std::int64_t incomplete_ticks = 0;
};

FlightLog read_flight_log(const std::string& path);
/// From the bytes of a log; `origin` names it in errors.
FlightLog parse_flight_log(std::string_view bytes, const std::string& origin);

RawSample raw_of(const sensors_t& m) noexcept;
Command command_of(const command_t& m) noexcept;
runtime::StateRecord state_of(const state_t& m) noexcept;

}  // namespace equipoise::app
