// A robot on a soft stand, for practising calibration and bring-up: wheels turn freely, the body rocks on a
// spring and kicks back, a hand may put it into other poses, and it may be wired wrongly.
// In: motor command per tick -> out: raw samples. Simulation only;
// allocates nothing after construction; same seed, same bytes.
#pragma once

#include "equipoise/plant/ticked_world.hpp"

namespace equipoise {

/// How the robot at hand differs from its board file.
struct Miswiring {
  std::array<int, kMaxMotors> wheel_of_motor{0, 1, 2, 3};
  std::array<int, kMaxMotors> wheel_of_encoder{0, 1, 2, 3};
  std::array<double, kMaxMotors> motor_sign{1, 1, 1, 1};  // 0: dead
  std::array<double, kMaxMotors> encoder_sign{1, 1, 1, 1};
};

struct StandParams {
  int wheels = 3;
  std::array<Vec3, kMaxMotors> axis_B{};  // of growing wheel angle
  Vec3 body_inertia_kg_m2 = Vec3::Ones();
  double wheel_inertia_kg_m2 = 2e-6;
  double coulomb_N_m = 0.02;  // a motor starts at about a tenth of full duty
  double viscous_N_m_s = 1e-4;
  double rocking_hz = 1.0;  // of the body on its stand
  double damping_ratio = 0.3;
  Vec3 accel_scale_error = Vec3::Zero();  // of the chip, beside what the calibration knows
  Miswiring wiring;
};

class StandWorld : public SimulatedDevices {
 public:
  StandWorld(const StandParams& stand, const MotorParameters& motor, const Calibration& calibration,
             const WorldParams& world);

  void advance(const MotorCommand& command) override;
  RawSample sense() override;
  double time_s() const noexcept override { return time_s_; }

  /// A hand: body to world.
  void put(const Mat3& R_WB) noexcept { R_WB_ = R_WB; }
  /// A hand turns a wheel, motors off.
  void turn(int wheel, double angle_rad) noexcept { angle_[static_cast<std::size_t>(wheel)] += angle_rad; }
  void shake_by_hand(const Vec3& rate_B_rad_s) noexcept { hand_rate_B_ = rate_B_rad_s; }

  double wheel_rate_rad_s(int wheel) const noexcept { return rate_[static_cast<std::size_t>(wheel)]; }

 private:
  StandParams stand_;
  Calibration calibration_;
  WorldParams world_;
  SimulatedMotors<kMaxMotors> motors_;
  NoiseStream start_noise_;
  SimulatedSensors sensors_;
  Mat3 R_WB_ = Mat3::Identity();
  Vec3 rocking_rad_ = Vec3::Zero();
  Vec3 omega_B_ = Vec3::Zero();
  Vec3 hand_rate_B_ = Vec3::Zero();
  std::array<double, kMaxMotors> angle_{}, rate_{};
  double time_s_ = 0.0;
};

}  // namespace equipoise
