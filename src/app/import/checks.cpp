#include "app/import/checks.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <numeric>

#include "app/import/regression.hpp"
#include "app/import/signals.hpp"
#include "app/text/format.hpp"

namespace equipoise::app {
namespace {

constexpr double kRight = 1.4;         // so far off may be a radius, a track, an accelerometer's scale
constexpr double kRightOfForce = 5.0;  // what the specific force says of small motions, shaken as it is
constexpr double kNearUnit = 0.2;      // as close to a factor of units is a mistake of units

double median(Series values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

/// Which mistake of units makes a factor of `scale`; empty: none that is known.
std::string units_mistake(double scale, const std::vector<std::pair<double, const char*>>& known) {
  for (const auto& [factor, what] : known)
    if (std::abs(std::log(std::abs(scale) / factor)) < kNearUnit) return what;
  return "";
}

bool right(double scale, double factor = kRight) { return scale > 1.0 / factor && scale < factor; }

// ---- the table itself

Check check_rows(const Table& table) {
  const std::size_t torn = table.torn_rows;
  return {"rows", torn * 100 <= table.rows(), static_cast<double>(torn),
          format("%zu rows; %zu with another number of cells are left out", table.rows(), torn)};
}

Series steps(const Series& t_s) {
  Series dt;
  for (std::size_t k = 1; k < t_s.size(); ++k) dt.push_back(t_s[k] - t_s[k - 1]);
  return dt;
}

Check check_clock(const ImportedRows& rows) {
  const Series dt = steps(rows.t_s);
  const double usual = median(dt);
  const double late = *std::max_element(dt.begin(), dt.end());
  Check c{"clock", std::nullopt, 1.0 / usual,
          format("%.1f rows a second, longest step %.1f ms", 1.0 / usual, 1e3 * late)};
  c.ok = rows.not_advancing == 0 && usual > 1e-5 && usual < 0.1;
  if (rows.not_advancing > 0)
    c.text += format("; %zu rows whose time does not advance are left out", rows.not_advancing);
  if (usual >= 0.1) c.text += "; too slow for balancing: is time.unit ms or us?";
  if (usual <= 1e-5) c.text += "; too fast for a control loop: is time.unit s or ms?";
  return c;
}

Check check_gaps(const ImportedRows& rows) {
  const Series dt = steps(rows.t_s);
  const double usual = median(dt);
  const auto gaps =
      std::count_if(dt.begin(), dt.end(), [&](double d) { return d > 2.5 * usual && d > kTickS; });
  return {"gaps", gaps == 0, static_cast<double>(gaps), format("%td gaps of more than two rows", gaps)};
}

Check check_repeats(const ImportedRows& rows) {
  std::size_t same = 0;
  for (std::size_t k = 1; k < rows.t_s.size(); ++k)
    same += rows.gyro_rad_s[k] == rows.gyro_rad_s[k - 1] && rows.accel_m_s2[k] == rows.accel_m_s2[k - 1];
  const double share = static_cast<double>(same) / static_cast<double>(rows.t_s.size() - 1);
  return {"repeats", share < 0.01, share,
          format("%.1f %% of the IMU's samples repeat the one before", 100.0 * share)};
}

/// At the stated range; without one, an extreme that is taken more often than noise would.
Check check_clipping(const char* name, const std::vector<Vec3>& values, double range) {
  std::size_t clipped = 0;
  for (int axis = 0; axis < 3; ++axis) {
    double limit = 0.0;
    for (const Vec3& v : values) limit = std::max(limit, std::abs(v(axis)));
    std::size_t at = 0;
    for (const Vec3& v : values)
      at += std::abs(v(axis)) >= (range > 0.0 ? 0.999 * range : limit) && limit > 0.0;
    if (range > 0.0 || at >= 5) clipped += at;
  }
  const double share = static_cast<double>(clipped) / static_cast<double>(values.size());
  return {name, share < 1e-3, share,
          format("%.2f %% of the samples are at the end of the range", 100.0 * share)};
}

/// Angles that no motor without load could turn in a row's time.
Check check_jumps(const ImportedRows& rows, const ImportedRobot& robot) {
  const double fastest = 1.5 * robot.motor.no_load_rad_s(robot.motor.nominal_V);
  const double count = 2.0 * kPi / robot.calibration.encoder_counts_per_rev;
  std::size_t jumps = 0;
  double largest = 0.0;
  for (std::size_t k = 1; k < rows.t_s.size(); ++k) {
    for (std::size_t i = 0; i < static_cast<std::size_t>(robot.wheels); ++i) {
      const double step = std::abs(rows.wheel_rad[k][i] - rows.wheel_rad[k - 1][i]);
      if (!(step > fastest * (rows.t_s[k] - rows.t_s[k - 1]) + 2.0 * count)) continue;
      ++jumps;
      largest = std::max(largest, step);
    }
  }
  const bool units = jumps > rows.t_s.size() / 10;
  return {"wheel_jumps", jumps == 0, static_cast<double>(jumps),
          format("%zu steps beyond 1.5 times the no-load speed of %.0f rad/s%s", jumps, fastest / 1.5,
                 units ? ": is wheels.unit right?" : "")};
}

Check check_norm(const ImportedRows& rows) {
  Series norms;
  for (const Vec3& f : rows.accel_m_s2)
    if (f.allFinite()) norms.push_back(f.norm());
  const double share = norms.empty() ? kNotGiven : median(norms) / kGravity_m_s2;
  Check c{"accel_norm", right(share), share, format("median %.3f g", share)};
  const std::string mistake = units_mistake(share, {{1.0 / kGravity_m_s2, ": accel.unit is g, not m/s2"},
                                                    {kGravity_m_s2, ": accel.unit is m/s2, not g"},
                                                    {1e-3, ": accel.unit is mg, not g"},
                                                    {1e3, ": accel.unit is g, not mg"}});
  c.text += !mistake.empty() ? mistake : *c.ok ? "" : ": accel.scale or a channel is wrong";
  return c;
}

// ---- sensors against each other, every tick

/// The rows on a grid of ticks, between them by a line.
struct Grid {
  Series gyro[3], accel[3], roll[2], drive_roll[2], yaw, wheel_half_difference, drive_half_difference;
  std::vector<bool> used;

  Grid(const ImportedRows& rows, const ImportMap& map, const ImportedRobot& robot) {
    const auto size = static_cast<std::size_t>((rows.t_s.back() - rows.t_s.front()) / kTickS) + 1;
    std::size_t k = 0;
    for (std::size_t n = 0; n < size; ++n) {
      const double t = rows.t_s.front() + static_cast<double>(n) * kTickS;
      while (k + 2 < rows.t_s.size() && rows.t_s[k + 1] < t) ++k;
      const double s = std::clamp((t - rows.t_s[k]) / (rows.t_s[k + 1] - rows.t_s[k]), 0.0, 1.0);
      const auto between = [s](double a, double b) { return std::isfinite(a + b) ? a + s * (b - a) : 0.0; };
      const Mat3& R_BS = robot.calibration.R_BS;
      for (int i = 0; i < 3; ++i) {
        const auto body = [&](const std::vector<Vec3>& v, std::size_t at) { return R_BS.row(i).dot(v[at]); };
        gyro[i].push_back(between(body(rows.gyro_rad_s, k), body(rows.gyro_rad_s, k + 1)));
        accel[i].push_back(between(body(rows.accel_m_s2, k), body(rows.accel_m_s2, k + 1)));
      }
      WheelValues w{};
      WheelValues u{};
      for (std::size_t i = 0; i < w.size(); ++i) {
        w[i] = between(rows.wheel_rad[k][i], rows.wheel_rad[k + 1][i]);
        u[i] = between(rows.drive[k][i], rows.drive[k + 1][i]);
      }
      const std::array<double, 3> axes = robot.input(u);
      for (std::size_t i = 0; i < 2; ++i) {
        roll[i].push_back(robot.rolling(w)(static_cast<int>(i)));
        drive_roll[i].push_back(i == 0 || !robot.yaw ? axes[i] : 0.0);
      }
      if (robot.yaw) {
        yaw.push_back(robot.yaw(w));
        wheel_half_difference.push_back(0.5 * (w[0] - w[1]));
        drive_half_difference.push_back(0.5 * (u[0] - u[1]));
      }
      used.push_back(map.balancing.empty() ||
                     std::any_of(map.balancing.begin(), map.balancing.end(),
                                 [t](const Stretch& b) { return t > b.from_s + 0.2 && t < b.to_s; }));
    }
  }

  /// In the balancing band, of the ticks that count.
  Series part(const Series& x) const {
    const Series band = Band()(x);
    Series out;
    for (std::size_t k = 0; k < band.size(); ++k)
      if (used[k]) out.push_back(band[k]);
    return out;
  }
  std::vector<Coefficient> fit(const std::vector<Series>& x, const Series& y) const {
    std::vector<Series> parts;
    parts.reserve(x.size());
    for (const Series& each : x) parts.push_back(part(each));
    const Series target = part(y);
    const double seconds = kTickS * static_cast<double>(target.size());
    return regression(parts, target, 2.0 * (kHigh_Hz - kLow_Hz) * seconds);
  }
};

/// What the specific force says of the gyro (its first coefficient) and of the wheels: seen from the body,
/// gravity turns against the gyro, and the axis of rolling accelerates as the wheels do.
std::vector<Coefficient> against_accel(const Grid& g, const ImportedRobot& robot, int axis) {
  const int across = 1 - axis;  // of the accelerometer
  const double sign = axis == 0 ? 1.0 : -1.0;
  const double r = robot.rolling_radius_m;
  const Series rate = g.gyro[axis];
  const Series felt = combine(g.accel[across], sign, integral(product(g.gyro[2], g.accel[axis])));
  const Series gyro = combine(scaled(sign * kGravity_m_s2, integral(rate)), -sign * (r + robot.imu_height_m),
                              derivative(rate));
  const Series wheels = scaled(-sign * r, derivative(derivative(g.roll[axis])));
  return g.fit({gyro, wheels}, felt);
}

std::string shown(const Coefficient& c) {
  return std::isfinite(c.sigma) ? format("%+.2f +- %.2f", c.value, c.sigma) : "never moved";
}

struct Comparison {
  const char* name;
  const char* what;
  double factor;        // that may still be right
  const char* flipped;  // what a negative one means
  std::vector<std::pair<double, const char*>> units;
};

Check scale_check(const Coefficient& c, const Comparison& of) {
  Check check{of.name, std::nullopt, c.value, std::string(of.what) + " " + shown(c)};
  if (!c.known()) {
    check.text += "; this log does not tell";
    return check;
  }
  check.ok = right(c.value, of.factor);
  const std::string mistake = units_mistake(c.value, of.units);
  if (c.value < 0.0) check.text += std::string(": ") + of.flipped;
  if (!mistake.empty()) check.text += ": " + mistake;
  if (c.value > 0.0 && mistake.empty() && !*check.ok) check.text += ": a unit, a radius or a scale is wrong";
  return check;
}

constexpr double kPerDegree = kPi / 180.0;
const std::vector<std::pair<double, const char*>> kGyroUnits{
    {1.0 / kPerDegree, "gyro.unit is deg/s, not rad/s"}, {kPerDegree, "gyro.unit is rad/s, not deg/s"}};
/// What the gyro is measured with has the other factor.
const std::vector<std::pair<double, const char*>> kUnitsOfGyroUnderTest{
    {kPerDegree, "gyro.unit is deg/s, not rad/s"}, {1.0 / kPerDegree, "gyro.unit is rad/s, not deg/s"}};

void check_tilt(const Grid& g, const ImportedRobot& robot, std::vector<Check>* checks) {
  for (int axis = 0; axis < (robot.yaw ? 1 : 2); ++axis) {
    const std::vector<Coefficient> c = against_accel(g, robot, axis);
    const bool both = c[0].known() && c[1].known() && c[0].value < 0.0 && c[1].value < 0.0;
    const char* accel = axis == 0 ? "accel y is flipped" : "accel x is flipped";
    checks->push_back(scale_check(
        c[0], {axis == 0 ? "gyro_x_accel" : "gyro_y_accel", "accelerometer against gyro", kRightOfForce,
               both        ? accel
               : axis == 0 ? "gyro x is flipped"
                           : "gyro y is flipped",
               kUnitsOfGyroUnderTest}));
    checks->push_back(scale_check(c[1], {axis == 0 ? "wheels_accel" : "wheels_y_accel",
                                         "accelerometer against wheels",
                                         kRightOfForce,
                                         both ? accel : "the wheels' sign is flipped",
                                         {}}));
  }
}

/// Rate against voltage, in units of the no-load speed.
Coefficient rate_per_drive(const Grid& g, const ImportedRobot& robot, const Series& angle,
                           const Series& drive) {
  Coefficient c = g.fit({drive}, derivative(angle)).front();
  constexpr double kLeast = 1e-3;  // of the nominal voltage; less does not move a wheel
  if (std::sqrt(mean_square(g.part(drive))) < kLeast) return {0.0, INFINITY};
  const double no_load = robot.motor.no_load_rad_s(robot.motor.nominal_V);
  return {c.value / no_load, c.sigma / no_load};
}

void check_drive(const Grid& g, const ImportedRobot& robot, std::vector<Check>* checks) {
  for (int axis = 0; axis < (robot.yaw ? 1 : 2); ++axis) {
    const Coefficient c = rate_per_drive(g, robot, g.roll[axis], g.drive_roll[axis]);
    Check check{axis == 0 ? "drive_wheels" : "drive_wheels_y", std::nullopt, c.value,
                "wheel rate per drive, of the no-load speed: " + shown(c)};
    if (c.known()) check.ok = c.value > 0.02 && c.value < 3.0;
    if (!check.ok)
      check.text += "; this log does not tell";
    else if (c.value < 0.0)
      check.text += ": the sign of drive or wheels is flipped";
    else if (!*check.ok)
      check.text += ": drive.unit, drive.kind or wheels.unit is wrong";
    checks->push_back(check);
  }
}

/// The two wheels' difference against the gyro's z, and against the difference of their drives.
void check_yaw(const Grid& g, const ImportedRobot& robot, std::vector<Check>* checks) {
  if (!robot.yaw) return;
  const Coefficient gyro = g.fit({derivative(g.yaw)}, g.gyro[2]).front();
  const Coefficient drive = rate_per_drive(g, robot, g.wheel_half_difference, g.drive_half_difference);
  const bool opposed = drive.known() && drive.value < 0.0;
  const bool agree = drive.known() && drive.value > 0.0;
  const char* flipped = opposed ? "the wheels are swapped"
                        : agree ? "gyro z is flipped, or wheels and drive are swapped"
                                : "the wheels are swapped or gyro z is flipped";
  checks->push_back(scale_check(gyro, {"gyro_z_wheels", "gyro against wheels", kRight, flipped, kGyroUnits}));
  Check check{"drive_wheels_turn", std::nullopt, drive.value,
              "difference of wheel rates per drive, of the no-load speed: " + shown(drive)};
  if (drive.known()) check.ok = drive.value > 0.0;
  if (!check.ok)
    check.text += "; this log does not tell";
  else if (!*check.ok)
    check.text += gyro.value > 0.0 ? ": the drive's columns are swapped" : ": the wheels are swapped";
  checks->push_back(check);
}

/// A balancing robot's z points up.
Check check_up(const Grid& g, const ImportMap& map) {
  Series up;
  for (std::size_t k = 0; k < g.used.size(); ++k)
    if (g.used[k]) up.push_back(g.accel[2][k]);
  Check c{"accel_up", std::nullopt, kNotGiven, "no balancing stretch"};
  if (up.empty()) return c;
  c.value = median(up) / kGravity_m_s2;
  c.text = format("median %.2f g on body z while balancing", c.value);
  if (map.balancing.empty() && std::abs(c.value) < 0.5) return c;
  c.ok = c.value > 0.5;
  if (!*c.ok) c.text += c.value < -0.5 ? ": accel z is flipped" : ": the axes are not the body's";
  return c;
}

}  // namespace

std::vector<Check> check_import(const Table& table, const ImportedRows& rows, const ImportMap& map,
                                const ImportedRobot& robot) {
  std::vector<Check> checks{check_rows(table),
                            check_clock(rows),
                            check_gaps(rows),
                            check_repeats(rows),
                            check_clipping("gyro_clipping", rows.gyro_rad_s, map.gyro.range),
                            check_clipping("accel_clipping", rows.accel_m_s2, map.accel.range),
                            check_jumps(rows, robot),
                            check_norm(rows)};
  if (rows.t_s.back() - rows.t_s.front() < 1.0) return checks;  // too short to move
  const Grid grid(rows, map, robot);
  checks.push_back(check_up(grid, map));
  if (std::count(grid.used.begin(), grid.used.end(), true) < 100) return checks;
  check_tilt(grid, robot, &checks);
  check_drive(grid, robot, &checks);
  check_yaw(grid, robot, &checks);
  return checks;
}

}  // namespace equipoise::app
