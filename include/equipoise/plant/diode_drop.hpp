// Drive/coast mean current when the diodes that carry the current back drop a voltage.
// In: T_r, u; omega_r, diodes' opposition -> out: mean current over stall current. Source: [T] (4.1), (4.5)
// in periodic steady state, which (4.6)-(4.30) solve for V_d = 0. Simulation only; deterministic.
#pragma once

namespace equipoise {

/// A duty that is held: the integrator asks at many speeds per command.
class DriveCoastDropCommand {
 public:
  DriveCoastDropCommand() = default;
  DriveCoastDropCommand(double T_r, double u) noexcept;
  /// `opposing`: (V + 2 V_d) / V; 1 gives drive_coast_mean_current.
  double mean_current(double omega_r, double opposing) const noexcept;

 private:
  double T_r_ = 0.0;
  double sign_ = 1.0;
  double v_ = 0.0;
  double drained_ = 0.0;  // 1 - exp(-v T_r)
};

}  // namespace equipoise
