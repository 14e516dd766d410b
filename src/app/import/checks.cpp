#include "app/import/checks.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "app/import/signals.hpp"
#include "app/import/table_checks.hpp"
#include "app/import/wheel_order.hpp"
#include "app/text/format.hpp"

namespace equipoise::app {
namespace {

constexpr double kSure = 3.0;  // standard errors

/// Of a least squares fit, with its standard error.
struct Coefficient {
  double value = 0.0;
  double sigma = 0.0;
  /// What the fit of x on y says. Noise in x pulls `value` towards zero, noise in y this one away from it:
  /// the truth is between them (Frisch 1934).
  double reverse = 0.0;
  bool known() const { return std::abs(value) > kSure * sigma; }
};

constexpr const char* kUntold = "; this log does not tell";
constexpr double kRightOfForce = 5.0;  // what the specific force says of small motions, shaken as it is

/// The rows on a grid of ticks, between them by a line.
struct Grid {
  Eigen::Index size;
  Eigen::ArrayXXd gyro{size, 3}, accel{size, 3}, roll{size, 2}, drive_roll{size, 2}, wheel{size, kMaxMotors};
  Series yaw{size}, wheel_half_difference{size}, drive_half_difference{size};
  std::vector<Eigen::Index> used;  // ticks that count

  Grid(const ImportedRows& rows, const ImportMap& map, const ImportedRobot& robot)
      : size(static_cast<Eigen::Index>((rows.t_s.back() - rows.t_s.front()) / kTickS) + 1) {
    std::size_t k = 0;
    for (Eigen::Index n = 0; n < size; ++n) {
      const double t = rows.t_s.front() + static_cast<double>(n) * kTickS;
      while (k + 2 < rows.t_s.size() && rows.t_s[k + 1] < t) ++k;
      const double s = std::clamp((t - rows.t_s[k]) / (rows.t_s[k + 1] - rows.t_s[k]), 0.0, 1.0);
      const auto between = [s](double a, double b) { return std::isfinite(a + b) ? a + s * (b - a) : 0.0; };
      const Mat3& R_BS = robot.calibration.R_BS;
      for (int i = 0; i < 3; ++i) {
        const auto body = [&](const std::vector<Vec3>& v, std::size_t at) { return R_BS.row(i).dot(v[at]); };
        gyro(n, i) = between(body(rows.gyro_rad_s, k), body(rows.gyro_rad_s, k + 1));
        accel(n, i) = between(body(rows.accel_m_s2, k), body(rows.accel_m_s2, k + 1));
      }
      WheelValues w{};
      WheelValues u{};
      for (std::size_t i = 0; i < w.size(); ++i) {
        w[i] = between(rows.wheel_rad[k][i], rows.wheel_rad[k + 1][i]);
        u[i] = between(rows.drive[k][i], rows.drive[k + 1][i]);
        wheel(n, Eigen::Index(i)) = w[i];
      }
      const std::array<double, 3> axes = robot.input(u);
      roll.row(n) = robot.rolling(w).array();
      drive_roll.row(n) << axes[0], robot.yaw ? 0.0 : axes[1];
      yaw(n) = robot.yaw ? robot.yaw(w) : 0.0;
      wheel_half_difference(n) = 0.5 * (w[0] - w[1]);
      drive_half_difference(n) = 0.5 * (u[0] - u[1]);
      if (map.balancing.empty() ||
          std::any_of(map.balancing.begin(), map.balancing.end(),
                      [t](const Stretch& b) { return t > b.from_s + 0.2 && t < b.to_s; }))
        used.push_back(n);
    }
  }

