// Mean current of a drive/coast H-bridge in periodic steady state, and its inverse.
// In: T_r = T_pwm R/L, omega_r = omega/omega_nl, u in [-1, 1]  ->  i_avg/i_s; and back.
// Source: [T] (4.27)-(4.36), rewritten with log1p/expm1 so that every edge (T_r -> 0 and infinity,
// omega_r -> +-1, i -> 0) keeps full precision. |omega_r| > 1 is outside the model and clamped.
// RT-safe: bounded iterations, no allocation.
#pragma once

namespace equipoise {

/// i_avg/i_s for command u. [T] (4.28)-(4.30).
double drive_coast_mean_current(double T_r, double omega_r, double u) noexcept;

/// The same for a command that is held while the speed changes: what depends on the command alone, computed
/// once.
class DriveCoastCommand {
 public:
  DriveCoastCommand() = default;
  DriveCoastCommand(double T_r, double u) noexcept;
  double mean_current(double omega_r) const noexcept;
  /// With diodes that drop V_d: `opposing` (V + 2 V_d) / V instead of 1. From [T] (4.1), (4.5).
  double mean_current(double omega_r, double opposing) const noexcept;

 private:
  double T_r_ = 0.0;
  double sign_ = 1.0;
  double v_ = 0.0;
  double drained_ = 0.0;     // 1 - exp(-v T_r)
  double off_decay_ = 0.0;   // 1 - exp(-(1 - v) T_r)
  double full_decay_ = 0.0;  // 1 - exp(-T_r)
};

struct DriveCoastSolution {
  double u = 0.0;         // command, -1 .. 1
  int iterations = 0;     // of the scalar solver, at most kDriveCoastMaxIterations
  bool reachable = true;  // false: the target needs |u| > 1, u is clamped to +-1
};
inline constexpr int kDriveCoastMaxIterations = 4;

/// The command whose mean current is `i_over_is`, [T] section 4.4; for one motor, whose T_r does not change.
class DriveCoastInverse {
 public:
  explicit DriveCoastInverse(double T_r) noexcept;
  DriveCoastSolution solve(double omega_r, double i_over_is) const noexcept;

 private:
  double T_r_;
  double full_decay_;  // 1 - exp(-T_r)
};
DriveCoastSolution drive_coast_invert(double T_r, double omega_r, double i_over_is) noexcept;

}  // namespace equipoise
