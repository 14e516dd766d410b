// The MBBR's drive as built: three uneven motors, gears with play, double-row wheels that hold the ball with
// one row at a time and carry only so much. In: motors, rates at the start of a step -> out: torque on the
// ball, loads and limits of the contacts, and what the encoders see. With everything off: T_ob and nothing
// else. Source: [T] (2.1), (2.2), sections 2.3.1, 5.3, 6.4; magnitudes: docs/disturbances.md. Simulation
// only; deterministic, no allocation.
#pragma once

#include <array>

#include "equipoise/plant/gear_play.hpp"
#include "equipoise/plant/motors.hpp"
#include "equipoise/plant/sensors.hpp"
#include "robots/mbbr/mbbr.hpp"
#include "robots/mbbr/slipping.hpp"

namespace equipoise {

struct MbbrDriveParams {
  Vec3 wheel_torque_scale = Vec3::Ones();  // torque of each motor over nominal
  GearPlayParams gear;
  double roller_tilt_rad = 0.0;         // of a wheel's torque axis, towards either row; (2.1)
  double rollers_per_turn = 12.0;       // of each row
  double roller_slip_N_m = 0.0;         // micro-slip: torque ripple of a wheel as rollers pass
  double wheel_grip = 0.0;              // friction coefficient at the ball; 0: wheels never slip
  double gearbox_friction_share = 0.0;  // of the drive's friction that sits before the contact
  Vec2 com_offset_rad = Vec2::Zero();   // the wheels hang this far over
};

/// Contact normals of the wheels, columns, body axes.
Mat3 wheel_contacts(const MbbrParameters& robot) noexcept;

/// Which row of each wheel carries it: +1 or -1.
Vec3 roller_rows(double rollers_per_turn, const Vec3& wheel_angle_rad) noexcept;

double grip_limit_N_m(double wheel_grip, const MbbrParameters& robot) noexcept;

class MbbrDrive {
 public:
  using Motors = SimulatedMotors<Mbbr::kWheels>;

  MbbrDrive(const MbbrParameters& robot, const MbbrDriveParams& p);

  /// Rows and gears are held over a step.
  void begin_step(const Motors& motors, const Vec3& relative_rate_B, const Vec3& wheel_angle_rad,
                  double step_s) noexcept;

  /// Of each motor at its wheel, before friction.
  Vec3 wheel_torques(const Motors& motors, const Vec3& relative_rate_B) const noexcept;
  /// On the ball, body axes, while the contacts hold: motors, gears, and the friction beyond the contacts.
  Vec3 torque_B(const Vec3& wheel_torque, const Vec3& friction_B) const noexcept;
  /// Of these torques at the contacts, on the ball, body axes.
  Vec3 on_ball_B(const Vec3& contact_torques) const noexcept { return ratio_ * (tilted_ * contact_torques); }
  /// Do the contacts carry that? The motors also turn their rotors.
  bool carries(const Vec3& wheel_torque, const Vec3& friction_B,
               const Vec3& relative_acceleration_B) const noexcept;
  /// The rotors over a step, at these rates; Coulomb friction about an axis, `viscous` in N m s.
  MbbrRotors rotors(const Motors& motors, const Vec3& rates_rad_s, double coulomb_N_m,
                    const Stiction& stiction, double viscous, double step_s) const noexcept;
  /// Of the friction beyond the contacts.
  double share_beyond() const noexcept { return slips() ? 1.0 - p_.gearbox_friction_share : 1.0; }
  /// Loads on the contacts from now on; `body_force_B`: mass times specific force of the body, less pushes.
  void carry(const Vec3& body_force_B, const Vec3& contact_torques) noexcept;
  /// The wheels on the ball were ahead of it by this much, over a step.
  void slip_by(const Vec3& angle_rad) noexcept { slip_rad_ += angle_rad; }
  Vec3 wheel_rates(const Vec3& relative_rate_B) const noexcept;
  /// Motor less the friction before it.
  Vec3 contact_torques(const Vec3& wheel_torque, const Vec3& friction_B) const noexcept;
  const Vec3& grip_N_m() const noexcept { return grip_N_m_; }
  bool slips() const noexcept { return p_.wheel_grip != 0.0; }
  /// Rate of the ball as the wheels' nominal axes report it.
  Vec3 seen_rate_B(const Vec3& relative_rate_B) const noexcept;
  /// What play and slip add to the motors' angles.
  Vec3 encoder_offset_rad() const noexcept;

 private:
  bool tilts() const noexcept { return p_.roller_tilt_rad != 0.0 || !p_.com_offset_rad.isZero(0.0); }
  MbbrDriveParams p_;
  MbbrKinematics kinematics_;
  double ratio_;
  double wheel_radius_m_;
  double rotor_inertia_kg_m2_;  // of motor, gear and wheel, at the wheel
  double gear_share_;           // of an axis' friction in each gear, at the wheel
  Vec3 grip_N_m_;               // of each wheel under its load
  Mat3 hung_;                   // chassis to body axes, whose z points at the mass centre
  Mat3 contacts_;               // normals, columns
  Mat3 pushes_;                 // directions in which the wheels push the ball, columns
  Mat3 loads_from_force_;
  Mat3 middle_;  // of the axes of both rows, columns
  Mat3 to_row_;  // from there to the outer row's
  Mat3 tilted_;  // axes of the rows that carry now, columns
  Vec3 engaged_ = Vec3::Ones();
  Vec3 ripple_N_m_ = Vec3::Zero();
  Vec3 slip_rad_ = Vec3::Zero();
  std::array<GearPlay, Mbbr::kWheels> gears_;
};

}  // namespace equipoise
