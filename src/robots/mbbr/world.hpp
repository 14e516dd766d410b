// The MBBR's simulated world: exact rolling dynamics in RK4, three motors behind their bridges, friction,
// sensors. In: motor command per tick -> out: raw samples, and the truth. A hand holds the body until the
// motors are first enabled. Coulomb friction is a torque held over each step: the one that stops the axis, at
// most mu_c. Simulation only; allocates nothing after construction; same seed, same bytes.
#pragma once

#include "equipoise/plant/engine.hpp"
#include "equipoise/plant/ticked_world.hpp"
#include "robots/mbbr/instant.hpp"
#include "robots/mbbr/slipping.hpp"

namespace equipoise {

struct MbbrWorldParams {
  WorldParams common;
  MbbrDriveParams drive;
  MbbrFloorParams floor;
  double coulomb_scale = 1.0;        // of the identified friction
  double extra_viscous_N_m_s = 0.0;  // support balls, rollers
  Vec2 yaw_friction_scale{1.0,
                          1.0};  // Coulomb about z for positive and negative spin of the ball in the body
  Vec<10> process_noise_sigma = Vec<10>::Zero();  // per tick: theta x y z, phi x y, and their rates
};

/// The robot as it is built, where the firmware has `nominal`.
MbbrParameters as_built(MbbrParameters nominal, const ActualScales& actual) noexcept;

/// The bodies of ball and robot: wheels that may slip turn by themselves.
MbbrParameters without_loose_wheels(MbbrParameters built, const MbbrDriveParams& drive) noexcept;

/// Largest friction torque about each body axis at these relative rates.
Vec3 friction_limit_N_m(const MbbrWorldParams& world, double mu_c, const Vec3& relative_rate_B) noexcept;

class MbbrWorld : public TickedWorld<Mbbr::kWheels> {
 public:
  MbbrWorld(const MbbrParameters& robot, const MotorParameters& motor, const Calibration& calibration,
            const MbbrWorldParams& world);

  RawSample sense() override;
  void without_attitude() noexcept { sensors_.without_attitude(); }

  MbbrEstimate truth() const noexcept;
  const MbbrParameters& robot() const noexcept { return robot_; }  // as built
  bool slipping() const noexcept { return slipping_; }  // the ball on the floor, or a wheel on the ball
  Vec3 wheel_slip_rad_s() const noexcept;               // wheels ahead of the ball

 private:
  using State = MbbrState;
  using Here = MbbrHere;
  using Instant = MbbrInstant;
  double viscous_N_m_s() const noexcept;
  Here near(const State& s) const noexcept;  // within a step from here
  /// Of an instant whose motion is known: forces, and accelerations of a ball that rolls.
  void push_and_pull(Instant* now, const Vec2& push_W) const noexcept;
  void rolling(Instant* now, const Vec2& push_W, const Vec3& friction_B) const noexcept;
  State slip_derivative(const State& s, const Here& now, const MbbrSlipAccelerations& a) const noexcept;
  Vec3 friction_limit_B(const Instant& now) const noexcept;
  Vec3 coulomb_torque_B(const Instant& free) const noexcept;
  bool contacts_hold(const Instant& now, const Vec3& friction_B) const noexcept;
  MbbrFriction slip_friction(const Vec2& push_W, double h) const noexcept;
  void slip_forces(Instant* now, const Vec2& push_W, const MbbrFriction& friction) const noexcept;
  MbbrSlipAccelerations slip_accelerations(const Here& here, const Vec2& push_W) const noexcept;
  Vec2 pull_star(const Instant& now) const noexcept;
  MbbrFloorForce needed(const Instant& now, const MbbrAccelerations& a) const noexcept;
  Vec2 push_now() const noexcept { return push_force_W(common_, time_s_); }
  Felt felt(const MbbrMotion& m, const MbbrAccelerations& a) const noexcept;
  Felt felt_now() const noexcept;
  void step(double h) noexcept override;
  bool roll(const Vec2& push_W, double h) noexcept;
  void slip(const Vec2& push_W, double h) noexcept;
  void load_wheels(const Instant& now, const MbbrAccelerations& a, const Vec3& contact_torques) noexcept;
  void disturb();
  void end_tick() noexcept override;
  void arrive(const State& s) noexcept;

  MbbrParameters robot_;
  MbbrWorldParams world_;
  MbbrKinematics kinematics_;
  MbbrDynamics dynamics_;
  Vec3 mobility_;
  MbbrDrive drive_;
  MbbrSlipping floor_;
  MbbrSlipping loose_;  // without wheels that may slip: bodies of their own
  Ground ground_;
  State s_;
  Here here_;  // at s_
  SimulatedSensors sensors_;
  bool uneven_;
  bool limited_;  // a contact may give way
  bool slipping_ = false;
  MbbrFriction friction_;            // of the last step
  Vec3 rotor_rad_s_ = Vec3::Zero();  // while anything slips
};

/// In another engine: our motors, gears, rollers, friction and sensors, its rigid bodies and contacts. The
/// engine's joint is the ball against the body, body axes.
class MbbrEngineWorld {
 public:
  MbbrEngineWorld(const MbbrParameters& robot, const MotorParameters& motor, const Calibration& calibration,
                  const MbbrWorldParams& world, Engine& engine);

  void advance(const MotorCommand& command);
  RawSample sense() { return body_.sense(encoders(), motors_.battery_V()); }
  void without_attitude() noexcept { body_.without_attitude(); }
  MbbrEstimate truth() const noexcept;
  double time_s() const noexcept { return body_.time_s(); }

 private:
  void step();
  Vec3 body_force_B() const noexcept;
  Vec3 torque_B(const Vec3& relative_rate_B, const Vec3& others, double h) noexcept;
  Vec<kMaxMotors> encoders() const noexcept;

  MbbrParameters robot_;
  MbbrWorldParams world_;
  MbbrKinematics kinematics_;
  Vec3 mobility_;
  MbbrDrive::Motors motors_;
  MbbrDrive drive_;
  EngineBody body_;
  Vec3 seen_B_rad_ = Vec3::Zero();       // ball against body, as the wheels' nominal axes report it
  Vec3 omega_dot_B_ = Vec3::Zero();      // over the last step
  Vec3 rotor_rad_s_ = Vec3::Zero();      // where wheels may slip
  Vec3 others_B_rad_s2_ = Vec3::Zero();  // acceleration of the joint by all but our torque, a step ago
};

}  // namespace equipoise
