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
