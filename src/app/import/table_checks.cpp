#include "app/import/table_checks.hpp"

#include <algorithm>
#include <cmath>

#include "app/import/signals.hpp"
#include "app/text/format.hpp"

namespace equipoise::app {

namespace {

constexpr double kNearUnit = 1.22;  // within this factor of a factor of units is a mistake of units

}  // namespace

std::string units_mistake(double least, double most,
                          const std::vector<std::pair<double, const char*>>& known) {
  for (const auto& [factor, what] : known)
    if (least < factor * kNearUnit && most > factor / kNearUnit) return what;
  return "";
}

namespace {

Check check_rows(const Table& table) {
  const std::size_t torn = table.torn_rows;
  return {"rows", torn * 100 <= table.rows(), static_cast<double>(torn),
          format("%zu rows; %zu with another number of cells are skipped", table.rows(), torn)};
}

std::vector<double> steps(const std::vector<double>& t_s) {
  std::vector<double> dt;
  for (std::size_t k = 1; k < t_s.size(); ++k) dt.push_back(t_s[k] - t_s[k - 1]);
  return dt;
}

Check check_clock(const ImportedRows& rows) {
  constexpr double kSlowest_s = 0.0102;  // 100 Hz and its jitter: a body falls within a tenth of a second
  const std::vector<double> dt = steps(rows.t_s);
  const double usual = median(dt);
  const double late = *std::max_element(dt.begin(), dt.end());
  Check c{"clock", std::nullopt, 1.0 / usual,
          format("%.1f rows a second, longest step %.1f ms", 1.0 / usual, 1e3 * late)};
  c.ok = rows.not_advancing == 0 && usual > 1e-5 && usual <= kSlowest_s;
  if (rows.not_advancing > 0)
    c.text += format("; %zu rows whose time does not advance are skipped", rows.not_advancing);
  if (usual > kSlowest_s) c.text += "; at least 100 are needed. Is time.unit ms or us?";
  if (usual <= 1e-5) c.text += "; too fast for a control loop: is time.unit s or ms?";
  return c;
}

Check check_gaps(const ImportedRows& rows) {
  const std::vector<double> dt = steps(rows.t_s);
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
  double at_s = 0.0;
  for (std::size_t k = 1; k < rows.t_s.size(); ++k) {
    for (std::size_t i = 0; i < static_cast<std::size_t>(robot.wheels); ++i) {
      const double step = std::abs(rows.wheel_rad[k][i] - rows.wheel_rad[k - 1][i]);
      if (!(step > fastest * (rows.t_s[k] - rows.t_s[k - 1]) + 2.0 * count)) continue;
      ++jumps;
      if (step <= largest) continue;
      largest = step;
      at_s = rows.t_s[k];
    }
  }
  const bool units = jumps > rows.t_s.size() / 10;
  Check c{"wheel_jumps", jumps == 0, static_cast<double>(jumps),
          format("%zu steps beyond 1.5 times the no-load speed of %.0f rad/s", jumps, fastest / 1.5)};
  if (jumps > 0) c.text += format(", the largest %.3g rad at %.3f s", largest, at_s);
  if (units) c.text += ": is wheels.unit right?";
  return c;
}

Check check_norm(const ImportedRows& rows) {
  std::vector<double> norms;
  for (const Vec3& f : rows.accel_m_s2)
    if (f.allFinite()) norms.push_back(f.norm());
  const double share = norms.empty() ? kNotGiven : median(norms) / kGravity_m_s2;
  Check c{"accel_norm", share > 1.0 / kRight && share < kRight, share, format("median %.3f g", share)};
  const std::string mistake = units_mistake(share / kRight, share,  // shaking raises it
                                            {{1.0 / kGravity_m_s2, ": accel.unit is g, not m/s2"},
                                             {kGravity_m_s2, ": accel.unit is m/s2, not g"},
                                             {1e-3, ": accel.unit is mg, not g"},
                                             {1e3, ": accel.unit is g, not mg"}});
  c.text += !mistake.empty() ? mistake : *c.ok ? "" : ": accel.scale or a channel is wrong";
  return c;
}

}  // namespace

std::vector<Check> check_table(const Table& table, const ImportedRows& rows, const ImportMap& map,
                               const ImportedRobot& robot) {
  return {check_rows(table),
          check_clock(rows),
          check_gaps(rows),
          check_repeats(rows),
          check_clipping("gyro_clipping", rows.gyro_rad_s, map.gyro.range),
          check_clipping("accel_clipping", rows.accel_m_s2, map.accel.range),
          check_jumps(rows, robot),
          check_norm(rows)};
}

}  // namespace equipoise::app
