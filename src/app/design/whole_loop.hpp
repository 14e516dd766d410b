// The control loop as it runs: linear plant behind the delays of the chain, production estimator, reference
// and feedback in front of it. The production side is measured, not modelled: settled at a steady spin, it
// gets a small impulse on one sensor at a time, and its answer is summed into a frequency response; so the
// margins hold for whatever filter is configured.
// In: plant, a settled controller -> out: loops broken at u, at the gyro, at the encoders. Start-up only.
#pragma once

#include <array>
#include <cmath>
#include <vector>

#include "equipoise/control/chain.hpp"
#include "equipoise/control/margins.hpp"
#include "equipoise/control/riccati.hpp"
#include "equipoise/types.hpp"

namespace equipoise::app {

enum Channel : std::size_t { kGyro, kGyroAcross, kEncoder, kAccel, kAttitude, kSensors };
using Readings = std::array<Complex, kSensors>;  // of a complex robot x + i y

struct SensorRow {
  Eigen::RowVectorXcd C;
  Complex D{};
  double delay_s = 0.0;
};

/// x' = A x + b u, about a steady spin.
struct Plant {
  CMatrix A;
  CMatrix b;
  std::array<SensorRow, kSensors> sensors;
  double actuation_delay_s = 0.0;
  Complex drift{1.0};     // per tick: what an integral of position does by itself
  Eigen::Index tilt = 0;  // state that must not fall

  double centre_rad_s() const { return std::arg(drift) / kTickS; }
};

struct Loop {
  std::vector<double> omega_rad_s;
  std::vector<Complex> at_u, at_gyro, at_encoder;
  bool stable = false;  // the closed loop, in time
};

/// Answer of each sensor to u, tick to tick.
std::array<std::vector<Complex>, kSensors> sensor_responses(const Plant& plant,
                                                            const std::vector<double>& omega_rad_s);

/// Ticks of the closed loop from a small tilt: u of the difference to the steady spin -> does it come back?
class ClosedLoop {
 public:
  explicit ClosedLoop(const Plant& plant);
  const Readings& readings() const { return readings_; }
  void apply(Complex u);
  double tilt() const { return std::abs(x_(plant_.tilt)); }

 private:
  static constexpr std::size_t kHistory = 8;
  void read();
  const Plant& plant_;
  SampledSystem step_;
  std::array<SampledSystem, kSensors> to_sample_;
  std::array<std::size_t, kSensors> ticks_back_{};
  std::array<bool, kSensors> old_input_{};
  std::array<Eigen::VectorXcd, kHistory> x_before_;  // newest first
  std::array<Complex, kHistory + 1> u_before_{};
  Eigen::VectorXcd x_;
  Readings readings_{};
};

/// `Controller`: copyable, settled; Complex step(const Readings&, Complex u_before), its answer about the
/// steady spin.
template <class Controller>
Loop whole_loop(const Plant& plant, const Controller& settled) {
  constexpr double kImpulse = 1e-5;
  constexpr int kTicks = 1600;  // 8 s: what is left then drifts with the integrated position
  Loop loop;
  loop.omega_rad_s = frequency_grid(kTickS, 300, plant.centre_rad_s());
  const std::size_t points = loop.omega_rad_s.size();

  const auto answer = [&](std::size_t channel) {
    Controller controller = settled;
    std::vector<Complex> h(kTicks);
    for (int k = 0; k < kTicks; ++k) {
      Readings readings{};
      if (k == 0 && channel < kSensors) readings[channel] = kImpulse;
      h[static_cast<std::size_t>(k)] =
          controller.step(readings, k == 0 && channel == kSensors ? kImpulse : 0.0) / kImpulse;
    }
    std::vector<Complex> response(points);
    for (std::size_t i = 0; i < points; ++i) {
      const Complex back = std::polar(1.0, -loop.omega_rad_s[i] * kTickS);
      // Horner, from the drifting tail.
      Complex sum = h.back() / (1.0 - plant.drift * back);
      for (int k = kTicks - 2; k >= 0; --k) sum = h[static_cast<std::size_t>(k)] + back * sum;
      response[i] = sum;
    }
    return response;
  };
  std::array<std::vector<Complex>, kSensors + 1> controller_responses;
  for (std::size_t c = 0; c <= kSensors; ++c) controller_responses[c] = answer(c);
  const auto plant_responses = sensor_responses(plant, loop.omega_rad_s);

  for (std::size_t i = 0; i < points; ++i) {
    const Complex back = std::polar(1.0, -loop.omega_rad_s[i] * kTickS);
    std::array<Complex, kSensors> through{};
    Complex all{};
    for (std::size_t c = 0; c < kSensors; ++c) {
      through[c] = controller_responses[c][i] * plant_responses[c][i];
      all += through[c];
    }
    // The filter is told what was asked for.
    const Complex rest = 1.0 - controller_responses[kSensors][i] * back;
    loop.at_u.push_back(-all / rest);
    loop.at_gyro.push_back(-through[kGyro] / (rest - (all - through[kGyro])));
    loop.at_encoder.push_back(-through[kEncoder] / (rest - (all - through[kEncoder])));
  }

  constexpr int kStart = 4000;  // 20 s: large robots are slow
  ClosedLoop closed(plant);
  Controller controller = settled;
  Complex u{};
  double late_tilt = 0.0;
  const double first_tilt = closed.tilt();
  for (int k = 0; k < kStart && closed.tilt() < 1e3 * first_tilt; ++k) {
    u = controller.step(closed.readings(), u);
    closed.apply(u);
    if (k > kStart / 2) late_tilt = std::max(late_tilt, closed.tilt());
  }
  loop.stable = closed.tilt() < first_tilt && late_tilt < 0.2 * first_tilt;
  return loop;
}

}  // namespace equipoise::app
