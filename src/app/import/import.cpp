#include "app/import/import.hpp"

#include <algorithm>
#include <cmath>

#include "app/text/errors.hpp"
#include "app/text/format.hpp"
#include "app/trial/firmware_of.hpp"
#include "robots/robot_list.hpp"

namespace equipoise::app {
namespace {

/// The column that a map names, out of a table.
std::vector<double> column_of(const Table& table, const SignedColumn& column) {
  std::vector<double> values = table.column(column.name);
  for (double& v : values) v *= column.factor;
  return values;
}

/// A first-order filter taken back.
void take_back(double low_pass_hz, const std::vector<double>& t_s, std::vector<double>* values) {
  double before = values->front();
  for (std::size_t k = 1; k < values->size(); ++k) {
    const double keep = std::exp(-2.0 * kPi * low_pass_hz * (t_s[k] - t_s[k - 1]));
    const double now = (*values)[k];
    (*values)[k] = (now - keep * before) / (1.0 - keep);
    before = now;
  }
}

std::vector<double> channel_column(const Table& table, const Channel& channel, std::size_t axis,
                                   const std::vector<double>& t_s, const std::vector<std::size_t>& used) {
  const std::vector<double> all = column_of(table, channel.axes[axis]);
  std::vector<double> values;
  values.reserve(used.size());
  for (const std::size_t row : used) values.push_back(all[row]);
  if (channel.low_pass_hz > 0.0) take_back(channel.low_pass_hz, t_s, &values);
  if (channel.quantum > 0.0)
    for (double& v : values) v = channel.quantum * std::round(v / channel.quantum);
  return values;
}

/// A wheel's rate is measured over the time before its row.
void integrate(const std::vector<double>& t_s, std::vector<double>* rate) {
  double angle = 0.0;
  (*rate)[0] = 0.0;
  for (std::size_t k = 1; k < rate->size(); ++k) {
    if (std::isfinite((*rate)[k])) angle += (*rate)[k] * (t_s[k] - t_s[k - 1]);
    (*rate)[k] = angle;
  }
}

/// Share of the nominal voltage. Of a torque: with what turns against it, T = k1 u - k2 rate.
double drive_share(const std::string& kind, double value, double battery_V, double rate_rad_s,
                   const MotorParameters& motor) {
  if (kind == "duty") return value * battery_V / motor.nominal_V;
  if (kind == "torque") return (value + motor.k2() * rate_rad_s) / motor.k1();
  return value / motor.nominal_V;
}

std::vector<double> row_times(const Table& table, const ImportMap& map, std::size_t rows) {
  if (!map.time.name.empty()) {
    std::vector<double> t = column_of(table, map.time);
    if (map.time_is_step)
      for (std::size_t k = 1; k < t.size(); ++k) t[k] += t[k - 1];
    const double first = map.time_is_step ? t.front() : 0.0;
    for (double& each : t) each -= first;
    return t;
  }
  std::vector<double> t(rows);
  for (std::size_t k = 0; k < rows; ++k) t[k] = static_cast<double>(k) / map.rate_hz;
  return t;
}

/// Rows in the time that the map asks for, each after the one before.
std::vector<std::size_t> advancing_rows(const Table& table, const ImportMap& map, std::size_t count,
                                        ImportedRows* rows) {
  if (count == 0)
    throw InputError("the table has no row of numbers; [table] of the map says how the file is made");
  std::vector<std::size_t> used;
  const std::vector<double> times = row_times(table, map, count);
  for (std::size_t k = 0; k < times.size(); ++k) {
    if (!(times[k] >= map.from_s && times[k] <= map.to_s)) continue;
    if (!rows->t_s.empty() && !(times[k] > rows->t_s.back())) {
      ++rows->not_advancing;
      continue;
    }
    rows->t_s.push_back(times[k]);
    used.push_back(k);
  }
  if (used.size() < 2)
    throw InputError("fewer than two rows of the table are in the time that the map asks for");
  return used;
}

/// Mean over an interval of what each row holds until the next one.
class Held {
 public:
  Held(const std::vector<double>& t_s, const std::vector<WheelValues>& values, std::size_t wheel)
      : t_s_(t_s), values_(values), wheel_(wheel), sum_(t_s.size(), 0.0) {
    for (std::size_t k = 1; k < t_s.size(); ++k) sum_[k] = sum_[k - 1] + at(k - 1) * (t_s[k] - t_s[k - 1]);
  }
  double mean(double from_s, double to_s) const {
    return (integral(to_s) - integral(from_s)) / (to_s - from_s);
  }

