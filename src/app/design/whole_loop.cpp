#include "app/design/whole_loop.hpp"

#include <Eigen/LU>
#include <algorithm>

namespace equipoise::app {
namespace {

/// When a sensor looked: so many ticks back, and `to_sample` after that tick.
struct Moment {
  Moment(const Plant& plant, const SensorRow& sensor) {
    const double ticks = std::ceil(sensor.delay_s / kTickS - 1e-9);
    const double after = std::max(0.0, ticks * kTickS - sensor.delay_s);
    ticks_back = static_cast<std::size_t>(ticks);
    old_input = after <= plant.actuation_delay_s;
    to_sample = sampled(plant.A, plant.b, after, std::min(after, plant.actuation_delay_s));
  }
  std::size_t ticks_back;
  bool old_input;  // the torque of that moment is still that of the tick before
  SampledSystem to_sample;
};

std::vector<Moment> moments(const Plant& plant) {
  std::vector<Moment> out;
  out.reserve(plant.sensors.size());
  for (const SensorRow& sensor : plant.sensors) out.emplace_back(plant, sensor);
  return out;
}

/// Runs beside a twin that gets no disturbance; its answer is the difference.
class AboutSteadySpin {
 public:
  explicit AboutSteadySpin(const SettledController& settled)
      : disturbed_(settled.copy()), steady_(settled.copy()) {}
  Complex step(const Readings& readings, Complex u_before) {
    return disturbed_->step(readings, u_before) - steady_->step({}, {});
  }

 private:
  std::unique_ptr<SettledController> disturbed_, steady_;
};

/// Answer of each sensor to u, tick to tick.
std::array<std::vector<Complex>, kSensors> sensor_responses(const Plant& plant,
                                                            const std::vector<double>& omega_rad_s) {
  const Eigen::Index n = plant.A.rows();
  const SampledSystem step = sampled(plant.A, plant.b, kTickS, plant.actuation_delay_s);
  std::array<std::vector<Complex>, kSensors> out;
  const std::vector<Moment> looked = moments(plant);
  for (const double w : omega_rad_s) {
    const Complex z = std::polar(1.0, w * kTickS);
    const Complex back = 1.0 / z;
    const CMatrix x =
        (z * CMatrix::Identity(n, n) - step.A).partialPivLu().solve(step.B + step.B_late * back);
    for (std::size_t c = 0; c < kSensors; ++c) {
      const SampledSystem& s = looked[c].to_sample;
      const CMatrix x_then = s.A * x + s.B + s.B_late * back;
      const Complex y = (plant.sensors[c].C * x_then)(0, 0) +
                        plant.sensors[c].D * (looked[c].old_input ? back : Complex(1.0));
      out[c].push_back(y * std::pow(back, static_cast<double>(looked[c].ticks_back)));
    }
  }
  return out;
}

/// Ticks of the closed loop from a small tilt: u of the difference to the steady spin -> does it come back?
class ClosedLoop {
 public:
  explicit ClosedLoop(const Plant& plant)
      : plant_(plant),
        step_(sampled(plant.A, plant.b, kTickS, plant.actuation_delay_s)),
        looked_(moments(plant)),
        x_(Eigen::VectorXcd::Zero(plant.A.rows())) {
    for (Moment& each : looked_) each.ticks_back = std::min(each.ticks_back, kHistory - 1);
    x_before_.fill(x_);
    x_(plant.tilt) = 1e-4;
    x_before_[0] = x_;
    read();
  }
  const Readings& readings() const { return readings_; }
  void apply(Complex u) {
    std::copy_backward(u_before_.begin(), u_before_.end() - 1, u_before_.end());
    u_before_[0] = u;
    x_ = step_.A * x_ + step_.B.col(0) * u + step_.B_late.col(0) * u_before_[1];
    std::rotate(x_before_.rbegin(), x_before_.rbegin() + 1, x_before_.rend());
    x_before_[0] = x_;
    read();
  }
  double tilt() const { return std::abs(x_(plant_.tilt)); }

 private:
  static constexpr std::size_t kHistory = 8;

  /// At tick k, before its u: u_before_[0] is that of tick k - 1.
  void read() {
    for (std::size_t c = 0; c < kSensors; ++c) {
      const std::size_t j = looked_[c].ticks_back;
      const SampledSystem& s = looked_[c].to_sample;
      const Complex u_new = j > 0 ? u_before_[j - 1] : Complex{};  // of tick k - j
      const Complex u_old = u_before_[j];
      const Eigen::VectorXcd x = s.A * x_before_[j] + s.B.col(0) * u_new + s.B_late.col(0) * u_old;
      readings_[c] =
          (plant_.sensors[c].C * x)(0) + plant_.sensors[c].D * (looked_[c].old_input ? u_old : u_new);
    }
  }

  const Plant& plant_;
  SampledSystem step_;
  std::vector<Moment> looked_;
  std::array<Eigen::VectorXcd, kHistory> x_before_;  // newest first
  std::array<Complex, kHistory + 1> u_before_{};
  Eigen::VectorXcd x_;
  Readings readings_{};
};

}  // namespace

Loop whole_loop(const Plant& plant, const SettledController& settled) {
  constexpr double kImpulse = 1e-5;
  constexpr int kTicks = 1600;  // 8 s: what is left then drifts with the integrated position
  Loop loop;
  loop.omega_rad_s = frequency_grid(kTickS, 300, plant.centre_rad_s());
  const std::size_t points = loop.omega_rad_s.size();

  const auto answer = [&](std::size_t channel) {
    AboutSteadySpin controller(settled);
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
  std::array<std::vector<Complex>, kSensors> controller_responses;
  for (std::size_t c = 0; c < kSensors; ++c) controller_responses[c] = answer(c);
  const std::vector<Complex> told_response = answer(kSensors);  // to the input the filter is told of
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
    const Complex rest = 1.0 - told_response[i] * back;
    loop.at_u.push_back(-all / rest);
    loop.at_gyro.push_back(-through[kGyro] / (rest - (all - through[kGyro])));
    loop.at_encoder.push_back(-through[kEncoder] / (rest - (all - through[kEncoder])));
  }

  constexpr int kStart = 4000;  // 20 s: large robots are slow
  ClosedLoop closed(plant);
  AboutSteadySpin controller(settled);
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
