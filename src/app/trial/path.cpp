#include "app/trial/path.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <sstream>
#include <vector>

#include "app/text/errors.hpp"
#include "app/text/files.hpp"
#include "app/text/format.hpp"

namespace equipoise::app {
namespace {

constexpr double kStart_s = 2.0;    // from rest to the path's speed
constexpr double kRadius_m = 0.3;   // of circle and waltz
constexpr double kEight_m = 0.4;    // half the width of the eight
constexpr double kSide_m = 0.6;     // of the square, corners included
constexpr double kCorner_m = 0.15;  // their radius
constexpr double kWaltz_rad_s = kPi;
constexpr double kLongest_s = 86400.0;  // of a file: every tick of it is checked before the start
constexpr double kStanding_m_s = 1e-6;

/// Time that has passed on the path when it is begun smoothly, and its rate.
std::array<double, 2> eased(double t_s) noexcept {
  const double x = std::clamp(t_s / kStart_s, 0.0, 1.0);
  const double gained_s = kStart_s * x * x * x * (1.0 - 0.5 * x);
  return {gained_s + std::max(t_s - kStart_s, 0.0), x * x * (3.0 - 2.0 * x)};
}

class Circle : public Path {
 public:
  Circle(double speed_m_s, double spin_rad_s) : rate_rad_s_(speed_m_s / kRadius_m), spin_rad_s_(spin_rad_s) {}
  PathPoint at(double t_s) const noexcept override {
    const auto [u, rate] = eased(t_s);
    const double turned = rate_rad_s_ * u;
    return {kRadius_m * Vec2(std::sin(turned), 1.0 - std::cos(turned)),
            kRadius_m * rate_rad_s_ * rate * Vec2(std::cos(turned), std::sin(turned)), spin_rad_s_ * u,
            spin_rad_s_ * rate};
  }

 private:
  double rate_rad_s_;
  double spin_rad_s_;
};

/// x = sin p, y = sin 2p, turned so that it begins along x. It is fastest in its middle.
class Eight : public Path {
 public:
  explicit Eight(double speed_m_s) : rate_rad_s_(speed_m_s / (std::sqrt(2.0) * kEight_m)) {}
  PathPoint at(double t_s) const noexcept override {
    const auto [u, rate] = eased(t_s);
    const double p = rate_rad_s_ * u;
    return {kEight_m * turned(Vec2(std::sin(p), 0.5 * std::sin(2.0 * p))),
            kEight_m * rate_rad_s_ * rate * turned(Vec2(std::cos(p), std::cos(2.0 * p))), 0.0, 0.0};
  }

 private:
  static Vec2 turned(const Vec2& v) noexcept { return rotate(-kPi / 4.0, v); }
  double rate_rad_s_;
};

/// Sides and quarter circles at one speed.
class Square : public Path {
 public:
  explicit Square(double speed_m_s) : speed_m_s_(speed_m_s) {}
  PathPoint at(double t_s) const noexcept override {
    constexpr double kStraight_m = kSide_m - 2.0 * kCorner_m;
    constexpr double kQuarter_m = kStraight_m + 0.5 * kPi * kCorner_m;
    const auto [u, rate] = eased(t_s);
    const double along_m = std::fmod(speed_m_s_ * u, 4.0 * kQuarter_m);
    const double quarter = std::floor(along_m / kQuarter_m);
    const double s = along_m - quarter * kQuarter_m;
    const double angle = std::max(s - kStraight_m, 0.0) / kCorner_m;
    const Vec2 in_quarter =
        Vec2(std::min(s, kStraight_m), 0.0) + kCorner_m * Vec2(std::sin(angle), 1.0 - std::cos(angle));
    Vec2 corner = Vec2::Zero();
    for (int i = 0; i < static_cast<int>(quarter); ++i)
      corner += rotate(0.5 * kPi * i, Vec2(kStraight_m + kCorner_m, kCorner_m));
    const double heading = 0.5 * kPi * quarter;
    return {corner + rotate(heading, in_quarter), speed_m_s_ * rate * rotate(heading + angle, Vec2(1.0, 0.0)),
            0.0, 0.0};
  }

