#include "equipoise/plant/motor_bench.hpp"

#include <algorithm>

namespace equipoise {
namespace {

constexpr double kPart_s = 20.0;
constexpr double kWalkStep_s = 0.1;
constexpr double kWalkStep_u = 0.3;  // [T] section 4.5.1

enum Effect : std::uint64_t { kWalk = 101, kCurrent, kSupply };

/// Phase of a sine whose frequency goes 0.5 - 2 - 0.5 Hz, linearly in time.
double chirp_phase(double t) {
  constexpr double low = 0.5;
  constexpr double high = 2.0;
  constexpr double half = 0.5 * kPart_s;
  const double slope = (high - low) / half;
  const double rising = std::min(t, half);
  double cycles = low * rising + 0.5 * slope * rising * rising;
  if (t > half) cycles += high * (t - half) - 0.5 * slope * (t - half) * (t - half);
  return 2.0 * kPi * cycles;
}

double quantised(double value, double step) { return step * std::floor(value / step + 0.5); }

}  // namespace

std::vector<double> bench_sequence(double sample_hz, std::uint64_t seed) {
  NoiseStream noise(seed, kWalk);
  const auto part = static_cast<std::size_t>(std::lround(kPart_s * sample_hz));
  const auto hold = static_cast<std::size_t>(std::max(1L, std::lround(kWalkStep_s * sample_hz)));
  std::vector<double> u;
  u.reserve(3 * part);
  for (std::size_t i = 0; i < part; ++i)
    u.push_back(std::sin(chirp_phase(static_cast<double>(i) / sample_hz)));
  for (std::size_t i = 0; i < part; ++i) {
    const double t = static_cast<double>(i) / sample_hz;
    const double amplitude = 1.0 - std::abs(2.0 * t / kPart_s - 1.0);
    u.push_back(amplitude * std::sin(chirp_phase(t)));
  }
  double walk = 0.0;
  for (std::size_t i = 0; i < part; ++i) {
    if (i % hold == 0) walk = std::clamp(walk + noise.uniform(-kWalkStep_u, kWalkStep_u), -1.0, 1.0);
    u.push_back(walk);
  }
  return u;
}

std::vector<BenchSample> run_bench(const BenchParams& p, const std::vector<double>& u) {
  NoiseStream current_noise(p.seed, kCurrent);
  NoiseStream supply_noise(p.seed, kSupply);
  SwitchedMotor motor(p.motor);
  const double period_s = 1.0 / p.motor.pwm_hz;
  const double sample_s = 1.0 / p.sample_hz;
  const double count_rad = 2.0 * kPi / p.encoder_counts_per_rev;
  double t = 0.0;
  double supply = p.battery_V;
  std::vector<BenchSample> log;
  log.reserve(u.size());
  for (std::size_t k = 0; k < u.size(); ++k) {
    const double end = static_cast<double>(k + 1) * sample_s;
    // The sensor's window is the end of the sample; windows and PWM periods are not synchronous.
    double window_from_s = t;
    double window_charge = motor.charge_C();
    double supply_sum = 0.0;
    double supply_time = 0.0;
    while (t + 0.5 * period_s < end) {
      if (t < end - p.sensor_window_s) {
        window_from_s = t + period_s;
        window_charge = motor.charge_C();
      }
      const double drawn = motor.supply_charge_C();
      const double charge_before = motor.charge_C();
      motor.period(u[k], supply);
      if (t < end - p.sensor_window_s) window_charge += motor.charge_C() - charge_before;
      supply_sum += supply * period_s;
      supply_time += period_s;
      supply = p.battery_V - p.battery_resistance_ohm * (motor.supply_charge_C() - drawn) / period_s;
      t += period_s;
    }
    const double mean = (motor.charge_C() - window_charge) / std::max(t - window_from_s, period_s);
    BenchSample s;
    s.t_s = end;
    s.u = u[k];
    s.current_A = quantised(mean + current_noise.gaussian(p.sensor_sigma_A), p.sensor_lsb_A);
    s.supply_V = supply_sum / supply_time + supply_noise.gaussian(p.supply_sigma_V);
    s.angle_rad = quantised(motor.angle_rad(), count_rad);
    log.push_back(s);
  }
  return log;
}

std::vector<BenchSample> run_locked_step(const BenchParams& p, double sample_hz, std::size_t samples) {
  NoiseStream current_noise(p.seed, kCurrent);
  SwitchedMotorParams m = p.motor;
  m.pwm_hz = sample_hz;  // full command does not switch: one period per sample
  SwitchedMotor motor(m);
  motor.hold_speed(0.0);
  std::vector<BenchSample> log;
  for (std::size_t k = 0; k < samples; ++k) {
    const double before = motor.charge_C();
    motor.period(1.0, p.battery_V);
    BenchSample s;
    s.t_s = static_cast<double>(k + 1) / sample_hz;
    s.u = 1.0;
    s.current_A = (motor.charge_C() - before) * sample_hz + current_noise.gaussian(p.sensor_sigma_A);
    s.supply_V = p.battery_V;
    log.push_back(s);
  }
  return log;
}

std::vector<double> predict_current(const SwitchedMotorParams& m, const std::vector<BenchSample>& log,
                                    CurrentModel model) {
  std::vector<double> predicted;
  predicted.reserve(log.size());
  BenchSample previous;
  const double T_r = m.resistance_ohm / (m.inductance_H * m.pwm_hz);
  for (const BenchSample& s : log) {
    const double omega = (s.angle_rad - previous.angle_rad) / (s.t_s - previous.t_s);
    const double omega_r = std::clamp(omega * m.torque_constant_N_m_A / s.supply_V, -1.0, 1.0);
    const double ratio =
        model == CurrentModel::kLinear ? s.u - omega_r : drive_coast_mean_current(T_r, omega_r, s.u);
    predicted.push_back(ratio * s.supply_V / m.resistance_ohm);
    previous = s;
  }
  return predicted;
}

BenchFit fit(const SwitchedMotorParams& m, const std::vector<BenchSample>& log,
             const std::vector<double>& predicted) {
  double mean = 0.0;
  double supply = 0.0;
  for (const BenchSample& s : log) {
    mean += s.current_A;
    supply += s.supply_V;
  }
  const auto n = static_cast<double>(log.size());
  mean /= n;
  supply /= n;
  double residual = 0.0;
  double total = 0.0;
  for (std::size_t i = 0; i < log.size(); ++i) {
    residual += (log[i].current_A - predicted[i]) * (log[i].current_A - predicted[i]);
    total += (log[i].current_A - mean) * (log[i].current_A - mean);
  }
  return {1.0 - residual / total, std::sqrt(residual / n) * m.resistance_ohm / supply};
}

SwitchedMotorParams bench_motor(std::size_t motor, std::size_t driver, double pwm_hz) {
  const BenchMotor& m = kBenchMotors.at(motor);
  const BenchDriver& d = kBenchDrivers.at(driver);
  SwitchedMotorParams p;
  p.resistance_ohm = m.resistance_ohm;
  p.inductance_H = m.inductance_H;
  p.torque_constant_N_m_A = m.torque_constant_N_m_A;
  p.coulomb_N_m = m.coulomb_N_m;
  p.viscous_N_m_s = m.viscous_N_m_s;
  p.pwm_hz = pwm_hz;
  p.diode_drop_V = d.diode_drop_V;
  p.switch_resistance_ohm = d.switch_resistance_ohm;
  p.on_time_shift_s = d.on_time_shift_s;
  return p;
}

}  // namespace equipoise
