// Motor dynamometer: switched motor with a flywheel, battery, encoder, current sensor, command sequence.
// In: bench description, seed -> out: samples as a data logger has them. Source: [T] section 4.5.1, Tables
// 4.2-4.3. Simulation only; same seed, same samples.
#pragma once

#include <array>
#include <vector>

#include "equipoise/plant/noise.hpp"
#include "equipoise/plant/switched_motor.hpp"

namespace equipoise {

struct BenchMotor {
  const char* name;
  double resistance_ohm;
  double inductance_H;
  double torque_constant_N_m_A;
  double coulomb_N_m;
  double viscous_N_m_s;
};
/// Electrical values: [T] Table 4.3. Friction: not printed; two good gear motors and a toy's.
inline constexpr std::array<BenchMotor, 3> kBenchMotors{{
    {"A-Max 22, 14:1", 6.49, 0.362e-3, 0.133, 0.004, 2e-5},
    {"273688, 13 mm, 17:1", 15.4, 0.0494e-3, 0.161, 0.004, 2e-5},
    {"eduMIP, 6.6:1", 9.06, 2.36e-3, 0.127, 0.010, 5e-5},
}};

struct BenchDriver {
  const char* name;
  double diode_drop_V;
  double switch_resistance_ohm;
  double on_time_shift_s;
};
/// Typical of the parts' classes: body diodes, on-resistance of two switches, delay mismatch.
inline constexpr std::array<BenchDriver, 3> kBenchDrivers{{
    {"DRV8871", 0.8, 0.565, 0.10e-6},
    {"DRV8881P", 0.8, 0.66, -0.15e-6},
    {"MC33926", 0.7, 0.225, 0.40e-6},
}};
inline constexpr std::array<double, 5> kBenchPwm_hz{500.0, 1e3, 5e3, 10e3, 20e3};

struct BenchParams {
  SwitchedMotorParams motor;
  double battery_V = 8.0;
  double battery_resistance_ohm = 0.15;
  double encoder_counts_per_rev = 1000.0;  // E6-2500-250: 250 slits x 4
  double sensor_window_s = 4.26e-3;        // INA219, 12 bit, mean of 8 conversions
  double sensor_lsb_A = 1e-4;              // 10 uV over 0.1 ohm
  double sensor_sigma_A = 1e-3;
  double supply_sigma_V = 4e-3;  // INA219: one count of its bus voltage
  double sample_hz = 200.0;
  std::uint64_t seed = 1;
};

/// One row of the bench's log: mean values over the sample that ends at `t_s`; the angle at its end.
struct BenchSample {
  double t_s = 0.0;
  double u = 0.0;
  double current_A = 0.0;
  double supply_V = 0.0;
  double angle_rad = 0.0;
};

/// Sine chirp (0.5 - 2 - 0.5 Hz), the same with a ramping amplitude, random walk: u per sample.
std::vector<double> bench_sequence(double sample_hz, std::uint64_t seed);

std::vector<BenchSample> run_bench(const BenchParams& p, const std::vector<double>& u);

/// A step from rest to full command with the shaft locked, sampled as an oscilloscope does.
std::vector<BenchSample> run_locked_step(const BenchParams& p, double sample_hz, std::size_t samples);

struct BenchFit {
  double r_squared = 0.0;
  double rmse_over_stall = 0.0;
};
enum class CurrentModel { kDriveCoast, kLinear };

/// Model current per sample from the logged command, supply and angle. [T] (4.27)-(4.30), (4.37)
std::vector<double> predict_current(const SwitchedMotorParams& m, const std::vector<BenchSample>& log,
                                    CurrentModel model);
BenchFit fit(const SwitchedMotorParams& m, const std::vector<BenchSample>& log,
             const std::vector<double>& predicted);

/// The m-th motor behind the d-th driver.
SwitchedMotorParams bench_motor(std::size_t motor, std::size_t driver, double pwm_hz);

}  // namespace equipoise