 private:
  double at(std::size_t k) const { return std::isfinite(values_[k][wheel_]) ? values_[k][wheel_] : 0.0; }
  double integral(double t_s) const {
    const auto next = std::upper_bound(t_s_.begin(), t_s_.end(), t_s);
    const auto k = static_cast<std::size_t>(std::max<std::ptrdiff_t>(0, next - t_s_.begin() - 1));
    return sum_[k] + at(k) * (t_s - t_s_[k]);
  }

  const std::vector<double>& t_s_;
  const std::vector<WheelValues>& values_;
  std::size_t wheel_;
  std::vector<double> sum_;
};

std::int64_t nanoseconds(double seconds) { return std::llround(1e9 * seconds); }

bool balances(const ImportMap& map, double t_s) {
  return map.balancing.empty() ||
         std::any_of(map.balancing.begin(), map.balancing.end(),
                     [t_s](const Stretch& s) { return t_s >= s.from_s && t_s <= s.to_s; });
}

void sample(const ImportedRows& rows, std::size_t k, const ImportMap& map, const ImportedRobot& robot,
            RawSample* raw) {
  const Calibration& c = robot.calibration;
  const Vec3& gyro = rows.gyro_rad_s[k];
  const Vec3& accel = rows.accel_m_s2[k];
  raw->t_ns = nanoseconds(rows.t_s[k] - map.gyro.delay_s);
  for (int i = 0; i < 3; ++i) {
    raw->gyro_counts[i] = std::round(gyro(i) / c.gyro_rad_s_per_count);
    raw->accel_counts[i] = std::round(accel(i) / c.accel_m_s2_per_count);
  }
  bool wheels = true;
  for (std::size_t i = 0; i < static_cast<std::size_t>(robot.wheels); ++i) {
    raw->encoder_counts[i] =
        std::round(c.encoder_sign[i] * rows.wheel_rad[k][i] / (2.0 * kPi) * c.encoder_counts_per_rev);
    wheels = wheels && std::isfinite(rows.wheel_rad[k][i]);
  }
  raw->battery_counts = (rows.battery_V[k] - c.battery_offset_V) / c.battery_V_per_count;
  raw->attitude_wxyz[0] = 1.0;
  const bool imu = gyro.allFinite() && accel.allFinite();
  if (imu) raw->valid |= RIO_IMU;
  if (wheels) raw->valid |= RIO_ENCODERS;
  if (std::isfinite(rows.battery_V[k])) raw->valid |= RIO_BATTERY;
}

}  // namespace

ImportedRobot imported_robot(const std::string& path) {
  return with_robot(robot_type(path), path, [&](auto firmware) {
    using Known = decltype(firmware);
    using Robot = typename Known::Robot;
    const ConfiguredRobotOf<Known> configured(Known::load(path, {}));
    const auto& config = configured.config;
    Choice choice;
    complete(*configured.type, &choice);
    const typename Robot::Kinematics kinematics(config.robot);
    const auto wheels = [](const WheelValues& w) {
      return Vec<Robot::kWheels>(Eigen::Map<const Vec<Robot::kWheels>>(w.data()));
    };
    ImportedRobot robot;
    robot.wheels = Robot::kWheels;
    robot.calibration = config.calibration;
    robot.motor = config.motor;
    robot.run = run_info(configured, choice, 0);
    robot.run.backend = "import";
    robot.rolling_radius_m = robot.run.rolling_radius_m;
    robot.input = [=](const WheelValues& w) {
      const auto u = kinematics.axes_from_wheels(wheels(w));
      std::array<double, 3> axes{};
      std::copy(u.data(), u.data() + u.size(), axes.begin());
      return axes;
    };
    robot.imu_height_m = config.robot.l_a.z();
    if constexpr (Robot::kWheels == 2) {
      robot.rolling = [=](const WheelValues& w) { return Vec2(kinematics.phi(wheels(w)), 0.0); };
      robot.yaw = [=](const WheelValues& w) { return kinematics.psi(wheels(w)); };
    } else {
      robot.rolling = [=](const WheelValues& w) {
        return Vec2(kinematics.ball_from_wheels(wheels(w)).template head<2>());
      };
    }
    return robot;
  });
}

ImportedRows imported_rows(const Table& table, const ImportMap& map, const ImportedRobot& robot) {
  const auto wheels = static_cast<std::size_t>(robot.wheels);
  const std::size_t balances_about = wheels == 2 ? 1 : 2;
  if (map.tilt.axes.size() > balances_about)
    throw InputError(format("tilt.axes of the map names %zu columns; a robot of type %s balances about %zu",
                            map.tilt.axes.size(), robot.run.robot.c_str(), balances_about));
  for (const auto& [key, channel] : {std::pair{"wheels", &map.wheels}, std::pair{"drive", &map.drive}}) {
    if (channel->axes.size() == wheels) continue;
    throw InputError(std::string(key) + ".axes of the map names " + std::to_string(channel->axes.size()) +
                     " columns; a robot of type " + robot.run.robot + " has " + std::to_string(wheels) +
                     " wheels");
  }
  ImportedRows rows;
  const std::vector<std::size_t> used = advancing_rows(table, map, table.rows(), &rows);
  constexpr double kLongest_s = 7200.0;  // one wrong stamp would ask for ticks until the memory is full
  const double lasts_s = rows.t_s.back() - rows.t_s.front();
  if (!(lasts_s <= kLongest_s))
    throw InputError(
        format("the table's time runs for %.3g s, from %.6g to %.6g: two hours are the most; cut it with "
               "time.from_s and to_s of the map",
               lasts_s, rows.t_s.front(), rows.t_s.back()));
  const std::size_t n = used.size();
  rows.gyro_rad_s.resize(n);
  rows.accel_m_s2.resize(n);
  rows.wheel_rad.assign(n, {});
  rows.drive.assign(n, {});
  rows.battery_V.assign(n, map.battery_V);
  rows.tilt_rad.assign(n, Vec2::Constant(kNotGiven));
  if (!map.battery.name.empty()) {
    const std::vector<double> all = column_of(table, map.battery);
    for (std::size_t k = 0; k < n; ++k) rows.battery_V[k] = all[used[k]];
  }
  const auto pick = [&](const Channel& channel, auto* to) {
    for (std::size_t i = 0; i < channel.axes.size(); ++i) {
      const std::vector<double> axis = channel_column(table, channel, i, rows.t_s, used);
      for (std::size_t k = 0; k < n; ++k) (*to)[k](static_cast<int>(i)) = axis[k];
    }
  };
  pick(map.gyro, &rows.gyro_rad_s);
  pick(map.accel, &rows.accel_m_s2);
  pick(map.tilt, &rows.tilt_rad);
  for (std::size_t i = 0; i < wheels; ++i) {
    std::vector<double> wheel = channel_column(table, map.wheels, i, rows.t_s, used);
    if (map.wheels.kind == "rate") integrate(rows.t_s, &wheel);
    const std::vector<double> drive = channel_column(table, map.drive, i, rows.t_s, used);
    for (std::size_t k = 0; k < n; ++k) {
      const std::size_t before = k == 0 ? 0 : k - 1;
      const double dt = rows.t_s[std::max<std::size_t>(k, 1)] - rows.t_s[before];
      rows.wheel_rad[k][i] = wheel[k];
      rows.drive[k][i] = drive_share(map.drive.kind, drive[k], rows.battery_V[k],
                                     (wheel[std::max<std::size_t>(k, 1)] - wheel[before]) / dt, robot.motor);
    }
  }
  return rows;
}

std::vector<BenchSample> imported_bench(const Table& table, const ImportMap& map, std::size_t motor) {
  for (const auto& [key, channel] :
       {std::pair{"wheels", &map.wheels}, std::pair{"drive", &map.drive}, std::pair{"current", &map.current}})
    if (channel->axes.size() <= motor)
      throw InputError(format("%s.axes of the map names %zu columns: there is no motor %zu", key,
                              channel->axes.size(), motor + 1));
  if (map.drive.kind == "torque") throw InputError("drive.kind of a motor bench is volts or duty");
  ImportedRows rows;
  const std::vector<std::size_t> used = advancing_rows(table, map, table.rows(), &rows);
  std::vector<double> angle = channel_column(table, map.wheels, motor, rows.t_s, used);
  if (map.wheels.kind == "rate") integrate(rows.t_s, &angle);
  const std::vector<double> drive = channel_column(table, map.drive, motor, rows.t_s, used);
  const std::vector<double> current = channel_column(table, map.current, motor, rows.t_s, used);
  const std::vector<double> battery =
      map.battery.name.empty() ? std::vector<double>{} : column_of(table, map.battery);
  std::vector<BenchSample> samples(used.size());
  for (std::size_t k = 0; k < samples.size(); ++k) {
    const double supply_V = battery.empty() ? map.battery_V : battery[used[k]];
    samples[k] = {rows.t_s[k], map.drive.kind == "duty" ? drive[k] : drive[k] / supply_V, current[k],
                  supply_V, angle[k]};
  }
  return samples;
}

std::vector<runtime::TickRecord> imported_ticks(const ImportedRows& rows, const ImportMap& map,
                                                const ImportedRobot& robot) {
  std::vector<Held> drive;
  drive.reserve(static_cast<std::size_t>(robot.wheels));
  for (int i = 0; i < robot.wheels; ++i)
    drive.emplace_back(rows.t_s, rows.drive, static_cast<std::size_t>(i));
  std::vector<runtime::TickRecord> ticks;
  std::size_t newest = 0;
  bool first = true;
  for (std::int64_t tick = 0;; ++tick) {
    const double now_s = rows.t_s.front() + static_cast<double>(tick) * kTickS;
    if (now_s > rows.t_s.back()) break;
    const std::size_t last = newest;
    while (newest + 1 < rows.t_s.size() && rows.t_s[newest + 1] <= now_s + 1e-9) ++newest;
    runtime::TickRecord r{};
    r.tick = tick;
    r.now_ns = nanoseconds(now_s);
    sample(rows, newest, map, robot, &r.raw);
    if (!first && newest == last) r.raw.valid = 0;  // nothing new
    first = false;
    r.arm = balances(map, now_s);
    r.arm_state = static_cast<std::int32_t>(r.arm ? ArmState::kArmed : ArmState::kDisarmed);
    r.motors.enable = r.arm;
    r.estimate.theta_rad[0] = rows.tilt_rad[newest].x();
    r.battery_V = rows.battery_V[newest];
    r.motor_count = robot.wheels;
    WheelValues u{};
    for (std::size_t i = 0; i < drive.size(); ++i) {
      u[i] = drive[i].mean(now_s - map.drive.delay_s, now_s + kTickS - map.drive.delay_s);
      r.motors.duty[i] = robot.calibration.motor_sign[i] * u[i] * robot.motor.nominal_V / r.battery_V;
    }
    r.u_friction = robot.input(u);
    r.u_lin = r.u_friction;
    ticks.push_back(r);
  }
  return ticks;
}

}  // namespace equipoise::app
