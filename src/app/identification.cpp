#include "identification.hpp"

#include <cmath>
#include <limits>

#include "least_squares.hpp"

namespace equipoise::app {
namespace {

using Eigen::Index;

constexpr std::size_t kMinSamples = 200;
constexpr double kMoving_rad_s = 0.5;

double sign(double x) { return x > 0.0 ? 1.0 : (x < 0.0 ? -1.0 : 0.0); }

/// Mean rate over +-`half` samples of an angle, at sample i.
double slope(const BenchLog& log, std::size_t i, std::size_t half) {
  const BenchRow& a = log.rows[i - half];
  const BenchRow& b = log.rows[i + half];
  return (b.angle_rad - a.angle_rad) / (b.t_s - a.t_s);
}

std::string too_short(const BenchLog& log) {
  if (log.rows.size() >= kMinSamples) return "";
  return "the log has " + std::to_string(log.rows.size()) + " samples; record at least " +
         std::to_string(kMinSamples);
}

double sample_s(const BenchLog& log) {
  return (log.rows.back().t_s - log.rows.front().t_s) / static_cast<double>(log.rows.size() - 1);
}

/// Electrical regression over windows of at least 50 us: means of voltage, current, speed; change of the
/// current between the window's ends, which are halfway between samples.
LeastSquares electrical(const BenchLog& log) {
  constexpr double kWindow_s = 50e-6;
  const auto w = static_cast<std::size_t>(std::max(1.0, std::round(kWindow_s / sample_s(log))));
  const auto n = static_cast<Index>((log.rows.size() - 2) / w);
  Eigen::MatrixXd A(n, 3);
  Eigen::VectorXd b(n);
  for (Index j = 0; j < n; ++j) {
    const std::size_t first = 1 + static_cast<std::size_t>(j) * w;
    const std::size_t last = first + w - 1;
    double current = 0.0;
    double voltage = 0.0;
    for (std::size_t i = first; i <= last; ++i) {
      current += log.rows[i].current_A;
      voltage += log.rows[i].u * log.rows[i].supply_V;
    }
    const auto count = static_cast<double>(w);
    const double time = log.rows[last].t_s - log.rows[first - 1].t_s;
    const double di = 0.5 * (log.rows[last + 1].current_A + log.rows[last].current_A -
                             log.rows[first].current_A - log.rows[first - 1].current_A);
    A.row(j) << current / count, (log.rows[last].angle_rad - log.rows[first - 1].angle_rad) / time, di / time;
    b(j) = voltage / count;
  }
  return least_squares(A, b);
}

/// R^2 of current that (4.3) explains where the command is small against where it is large: coasting bridges
/// lose current at small duty, braking ones do not.
double gain_at_small_duty(const BenchLog& log, double R, double k) {
  double predicted_sq = 0.0;
  double product = 0.0;
  for (std::size_t i = 1; i < log.rows.size(); ++i) {
    const BenchRow& s = log.rows[i];
    if (std::abs(s.u) > 0.4) continue;
    const double omega = (s.angle_rad - log.rows[i - 1].angle_rad) / (s.t_s - log.rows[i - 1].t_s);
    const double linear = (s.u * s.supply_V - k * omega) / R;
    predicted_sq += linear * linear;
    product += linear * s.current_A;
  }
  return predicted_sq > 0.0 ? product / predicted_sq : 1.0;
}

}  // namespace

Identified identify_motor(const BenchLog& log, double inertia_kg_m2) {
  Identified out;
  out.refused = too_short(log);
  if (!out.refused.empty()) return out;
  if (log.bridge == LoggedBridge::kDriveCoast) {
    out.refused =
        "the log was recorded in drive/coast mode, where voltage and current are not in a linear relation; "
        "record it with the driver in drive/brake mode";
    return out;
  }
  const LeastSquares e = electrical(log);
  const double R = e.x(0);
  const double k = e.x(1);
  out.r_squared = e.r_squared;
  constexpr double kSuspicious = 0.85;
  if (R <= 0.0 || (std::abs(k) > e.half_width(1) && gain_at_small_duty(log, R, k) < kSuspicious)) {
    out.refused =
        "at small duty the current is far below (u V - k omega)/R: the bridge coasts; record the log with "
        "the driver "
        "in drive/brake mode";
    return out;
  }
  out.estimates = {{"resistance_ohm", R, e.half_width(0)},
                   {"torque_constant_N_m_A", k, e.half_width(1)},
                   {"inductance_H", e.x(2), e.half_width(2)}};
  // A current that settles within two samples leaves no trace of L.
  if (e.x(2) < 2.0 * R * sample_s(log)) {
    out.estimates[2].half_width = std::numeric_limits<double>::infinity();
  }
  if (!out.estimates[1].determined()) return out;

  // Mechanics over windows of 2 x half samples: k i = J omega' + c sign + b omega.
  constexpr std::size_t kHalf = 5;
  std::vector<std::size_t> used;
  for (std::size_t i = 2 * kHalf + 1; i + 2 * kHalf < log.rows.size(); ++i) {
    const double before = slope(log, i - kHalf, kHalf);
    const double after = slope(log, i + kHalf, kHalf);
    if (before * after > 0.0 && std::min(std::abs(before), std::abs(after)) > kMoving_rad_s)
      used.push_back(i);
  }
  if (used.size() < kMinSamples) return out;
  const bool known = inertia_kg_m2 > 0.0;
  Eigen::MatrixXd A(static_cast<Index>(used.size()), known ? 2 : 3);
  Eigen::VectorXd b(static_cast<Index>(used.size()));
  for (std::size_t j = 0; j < used.size(); ++j) {
    const std::size_t i = used[j];
    const double before = slope(log, i - kHalf, kHalf);
    const double after = slope(log, i + kHalf, kHalf);
    const double time = log.rows[i + kHalf].t_s - log.rows[i - kHalf].t_s;
    const double acceleration = (after - before) / time;
    // The difference of two mean rates is the mean acceleration under a triangular weight; so is the current.
    double current = 0.0;
    double omega = 0.0;
    double weights = 0.0;
    for (std::size_t m = i - 2 * kHalf + 1; m <= i + 2 * kHalf; ++m) {
      const double from_centre = std::abs(static_cast<double>(m) - static_cast<double>(i) - 0.5);
      const double weight = 2.0 * static_cast<double>(kHalf) - from_centre;
      current += weight * log.rows[m].current_A;
      omega += weight * (log.rows[m].angle_rad - log.rows[m - 1].angle_rad) /
               (log.rows[m].t_s - log.rows[m - 1].t_s);
      weights += weight;
    }
    const auto row = static_cast<Index>(j);
    A(row, 0) = sign(omega);
    A(row, 1) = omega / weights;
    b(row) = k * current / weights;
    if (known) {
      b(row) -= inertia_kg_m2 * acceleration;
    } else {
      A(row, 2) = acceleration;
    }
  }
  const LeastSquares m = least_squares(A, b);
  out.r_squared_torque = m.r_squared;
  out.estimates.push_back({"coulomb_friction_N_m", m.x(0), m.half_width(0)});
  out.estimates.push_back({"viscous_friction_N_m_s", m.x(1), m.half_width(1)});
  if (!known) out.estimates.push_back({"inertia_kg_m2", m.x(2), m.half_width(2)});
  return out;
}

Identified identify_friction(const BenchLog& log, const FrictionRig& rig) {
  Identified out;
  out.refused = too_short(log);
  if (!out.refused.empty()) return out;
  constexpr std::size_t kHalf = 5;
  const double ratio = rig.flywheel_over_ball_radius;
  std::vector<std::size_t> used;
  for (std::size_t i = 2 * kHalf + 1; i + 2 * kHalf < log.rows.size(); ++i) {
    const double before = slope(log, i - kHalf, kHalf);
    const double after = slope(log, i + kHalf, kHalf);
    // Across a reversal the sign of friction changes within the window.
    if (before * after > 0.0 && ratio * std::min(std::abs(before), std::abs(after)) > kMoving_rad_s) {
      used.push_back(i);
    }
  }
  if (used.size() < kMinSamples) {
    out.refused = "the flywheel hardly moves: " + std::to_string(used.size()) +
                  " usable samples; drive it with a larger or longer sweep";
    return out;
  }
  // Columns: J, mu_v, mu_c (one or by direction), Stribeck excess.
  const Index directions = rig.separate_directions ? 2 : 1;
  const Index columns = 2 + directions + (rig.stribeck ? 1 : 0);
  Eigen::MatrixXd A = Eigen::MatrixXd::Zero(static_cast<Index>(used.size()), columns);
  Eigen::VectorXd b(static_cast<Index>(used.size()));
  for (std::size_t j = 0; j < used.size(); ++j) {
    const std::size_t i = used[j];
    const double time = log.rows[i + kHalf].t_s - log.rows[i - kHalf].t_s;
    const double acceleration = (slope(log, i + kHalf, kHalf) - slope(log, i - kHalf, kHalf)) / time;
    double u = 0.0;
    double ball_rate = 0.0;
    double weights = 0.0;
    for (std::size_t m = i - 2 * kHalf + 1; m <= i + 2 * kHalf; ++m) {
      const double from_centre = std::abs(static_cast<double>(m) - static_cast<double>(i) - 0.5);
      const double weight = 2.0 * static_cast<double>(kHalf) - from_centre;
      u += weight * log.rows[m].u;
      ball_rate += weight * ratio * (log.rows[m].angle_rad - log.rows[m - 1].angle_rad) /
                   (log.rows[m].t_s - log.rows[m - 1].t_s);
      weights += weight;
    }
    u /= weights;
    ball_rate /= weights;
    const auto row = static_cast<Index>(j);
    A(row, 0) = acceleration / ratio;
    A(row, 1) = ball_rate;
    A(row, 2 + (directions == 2 && ball_rate < 0.0 ? 1 : 0)) = sign(ball_rate);
    if (rig.stribeck) {
      constexpr double kStribeck_rad_s = 1.0;
      const double slow = ball_rate / kStribeck_rad_s;
      A(row, columns - 1) = sign(ball_rate) * std::exp(-slow * slow);
    }
    b(row) = rig.k1_N_m * u - rig.k2_ball_N_m_s * ball_rate;
  }
  // Torques that nobody measures move the flywheel: its acceleration is what carries the noise, so it is the
  // one explained, and the parameters come divided by the inertia.
  Eigen::MatrixXd by_inertia = -A;
  by_inertia.col(0) = b;
  LeastSquares fit = least_squares(by_inertia, A.col(0));
  out.r_squared = fit.r_squared;
  const double inverse = fit.x(0);
  fit.half_width /= std::abs(inverse);
  fit.half_width(0) /= std::abs(inverse);
  fit.x /= inverse;
  fit.x(0) = 1.0 / inverse;
  out.estimates.push_back({"flywheel_inertia_kg_m2", fit.x(0), fit.half_width(0)});
  out.estimates.push_back({"viscous_friction_N_m_s", fit.x(1), fit.half_width(1)});
  if (directions == 1) {
    out.estimates.push_back({"coulomb_friction_N_m", fit.x(2), fit.half_width(2)});
  } else {
    out.estimates.push_back({"coulomb_friction_positive_N_m", fit.x(2), fit.half_width(2)});
    out.estimates.push_back({"coulomb_friction_negative_N_m", fit.x(3), fit.half_width(3)});
    const double mean = 0.5 * (fit.x(2) + fit.x(3));
    out.estimates.push_back(
        {"coulomb_friction_N_m", mean, 0.5 * std::hypot(fit.half_width(2), fit.half_width(3))});
  }
  if (rig.stribeck)
    out.estimates.push_back({"stribeck_excess_N_m", fit.x(columns - 1), fit.half_width(columns - 1)});
  return out;
}

}  // namespace equipoise::app
