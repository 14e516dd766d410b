// The control loop as it runs: linear plant behind the delays of the chain, production estimator, reference
// and feedback in front of it. The production side is measured, not modelled: settled at a steady spin, it
// gets a small impulse on one sensor at a time, and its answer is summed into a frequency response; so the
// margins hold for whatever filter is configured.
// In: plant, a settled controller -> out: loops broken at u, at the gyro, at the encoders. Start-up only.
#pragma once

#include <array>
#include <cmath>
#include <memory>
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

/// Production estimator, reference and feedback, settled at a steady spin.
class SettledController {
 public:
  SettledController() = default;
  SettledController& operator=(const SettledController&) = delete;
  virtual ~SettledController() = default;
  virtual std::unique_ptr<SettledController> copy() const = 0;
  /// Its u; `u_before`: what it is told that acts.
  virtual Complex step(const Readings& readings, Complex u_before) = 0;

 protected:
  SettledController(const SettledController&) = default;
};

Loop whole_loop(const Plant& plant, const SettledController& settled);

}  // namespace equipoise::app