  /// y = sum c_i x_i of what `band` leaves of the ticks that count; degrees of freedom by bandwidth, two a
  /// second and Hz.
  std::vector<Coefficient> fit(const std::vector<Series>& x, const Series& y,
                               Series (*band)(const Series&) = balancing) const {
    const auto part = [&](const Series& all) -> Series { return band(all)(used); };
    const Eigen::VectorXd Y = part(y);
    Eigen::MatrixXd X(Y.size(), Eigen::Index(x.size()));
    for (std::size_t i = 0; i < x.size(); ++i) X.col(Eigen::Index(i)) = part(x[i]);
    const Eigen::FullPivLU<Eigen::MatrixXd> lu(X.transpose() * X);
    if (!lu.isInvertible()) return std::vector<Coefficient>(x.size(), {0.0, INFINITY, 0.0});
    const Eigen::MatrixXd inverse = lu.inverse();
    const Eigen::VectorXd c = inverse * (X.transpose() * Y);
    const double independent = 2.0 * (kHigh_Hz - kLow_Hz) * (kTickS * static_cast<double>(Y.size()));
    const double freedom = std::max(independent - static_cast<double>(x.size()), 1.0);
    const double unexplained = (Y - X * c).squaredNorm();
    const double explained = std::max(1.0 - unexplained / Y.squaredNorm(), 1e-12);
    std::vector<Coefficient> out;
    out.reserve(x.size());
    for (Eigen::Index i = 0; i < c.size(); ++i)
      out.push_back({c(i), std::sqrt(unexplained / freedom * inverse(i, i)), c(i) / explained});
    return out;
  }
};

/// Seen from the body, gravity turns against the gyro, and the axis of rolling accelerates as the wheels do:
/// `felt` = sign (gyro_part - r x rolling acceleration against the body).
struct Force {
  double sign, r;
  Series felt, gyro_part;
  Force(const Grid& g, const ImportedRobot& robot, int axis)
      : sign(axis == 0 ? 1.0 : -1.0),
        r(robot.rolling_radius_m),
        felt(g.accel.col(1 - axis) + sign * integral(g.gyro.col(2) * g.accel.col(axis))),
        gyro_part(kGravity_m_s2 * integral(g.gyro.col(axis)) -
                  (r + robot.imu_height_m) * derivative(g.gyro.col(axis))) {}
  Series rolling_acceleration() const { return 1.0 / r * (gyro_part - sign * felt); }
};

/// What the specific force says of the gyro (its first coefficient) and of the wheels.
std::vector<Coefficient> against_accel(const Grid& g, const ImportedRobot& robot, int axis) {
  const Force f(g, robot, axis);
  const Series wheels = -f.sign * f.r * derivative(derivative(g.roll.col(axis)));
  return g.fit({f.sign * f.gyro_part, wheels}, f.felt);
}

std::string shown(const Coefficient& c) {
  return std::isfinite(c.sigma) ? format("%+.2f +- %.2f", c.value, c.sigma) : "never moved";
}

struct Comparison {
  const char* name;
  const char* what;
  double factor;        // that may still be right
  std::string flipped;  // what a negative one means
  std::vector<std::pair<double, const char*>> units;
};

Check scale_check(const Coefficient& c, const Comparison& of) {
  Check check{of.name, std::nullopt, c.value, std::string(of.what) + " " + shown(c)};
  if (!c.known()) {
    check.text += kUntold;
    return check;
  }
  const double least = std::abs(c.value) - kSure * c.sigma;
  const double most = std::abs(c.reverse) + kSure * c.sigma;
  const bool right = least < of.factor && most > 1.0 / of.factor;
  check.ok = c.value > 0.0 && right;
  if (c.value < 0.0) check.text += ": " + of.flipped;
  if (right) return check;
  const std::string mistake = units_mistake(least, most, of.units);
  if (!mistake.empty())
    check.text += ": " + mistake;
  else if (c.value > 0.0)
    check.text += ": a unit, a radius or a scale is wrong";
  return check;
}

constexpr double kPerDegree = kPi / 180.0;
const std::vector<std::pair<double, const char*>> kGyroUnits{
    {1.0 / kPerDegree, "gyro.unit is deg/s, not rad/s"},
    {kPerDegree, "gyro.unit is rad/s, not deg/s"},
    {2.0 * kPi, "wheels.unit is rev, not rad"},
    {0.5 / kPi, "wheels.unit is rad, not rev"}};
/// What the gyro is measured with has the other factor.
const std::vector<std::pair<double, const char*>> kUnitsOfGyroUnderTest{
    {kPerDegree, "gyro.unit is deg/s, not rad/s"}, {1.0 / kPerDegree, "gyro.unit is rad/s, not deg/s"}};

void check_tilt(const Grid& g, const ImportedRobot& robot, std::vector<Check>* checks) {
  for (int axis = 0; axis < (robot.yaw ? 1 : 2); ++axis) {
    const std::vector<Coefficient> c = against_accel(g, robot, axis);
    const bool both = c[0].known() && c[1].known() && c[0].value < 0.0 && c[1].value < 0.0;
    const char* gyro = axis == 0 ? "gyro x" : "gyro y";
    const char* accel = axis == 0 ? "accel y" : "accel x";
    // Which of two is flipped says the third, where this log tells it.
    const auto flipped = [&](const char* one, const Coefficient& third) {
      if (both) return format("%s is flipped", accel);
      return third.known() ? format("%s is flipped", one) : format("%s or %s is flipped", one, accel);
    };
    checks->push_back(
        scale_check(c[0], {axis == 0 ? "gyro_x_accel" : "gyro_y_accel", "accelerometer against gyro",
                           kRightOfForce, flipped(gyro, c[1]), kUnitsOfGyroUnderTest}));
    checks->push_back(scale_check(c[1], {axis == 0 ? "wheels_accel" : "wheels_y_accel",
                                         "accelerometer against wheels",
                                         kRightOfForce,
                                         flipped("the wheels' sign", c[0]),
                                         {}}));
  }
}

/// Rate against voltage, in units of the no-load speed; `gear`: wheel rates per rate, and drive per wheel's
/// drive.
Coefficient rate_per_drive(const Grid& g, const ImportedRobot& robot, const Series& angle,
                           const Series& drive, Series (*band)(const Series&), double gear = 1.0) {
  Coefficient c = g.fit({drive}, derivative(angle), band).front();
  constexpr double kLeast = 1e-3;  // of the nominal voltage; less does not move a wheel
  if (std::sqrt(band(drive)(g.used).square().mean()) < kLeast) return {0.0, INFINITY, 0.0};
  const double no_load = robot.motor.no_load_rad_s(robot.motor.nominal_V) / (gear * gear);
  return {c.value / no_load, c.sigma / no_load, c.reverse / no_load};
}

void check_drive(const Grid& g, const ImportedRobot& robot, std::vector<Check>* checks) {
  const std::array<double, 3> axis_of_first = robot.input({1.0});
  const double gear = robot.yaw ? 1.0 : Vec3(axis_of_first.data()).norm();  // ball over wheel radius
  for (int axis = 0; axis < (robot.yaw ? 1 : 2); ++axis) {
    // With the mean: a loop that holds the wheels' speed drives against what is left of its changes.
    const Coefficient c = rate_per_drive(g, robot, g.roll.col(axis), g.drive_roll.col(axis), slow, gear);
    Check check{axis == 0 ? "drive_wheels" : "drive_wheels_y", std::nullopt, c.value,
                "wheel rate per drive, of the no-load speed: " + shown(c)};
    if (c.known()) check.ok = c.value > 0.02 && c.value < 3.0;
    if (!check.ok)
      check.text += kUntold;
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
  const Coefficient gyro = g.fit({derivative(g.yaw)}, g.gyro.col(2)).front();
  const Coefficient drive =
      rate_per_drive(g, robot, g.wheel_half_difference, g.drive_half_difference, balancing);
  const bool opposed = drive.known() && drive.value < 0.0;
  const bool agree = drive.known() && drive.value > 0.0;
  const char* flipped = opposed ? "the wheels are swapped"
                        : agree ? "gyro z is flipped, or wheels and drive are swapped"
                                : "the wheels are swapped or gyro z is flipped";
  checks->push_back(scale_check(gyro, {"gyro_z_wheels", "gyro against wheels", kRight, flipped, kGyroUnits}));
  Check check{"drive_wheels_turn", std::nullopt, drive.value,
              "difference of wheel rates per drive, of the no-load speed: " + shown(drive)};
  // A robot that controls each wheel's speed answers what its encoders scatter: against its drive, without
  // turning.
  if (drive.known() && (drive.value > 0.0 || gyro.known())) check.ok = drive.value > 0.0;
  if (!check.ok)
    check.text += kUntold;
  else if (!*check.ok)
    check.text += gyro.value > 0.0 ? ": the drive's columns are swapped" : ": the wheels are swapped";
  checks->push_back(check);
}

/// A ball-bot's wheels: where each one's axis is, by what the IMU says of the ball's motion against the body.
void check_order(const Grid& g, const ImportedRobot& robot, std::vector<Check>* checks) {
  if (robot.yaw) return;
  const std::vector<Series> ball{Force(g, robot, 0).rolling_acceleration(),
                                 Force(g, robot, 1).rolling_acceleration(), -derivative(g.gyro.col(2))};
  Mat3 configured;
  Mat3 measured;
  bool known = true;
  for (int i = 0; i < 3; ++i) {
    WheelValues one{};
    one[static_cast<std::size_t>(i)] = 1.0;
    configured.col(i) = Eigen::Map<const Vec3>(robot.input(one).data());
    const std::vector<Coefficient> c = g.fit(ball, derivative(derivative(g.wheel.col(i))));
    const double sigma = std::hypot(c[0].sigma, c[1].sigma);
    for (std::size_t axis = 0; axis < 3; ++axis)
      measured(static_cast<int>(axis), i) = axis < 2 || c[axis].known() ? c[axis].value : 0.0;
    known = known && measured.col(i).head<2>().norm() > 3.0 * sigma;
  }
  Check check{"wheel_order", std::nullopt, kNotGiven, "wheel axes against the IMU"};
  if (known) {
    const WheelOrder order = wheel_order(configured, measured);
    check.value = order.azimuth_rad;
    check.text += format(", %+.0f degrees about z", order.azimuth_rad * 180.0 / kPi) + order.mistake;
    check.ok = order.mistake.empty();
  } else {
    check.text += ": this log does not tell";
  }
  checks->push_back(check);
}

/// What the accelerometer says against another sensor while it clips, but for its unit, is its clipping; of
/// wheels that answer their drive and turn with the gyro it is their slip.
void excuse_accelerometer(std::vector<Check>* checks) {
  const auto known = [&](const char* name, bool ok) {
    return std::any_of(checks->begin(), checks->end(),
                       [&](const Check& c) { return c.name == name && c.ok == ok; });
  };
  const bool clips = known("accel_clipping", false);
  const bool wheels = known("drive_wheels", true) && known("gyro_z_wheels", true);
  for (Check& c : *checks) {
    const bool of_wheels = c.name == "wheels_accel" && wheels;
    const bool of_accel = c.name == "accel_norm" || c.name.find("_accel") != std::string::npos;
    if (c.ok.value_or(true) || c.text.find("unit is") != std::string::npos) continue;
    if (!of_wheels && !(of_accel && clips)) continue;
    c.ok.reset();
    c.text = c.text.substr(0, c.text.find(':')) + (clips ? "; the accelerometer clips" : "; the wheels slip");
  }
}

/// A balancing robot's z points up.
Check check_up(const Grid& g, const ImportMap& map) {
  std::vector<double> up;
  up.reserve(g.used.size());
  for (const Eigen::Index k : g.used) up.push_back(g.accel(k, 2));
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
  std::vector<Check> checks = check_table(table, rows, map, robot);
  if (rows.t_s.back() - rows.t_s.front() >= 1.0) {  // long enough to move
    const Grid grid(rows, map, robot);
    checks.push_back(check_up(grid, map));
    if (grid.used.size() >= 100) {
      check_order(grid, robot, &checks);
      check_tilt(grid, robot, &checks);
      check_drive(grid, robot, &checks);
      check_yaw(grid, robot, &checks);
    }
  }
  excuse_accelerometer(&checks);
  return checks;
}

}  // namespace equipoise::app