 private:
  double speed_m_s_;
};

using Row = Eigen::Vector3d;  // x, y, yaw

/// Cubic spline through waypoints with continuous acceleration, at rest at both ends.
class Waypoints : public Path {
 public:
  Waypoints(std::vector<double> t_s, std::vector<Row> rows) : t_s_(std::move(t_s)), rows_(std::move(rows)) {
    const std::size_t n = rows_.size();
    slopes_.assign(n, Row::Zero());
    std::vector<double> upper(n, 0.0);  // Thomas algorithm for the slopes of a clamped spline
    for (std::size_t i = 1; i + 1 < n; ++i) {
      const double before = 1.0 / (t_s_[i] - t_s_[i - 1]);
      const double after = 1.0 / (t_s_[i + 1] - t_s_[i]);
      const Row right =
          3.0 * (before * before * (rows_[i] - rows_[i - 1]) + after * after * (rows_[i + 1] - rows_[i]));
      const double pivot = 2.0 * (before + after) - before * upper[i - 1];
      upper[i] = after / pivot;
      slopes_[i] = (right - before * slopes_[i - 1]) / pivot;
    }
    for (std::size_t i = n - 1; i-- > 1;) slopes_[i] -= upper[i] * slopes_[i + 1];
  }

  double end_s() const noexcept { return t_s_.back(); }

  PathPoint at(double t_s) const noexcept override {
    const double t = std::clamp(t_s, 0.0, end_s());
    const auto after = std::upper_bound(t_s_.begin() + 1, t_s_.end() - 1, t);
    const auto i = static_cast<std::size_t>(after - t_s_.begin()) - 1;
    const double h = t_s_[i + 1] - t_s_[i];
    const double x = (t - t_s_[i]) / h;
    const Row step = rows_[i + 1] - rows_[i];
    const Row c = 3.0 * step - h * (2.0 * slopes_[i] + slopes_[i + 1]);
    const Row d = h * (slopes_[i] + slopes_[i + 1]) - 2.0 * step;
    const Row value = rows_[i] + x * (h * slopes_[i] + x * (c + x * d));
    const Row rate = t == t_s ? Row(slopes_[i] + x * (2.0 * c + 3.0 * x * d) / h) : Row(Row::Zero());
    return {value.head<2>(), rate.head<2>(), value.z(), rate.z()};
  }

