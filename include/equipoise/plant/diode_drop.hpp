// Drive/coast mean current when the diodes that carry the current back drop a voltage.
// In: T_r, omega_r, u, diodes' opposition -> out: mean current over stall current. Source: [T] (4.1), (4.5)
// in periodic steady state, which (4.6)-(4.30) solve for V_d = 0. Simulation only; deterministic.
#pragma once

namespace equipoise {

/// `opposing`: (V + 2 V_d) / V; 1 gives drive_coast_mean_current.
double drive_coast_mean_current_with_drop(double T_r, double omega_r, double u, double opposing) noexcept;

}  // namespace equipoise
