// What the simulated worlds of all robots share: parameters of sensors, battery, attitude packets and pushes.
// Fidelity levels choose among them: `ideal` (rigid bodies, linear motors, perfect sensors), `thesis` (what
// [T] section 6.3 simulated: friction and the filters' own noise), `nominal` (a robot as its model says, with
// noise and drive/coast bridges), `full` (a robot as built: docs/disturbances.md), `built2025` (what `full`
// was before vibration, sills and slip). Simulation only.
#pragma once

#include <cmath>
#include <cstdint>
#include <vector>

#include "equipoise/imu_parts.h"
#include "equipoise/plant/coulomb.hpp"
#include "equipoise/plant/ground.hpp"
#include "equipoise/plant/vibration.hpp"
#include "equipoise/sense/calibrate.hpp"
#include "equipoise/types.hpp"

namespace equipoise {

enum class Fidelity { kIdeal, kThesis, kNominal, kFull, kBuilt2025 };
inline constexpr std::size_t kFidelities = 5;

/// How the robot at hand differs from its model: factors on the plant alone; the firmware keeps its numbers.
struct ActualScales {
  double body_mass = 1.0;
  double com_height = 1.0;
  double body_inertia = 1.0;
  double ball_mass = 1.0;  // and the ball's inertia with it; MBBR
  double ball_radius = 1.0;
  double wheel_radius = 1.0;
  double track = 1.0;     // distance of the two wheels; eduMIP
  double torque = 1.0;    // of every motor per unit of current
  double back_emf = 1.0;  // of every motor per rad/s
};

/// A force on the body's centre of mass, world axes.
struct Push {
  double at_s = 0.0;
  double duration_s = 0.05;
  Vec2 force_W_N = Vec2::Zero();
};

/// A push of this force in each interval, at a time and in a direction of its own; none in the first.
struct RandomPushes {
  double every_s = 0.0;  // 0: none
  double duration_s = 0.05;
  double force_N = 0.0;
};

struct WorldParams {
  std::uint64_t seed = 1;
  double step_s = 1e-3;  // RK4 step; five per tick

  double initial_tilt_rad = 0.02;  // sigma about each axis, and of the heading
  bool friction = true;

  double gyro_sigma_rad_s = 0.0;
  double accel_sigma_m_s2 = 0.0;
  double gyro_bias_sigma_rad_s = 0.0;  // constant over a run
  double accel_bias_sigma_m_s2 = 0.0;
  double encoder_sigma_rad = 0.0;  // of the wheel angle
  bool quantise = false;           // encoders, IMU, ADC in whole counts; IMU range clipped

  VibrationParams vibration;  // beside the chip's own noise

  double battery_V = 8.0;
  double battery_resistance_ohm = 0.0;

  /// Attitude packets (DMP): truth, late, with a slowly wandering error and a drifting heading.
  double attitude_sigma_rad = 0.0;
  double attitude_time_constant_s = 3.0;
  double attitude_heading_drift_rad_sqrt_s = 0.0;
  int attitude_latency_ticks = 0;

  std::vector<Push> pushes;
  RandomPushes random_pushes;
  FloorParams floor;

  /// What a robot has and its model leaves out; the defaults: nothing.
  Stiction stiction;
  Vec2 friction_scale = Vec2::Ones();  // of Coulomb friction: at the start, and where it goes
  double friction_time_s = 20.0;       // with this time constant
  double diode_drop_V = 0.0;       // V_d of each of the two diodes that carry the current back; drive/coast
  double bridge_on_delay_s = 0.0;  // of the bridges' outputs: what they lose of each period is the difference
  double bridge_off_delay_s = 0.0;
  int actuation_latency_steps = 0;     // until the bridges follow
  double actuation_delay_ticks = 0.0;  // beside the latency: where in the tick the PWM takes the new duty
  int sensor_latency_ticks = 0;        // of a whole sample
  /// Age of each sensor within its sample: the IMU's low pass by its setting (0: none), and sampling
  /// instants.
  int imu_part = 0;  // of equipoise/imu_parts.h
  int imu_low_pass = 0;
  double imu_delay_scale = 1.0;  // of the setting's delays
  double imu_sample_age_s = 0.0;
  double encoder_sample_age_s = 0.0;
  Vec3 imu_misalignment_rad = Vec3::Zero();  // rotation vector, body axes: mount against calibration
  Vec2 com_offset_rad = Vec2::Zero();    // mass centre off the chassis' axis: the chassis hangs this far over
  Vec3 gyro_scale_error = Vec3::Zero();  // of each sensor axis
  Vec3 accel_scale_error = Vec3::Zero();   // the same
  Vec3 gyro_drift_rad_s = Vec3::Zero();    // bias that warming up adds in the end
  double warm_up_s = 60.0;                 // its time constant
  Vec3 gyro_drift_rad_s_K = Vec3::Zero();  // bias per kelvin above the calibration's temperature
  double warm_K = 0.0;                     // that much at the start
  double warm_up_K = 0.0;                  // that much more in the end
  double missed_tick_share = 0.0;          // of the loop's ticks
  double imu_repeat_share = 0.0;           // of the ticks: the IMU's clock is slower than the loop's
  Vec2 floor_slope_rad = Vec2::Zero();     // rise towards world x, y
  double rolling_resistance = 0.0;         // of the weight
  ActualScales actual;

  /// A sensor reports the past.
  bool aged() const noexcept {
    return imu_repeat_share > 0.0 || gyro_age_s() > 0.0 || accel_age_s() > 0.0 || encoder_sample_age_s > 0.0;
  }
  double gyro_age_s() const noexcept { return imu_sample_age_s + imu_delay_scale * gyro_delay_s(); }
  double accel_age_s() const noexcept {
    return imu_sample_age_s +
           (imu_low_pass > 0 ? imu_delay_scale * ::imu_low_pass(imu_part, imu_low_pass)->accel_delay_s : 0.0);
  }
  /// By the data sheet.
  double gyro_delay_s() const noexcept {
    return imu_low_pass > 0 ? ::imu_low_pass(imu_part, imu_low_pass)->gyro_delay_s : 0.0;
  }
  /// Coulomb friction over the configured one.
  double friction_now(double time_s) const noexcept {
    if (friction_scale.x() == friction_scale.y()) return friction_scale.x();
    return friction_scale.y() +
           (friction_scale.x() - friction_scale.y()) * std::exp(-time_s / friction_time_s);
  }
  /// When in a tick the bridges take their command, in steps.
  double actuation_steps() const noexcept {
    return actuation_latency_steps + actuation_delay_ticks * (kTickS / step_s);
  }
};

}  // namespace equipoise