 private:
  std::vector<double> t_s_;
  std::vector<Row> rows_;
  std::vector<Row> slopes_;
};

std::unique_ptr<Waypoints> read_waypoints(const std::string& file_name) {
  std::error_code ignored;
  if (!std::filesystem::exists(file_name, ignored))
    throw InputError("--path " + file_name + ": neither circle, figure8, square, waltz nor a file");
  std::istringstream file(read_text(file_name));
  std::vector<double> t_s;
  std::vector<Row> rows;
  std::string line;
  for (int number = 1; std::getline(file, line); ++number) {
    line.resize(std::min(line.find('#'), line.size()));
    std::replace(line.begin(), line.end(), ',', ' ');
    if (line.find_first_not_of(" \t\r") == std::string::npos) continue;
    const auto fail = [&](const char* what) {
      throw InputError(file_name + ":" + std::to_string(number) + ": " + what);
    };
    std::istringstream text(line);
    double t = 0.0;
    Row row;
    if (!(text >> t >> row.x() >> row.y() >> row.z()) || !(text >> std::ws).eof())
      fail("expected four numbers: time, x, y, yaw in s, m, m, rad");
    if (t_s.empty() && t != 0.0) fail("the first waypoint is at time 0");
    if (!t_s.empty() && t <= t_s.back()) fail("times must increase");
    if (t > kLongest_s) fail("time exceeds 86400 s, a day");
    t_s.push_back(t);
    rows.push_back(row);
  }
  if (rows.size() < 2) throw InputError(file_name + ": a path has two waypoints or more");
  const Row start = rows.front();
  for (Row& row : rows) row -= start;
  return std::make_unique<Waypoints>(std::move(t_s), std::move(rows));
}

/// What the robot is told at every tick, and that it then goes where the path goes.
void require_feasible(const std::string& name, const Path& path, double until_s, const PathLimits& limits) {
  constexpr double kOff_rad = kPi / 4.0;  // of a heading that is summed in steps
  const auto require = [&](double value, double limit, const char* what, double t_s) {
    if (value <= limit) return;
    throw InputError("--path " + name +
                     format(": asks for %.3g %s at %.3g s; the robot does %.3g", value, what, t_s, limit));
  };
  const auto ticks = static_cast<std::int64_t>(std::ceil(until_s * kTickHz));
  PathPoint before = path.at(0.0);
  double heading = 0.0;  // of a robot that goes along its nose
  bool started = false;
  for (std::int64_t i = 1; i <= ticks; ++i) {
    const double t_s = static_cast<double>(i) * kTickS;
    const PathPoint point = path.at(t_s);
    const Vec2 v = point.velocity_W_m_s;
    require(v.norm(), limits.speed_m_s, "m/s", t_s);
    require((v - before.velocity_W_m_s).norm() / kTickS, limits.acceleration_m_s2, "m/s^2", t_s);
    require((point.position_W_m - before.position_W_m).norm() / kTickS,
            limits.speed_m_s + limits.acceleration_m_s2 * kTickS, "m/s between two ticks", t_s);
    before = point;
    if (!limits.along_nose) {
      require(std::abs(point.yaw_rate_rad_s), limits.yaw_rate_rad_s, "rad/s of yaw", t_s);
      continue;
    }
    const double yaw_rate_rad_s = along_its_nose(path, t_s).yaw_rate_rad_s;
    require(std::abs(yaw_rate_rad_s), limits.yaw_rate_rad_s, "rad/s of yaw", t_s);
    if (v.norm() > kStanding_m_s) {
      if (!started) heading = std::atan2(v.y(), v.x());
      started = true;
      const Vec2 nose = rotate(-heading, v);
      require(std::abs(std::atan2(nose.y(), nose.x())), kOff_rad, "rad of turn on the spot", t_s);
    }
    heading += kTickS * yaw_rate_rad_s;
  }
}

}  // namespace

std::unique_ptr<Path> make_path(const std::string& name, double speed_m_s, const PathLimits& limits) {
  constexpr double kLongEnough_s = 60.0;  // to have met every part of a named path at any sensible speed
  std::unique_ptr<Path> path;
  double until_s = kLongEnough_s;
  if (name == "circle") {
    path = std::make_unique<Circle>(speed_m_s, 0.0);
  } else if (name == "waltz") {
    path = std::make_unique<Circle>(speed_m_s, kWaltz_rad_s);
  } else if (name == "figure8") {
    path = std::make_unique<Eight>(speed_m_s);
  } else if (name == "square") {
    path = std::make_unique<Square>(speed_m_s);
  } else {
    std::unique_ptr<Waypoints> waypoints = read_waypoints(name);
    until_s = waypoints->end_s();
    path = std::move(waypoints);
  }
  require_feasible(name, *path, until_s, limits);
  return path;
}

PathPoint along_its_nose(const Path& path, double t_s) noexcept {
  PathPoint point = path.at(t_s);
  const Vec2 v = point.velocity_W_m_s;
  const Vec2 next = path.at(t_s + kTickS).velocity_W_m_s;
  const bool moving = v.norm() > kStanding_m_s && next.norm() > kStanding_m_s;
  const double turned = std::atan2(v.x() * next.y() - v.y() * next.x(), v.dot(next));
  point.velocity_W_m_s = Vec2(v.norm(), 0.0);
  point.yaw_rate_rad_s = moving ? turned / kTickS : 0.0;
  return point;
}

}  // namespace equipoise::app
