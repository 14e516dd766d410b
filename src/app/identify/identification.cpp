#include "app/identify/identification.hpp"

#include <limits>
#include <utility>

#include "app/identify/least_squares.hpp"
#include "app/text/format.hpp"

namespace equipoise::app {
namespace {

using Eigen::Index;

constexpr std::size_t kMinSamples = 200;
constexpr double kMoving_rad_s = 0.5;
constexpr double kCreeping_rad_s = 0.1;
constexpr double kStribeck_rad_s = 1.0;

double sign(double x) { return x > 0.0 ? 1.0 : (x < 0.0 ? -1.0 : 0.0); }

double sample_s(const BenchLog& log) {
  return (log.rows.back().t_s - log.rows.front().t_s) / static_cast<double>(log.rows.size() - 1);
}

/// Why the samples cannot be used at all; `electrical`: current and supply are needed.
std::string unusable(const BenchLog& log, bool electrical) {
  if (log.rows.size() < kMinSamples) {
    return "the log has " + std::to_string(log.rows.size()) + " samples; record at least " +
           std::to_string(kMinSamples);
  }
  double largest_u = 0.0;
  for (std::size_t i = 0; i < log.rows.size(); ++i) {
    const BenchSample& s = log.rows[i];
    const std::string where = " at sample " + std::to_string(i);
    if (!std::isfinite(s.u)) return "u is not a number" + where;
    if (!std::isfinite(s.angle_rad)) return "angle_rad is not a number" + where;
    if (electrical && !std::isfinite(s.current_A))
      return "current_A is not measured" + where + "; the bench needs a current sensor";
    if (electrical && !(s.supply_V > 0.0)) return "supply_V is not positive" + where;
    largest_u = std::max(largest_u, std::abs(s.u));
  }
  if (largest_u < 0.02) return "the motors are never driven: |u| stays below 0.02";
  return "";
}

/// Means of voltage, current, speed over windows; change of the current between a window's ends, which are
/// halfway between samples.
struct Electrical {
  Eigen::MatrixXd A;  // current, rate, change of current, and 1 when `offset` is asked for
  Eigen::VectorXd voltage, duty;
};

Electrical electrical_windows(const BenchLog& log, double window_s, bool offset) {
  const auto w = static_cast<std::size_t>(std::max(1.0, std::round(window_s / sample_s(log))));
  const auto n = static_cast<Index>((log.rows.size() - 2) / w);
  Electrical e{Eigen::MatrixXd::Ones(n, offset ? 4 : 3), Eigen::VectorXd(n), Eigen::VectorXd(n)};
  for (Index j = 0; j < n; ++j) {
    const std::size_t first = 1 + static_cast<std::size_t>(j) * w;
    const std::size_t last = first + w - 1;
    double current = 0.0;
    double voltage = 0.0;
    double duty = 0.0;
    for (std::size_t i = first; i <= last; ++i) {
      current += log.rows[i].current_A;
      voltage += log.rows[i].u * log.rows[i].supply_V;
      duty += log.rows[i].u;
    }
    const auto count = static_cast<double>(w);
    const double time = log.rows[last].t_s - log.rows[first - 1].t_s;
    const double di = 0.5 * (log.rows[last + 1].current_A + log.rows[last].current_A -
                             log.rows[first].current_A - log.rows[first - 1].current_A);
    e.A(j, 0) = current / count;
    e.A(j, 1) = (log.rows[last].angle_rad - log.rows[first - 1].angle_rad) / time;
    e.A(j, 2) = di / time;
    e.voltage(j) = voltage / count;
    e.duty(j) = duty / count;
  }
  return e;
}

/// R where the command is small, over R of the whole log, less its own uncertainty: coasting bridges lose
/// current there, braking ones do not.
double resistance_at_small_duty(const Electrical& e, const Eigen::VectorXd& x) {
  constexpr double kSmall = 0.4;
  double squares = 0.0;
  double products = 0.0;
  double voltages = 0.0;
  double count = 0.0;
  const double offset_V = x.size() > 3 ? x(3) : 0.0;
  for (Index j = 0; j < e.A.rows(); ++j) {
    if (std::abs(e.duty(j)) > kSmall) continue;
    const double current = e.A(j, 0) + offset_V / x(0);  // less the sensor's zero
    const double voltage = e.voltage(j) - x(1) * e.A(j, 1);
    squares += current * current;
    products += current * voltage;
    voltages += voltage * voltage;
    count += 1.0;
  }
  if (squares == 0.0 || count < 3.0) return 1.0;
  const double small = products / squares;
  const double sigma = std::sqrt(std::max(0.0, voltages - small * products) / (count - 1.0) / squares);
  return (small - 1.96 * sigma) / x(0);
}

/// How much less is unexplained when the current may count more or less the larger it is.
double share_of_a_bent_current(const Electrical& e, double r_squared) {
  const double mean = e.A.col(0).mean();
  const Eigen::ArrayXd current = e.A.col(0).array() - mean;
  const double sigma = std::sqrt(current.square().mean());
  if (sigma == 0.0) return 0.0;
  Eigen::MatrixXd A(e.A.rows(), e.A.cols() + 2);
  A << e.A, current.square() / sigma, current.cube() / (sigma * sigma);
  return 1.0 - (1.0 - least_squares(A, e.voltage).r_squared) / (1.0 - r_squared);
}

constexpr double kFine_s = 5e-3;
constexpr double kCoarse_s = 20e-3;
constexpr double kSweep_s = 0.4;  // shorter logs are locked steps, sampled fast: L instead of k
constexpr double kPrecise = 0.1;  // of R and k

std::string coasts(const Electrical& rows, const LeastSquares& fit) {
  constexpr double kSuspicious = 1.18;
  if (fit.x(0) > 0.0 &&
      (std::abs(fit.x(1)) < fit.half_width(1) || resistance_at_small_duty(rows, fit.x) < kSuspicious))
    return "";
  return format(
      "at small duty the current is far below (u V - k omega)/R (R2 %.3f): the bridge coasts, or the sensor "
      "measures the supply's current; record the log with the driver in drive/brake mode and the sensor in "
      "the motor's line",
      fit.r_squared);
}

/// Why a sweep does not give R and k; empty: it does.
std::string why_not(const BenchLog& log, const Electrical& rows, const LeastSquares& fit) {
  if (rows.A.col(0).maxCoeff() - rows.A.col(0).minCoeff() < 1e-6)
    return "current_A never changes: the sensor or the driver is off";
  if (rows.voltage.maxCoeff() - rows.voltage.minCoeff() < 1e-6)
    return "the voltage u supply_V never changes: record a step or a sweep";
  constexpr double kRelated = 0.5;
  if (fit.r_squared < kRelated)
    return format(
        "voltage, current and speed are not related as V = R i + k omega (R2 %.3f): the driver or the sensor "
        "is off, or a unit, a sign or a column is wrong",
        fit.r_squared);
  std::string coasting = coasts(rows, fit);
  if (!coasting.empty()) return coasting;
  const Electrical fine_rows = electrical_windows(log, kFine_s, true);
  const LeastSquares fine = least_squares(fine_rows.A, fine_rows.voltage);
  for (const auto& [i, name] : {std::pair<Index, const char*>{0, "R"}, {1, "k"}}) {
    const double least = std::max(fine.half_width(i) + fit.half_width(i), 0.25 * kPrecise * fit.x(i));
    if (std::abs(fine.x(i) - fit.x(i)) <= least) continue;
    return format(
        "%s is %.4g +- %.2g from means of 5 ms and %.4g +- %.2g from means of 20 ms (R2 %.3f, %.3f): the "
        "current sensor is filtered, late or noisy; record with the filter off",
        name, fine.x(i), fine.half_width(i), fit.x(i), fit.half_width(i), fine.r_squared, fit.r_squared);
  }
  constexpr double kMostOfIt = 0.5;
  const double bent = share_of_a_bent_current(rows, fit.r_squared);
  if (bent > kMostOfIt)
    return format(
        "%.0f %% of what V = R i + k omega leaves unexplained (R2 %.3f) goes with the current's square and "
        "cube: the current sensor is not linear, or its zero or the supply moves with the load",
        100.0 * bent, fit.r_squared);
  if (!(fit.half_width(0) < kPrecise * fit.x(0)))
    return format(
        "R is %.3g +- %.2g ohm, and +-10 %% is asked for (R2 %.3f): drive larger changes of current, or "
        "several steps in one log",
        fit.x(0), fit.half_width(0), fit.r_squared);
  return "";
}

/// Means under the triangular weight with which the difference of two mean rates is the mean acceleration.
struct Window {
  double acceleration = 0.0;
  double rate = 0.0;
  double current_A = 0.0;
  double u = 0.0;
};

/// Mean rate over the samples from `first` to `last`.
double slope(const BenchLog& log, std::size_t first, std::size_t last) {
  const BenchSample& a = log.rows[first];
  const BenchSample& b = log.rows[last];
  return (b.angle_rad - a.angle_rad) / (b.t_s - a.t_s);
}

/// Whether the shaft turns one way, fast enough, in every quarter of the window: across a reversal the sign
/// of friction changes.
bool moves_throughout(const BenchLog& log, std::size_t first, std::size_t last, double min_rate_rad_s) {
  const std::size_t quarter = (last - first) / 4;
  const double direction = sign(slope(log, first, last));
  for (std::size_t at = first; at + quarter <= last; at += quarter) {
    if (direction * slope(log, at, at + quarter) <= min_rate_rad_s) return false;
  }
  return true;
}

std::vector<Window> windows_in_motion(const BenchLog& log, double min_rate_rad_s) {
  constexpr std::size_t kHalf = 10;
  std::vector<Window> windows;
  for (std::size_t i = kHalf + 1; i + kHalf < log.rows.size(); ++i) {
    const std::size_t first = i - kHalf;
    const std::size_t last = i + kHalf;
    if (!moves_throughout(log, first, last, min_rate_rad_s)) continue;
    Window w;
    w.acceleration =
        2.0 * (slope(log, i, last) - slope(log, first, i)) / (log.rows[last].t_s - log.rows[first].t_s);
    double weights = 0.0;
    for (std::size_t m = first + 1; m <= last; ++m) {
      const double from_centre = std::abs(static_cast<double>(m) - static_cast<double>(i) - 0.5);
      const double weight = static_cast<double>(kHalf) - from_centre;
      w.rate += weight * slope(log, m - 1, m);
      w.current_A += weight * log.rows[m].current_A;
      w.u += weight * log.rows[m].u;
      weights += weight;
    }
    w.rate /= weights;
    w.current_A /= weights;
    w.u /= weights;
    windows.push_back(w);
  }
  return windows;
}

struct Flywheel {
  double inertia_kg_m2 = 0.0;  // 0: not known
  double current_zero_A = 0.0;
};

/// Coulomb and viscous friction at the motor's output, and the inertia unless it is known.
void add_motor_friction(const BenchLog& log, double k, const Flywheel& flywheel, Identified* out) {
  const std::vector<Window> windows = windows_in_motion(log, kMoving_rad_s);
  if (windows.size() < kMinSamples) return;
  const bool known = flywheel.inertia_kg_m2 > 0.0;
  const auto n = static_cast<Index>(windows.size());
  Eigen::MatrixXd A(n, known ? 2 : 3);
  Eigen::VectorXd b(n);
  for (Index j = 0; j < n; ++j) {
    const Window& w = windows[static_cast<std::size_t>(j)];
    A(j, 0) = sign(w.rate);
    A(j, 1) = w.rate;
    b(j) = k * (w.current_A - flywheel.current_zero_A);
    if (known) {
      b(j) -= flywheel.inertia_kg_m2 * w.acceleration;
    } else {
      A(j, 2) = w.acceleration;
    }
  }
  const LeastSquares fit = least_squares(A, b);
  out->r_squared_torque = fit.r_squared;
  out->estimates.push_back({"coulomb_friction_N_m", fit.x(0), fit.half_width(0)});
  out->estimates.push_back({"viscous_friction_N_m_s", fit.x(1), fit.half_width(1)});
  if (!known) out->estimates.push_back({"inertia_kg_m2", fit.x(2), fit.half_width(2)});
}

/// Regressors of the friction rig: command, -(viscous), -(Coulomb, one or by direction), -(Stribeck excess).
Eigen::MatrixXd friction_regressors(const std::vector<Window>& windows, const FrictionRig& rig) {
  const double ratio = rig.flywheel_over_ball_radius;
  const Index directions = rig.separate_directions ? 2 : 1;
  const auto n = static_cast<Index>(windows.size());
  Eigen::MatrixXd A = Eigen::MatrixXd::Zero(n, 2 + directions + (rig.stribeck ? 1 : 0));
  for (Index j = 0; j < n; ++j) {
    const Window& w = windows[static_cast<std::size_t>(j)];
    const double ball_rate = ratio * w.rate;
    A(j, 0) = rig.k1_N_m * w.u - rig.k2_ball_N_m_s * ball_rate;
    A(j, 1) = -ball_rate;
    A(j, 2 + (directions == 2 && ball_rate < 0.0 ? 1 : 0)) = -sign(ball_rate);
    const double slow = ball_rate / kStribeck_rad_s;
    if (rig.stribeck) A(j, A.cols() - 1) = -sign(ball_rate) * std::exp(-slow * slow);
  }
  return A;
}

/// Torques that nobody measures move the flywheel: its acceleration carries the noise, so it is the one
/// explained. This turns the coefficients, which come divided by the inertia, into inertia and torques.
void undo_division_by_inertia(LeastSquares* fit) {
  const double inverse = fit->x(0);
  for (Index i = 1; i < fit->x.size(); ++i) {
    fit->x(i) /= inverse;
    fit->half_width(i) /= std::abs(inverse);
  }
  fit->x(0) = 1.0 / inverse;
  fit->half_width(0) /= inverse * inverse;
}

}  // namespace

Identified identify_motor(const BenchLog& log, double inertia_kg_m2) {
  Identified out;
  out.refused = unusable(log, true);
  if (!out.refused.empty()) return out;
  if (log.bridge == LoggedBridge::kDriveCoast) {
    out.refused =
        "the log was recorded in drive/coast mode, where voltage and current are not in a linear relation; "
        "record it with the driver in drive/brake mode";
    return out;
  }
  const bool sweep = log.rows.back().t_s - log.rows.front().t_s > kSweep_s;
  const Electrical rows = electrical_windows(log, sweep ? kCoarse_s : 50e-6, sweep);
  const LeastSquares e = least_squares(rows.A, rows.voltage);
  const double R = e.x(0);
  const double k = e.x(1);
  out.r_squared = e.r_squared;
  out.refused = sweep ? why_not(log, rows, e) : coasts(rows, e);
  if (!out.refused.empty()) return out;
  out.estimates = {{"resistance_ohm", R, e.half_width(0), kPrecise},
                   {"torque_constant_N_m_A", k, e.half_width(1), kPrecise},
                   {"inductance_H", e.x(2), e.half_width(2)}};
  const double zero_A = sweep ? -e.x(3) / R : 0.0;
  if (sweep && std::abs(e.x(3)) > e.half_width(3))
    out.estimates.push_back({"current_offset_A", zero_A, e.half_width(3) / R});
  // A current that settles within two samples, or within a mean, leaves no trace of L.
  if (e.x(2) < 2.0 * R * (sweep ? kCoarse_s : sample_s(log))) {
    out.estimates[2].half_width = std::numeric_limits<double>::infinity();
  }
  // No small motor's current takes as long: a filtered sensor's, which R and k do not mind and the torque
  // does.
  const bool filtered = sweep && e.x(2) - e.half_width(2) > kFine_s * R;
  if (out.estimates[1].determined() && !filtered) add_motor_friction(log, k, {inertia_kg_m2, zero_A}, &out);
  return out;
}

Identified identify_friction(const BenchLog& log, const FrictionRig& asked) {
  Identified out;
  out.refused = unusable(log, false);
  if (!out.refused.empty()) return out;
  FrictionRig rig = asked;
  if (std::isnan(rig.flywheel_over_ball_radius)) rig.flywheel_over_ball_radius = log.radius_ratio;
  if (!(rig.flywheel_over_ball_radius > 0.0)) {
    out.refused = "does not say the flywheel's radius over the ball's; give it by --radius-ratio";
    return out;
  }
  const double least = rig.stribeck ? kCreeping_rad_s : kMoving_rad_s;  // of the ball
  const std::vector<Window> windows = windows_in_motion(log, least / rig.flywheel_over_ball_radius);
  if (windows.size() < kMinSamples) {
    out.refused = "the flywheel hardly moves: " + std::to_string(windows.size()) +
                  " usable samples; drive it with a larger or longer sweep";
    return out;
  }
  Eigen::VectorXd acceleration(static_cast<Index>(windows.size()));
  for (Index j = 0; j < acceleration.size(); ++j) {
    acceleration(j) = windows[static_cast<std::size_t>(j)].acceleration / rig.flywheel_over_ball_radius;
  }
  LeastSquares fit = least_squares(friction_regressors(windows, rig), acceleration);
  out.r_squared = fit.r_squared;
  if (fit.x(0) <= 0.0) {
    out.refused = "the flywheel accelerates against the command; check the sign of u or of the encoder";
    return out;
  }
  undo_division_by_inertia(&fit);
  const auto add = [&](const std::string& name, Index i) {
    out.estimates.push_back({name, fit.x(i), fit.half_width(i)});
  };
  add("flywheel_inertia_kg_m2", 0);
  add("viscous_friction_N_m_s", 1);
  if (rig.separate_directions) {
    add("coulomb_friction_positive_N_m", 2);
    add("coulomb_friction_negative_N_m", 3);
    out.estimates.push_back({"coulomb_friction_N_m", 0.5 * (fit.x(2) + fit.x(3)),
                             0.5 * std::hypot(fit.half_width(2), fit.half_width(3))});
  } else {
    add("coulomb_friction_N_m", 2);
  }
  if (rig.stribeck) add("stribeck_excess_N_m", fit.x.size() - 1);
  return out;
}

}  // namespace equipoise::app
