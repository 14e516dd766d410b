// Which motor turns which wheel, which encoder counts it, and which way, by tiny pulses on the stand.
// In: manual, how the wheels sit in the body -> out: one finding per motor of the board file, and the wiring
// that follows from them. Bounded: at most 0.35 of the stall torque, 0.6 s and half a turn per try; motors
// off afterwards. The body must be free to rock a little (hung up, or on soft foam): then it kicks back when
// a wheel spins up, and the gyro tells which wheel it was and which way it turned.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "app/board/board.hpp"
#include "app/commission/manual_drive.hpp"
#include "equipoise/actuate/bridge.hpp"
#include "equipoise/sense/calibrate.hpp"
#include "robots/mbbr/mbbr.hpp"
#include "robots/mip/mip.hpp"

namespace equipoise::app {

struct WheelLayout {
  int wheels = 0;
  /// Axis about which a wheel turns when its angle grows, body axes.
  std::array<Vec3, kMaxMotors> axis_B{};
  std::array<const char*, kMaxMotors> place{};  // of a wheel, in words; null: nothing to say
  Vec3 body_inertia_kg_m2 = Vec3::Ones();
  double counts_per_rev = 0.0;
  MotorParameters motor;
  /// Wheels on one axle kick alike: only eyes can tell them apart.
  bool told_apart_by_gyro() const;
  /// "wheel 1 (right)".
  std::string name(int wheel) const;
};

/// A wheel rolls on the ball and so turns against it; T_ob is about the ball.
WheelLayout layout_of(const MbbrParameters& robot, const MotorParameters& motor,
                      const Calibration& calibration);
WheelLayout layout_of(const MipParameters& robot, const MotorParameters& motor,
                      const Calibration& calibration);

struct WheelFinding {
  int motor = 0;                        // of the board file, from 0
  double drive = 0.0;                   // that moved it, of the stall torque
  int encoder = -1;                     // that counted
  bool counts_down = false;             // under positive duty
  double kick_sigmas = 0.0;             // how clearly the gyro felt it
  std::optional<bool> turns_backwards;  // against the model; unknown where the kick is too weak
  std::optional<int> wheel;             // that it turns, from 0
  std::optional<Vec3> axis_B;           // about which its wheel turned under positive duty; the gyro was sure
};

/// JobError when nothing moves, several wheels move, or the robot does.
WheelFinding pulse(ManualDrive& manual, const WheelLayout& layout, const Calibration& calibration, int motor);

/// Of every motor; where the gyro leaves a question, the person answers it. JobError also when the axes that
/// it felt are turned about the vertical against the configured ones: no board file can mend that.
std::vector<WheelFinding> pulse_all(ManualDrive& manual, const WheelLayout& layout,
                                    const Calibration& calibration);

/// In words, one line per motor.
std::string describe(const WheelFinding& finding);
/// What is wired otherwise than the board file says; empty: nothing. Needs settled findings.
std::string complaint(const std::vector<WheelFinding>& findings);

struct EncoderFinding {
  int encoder = -1;
  double counts_per_rev = 0.0;  // signed: negative where forwards counts down
};

/// By hand, motors off: the person turns wheel `wheel` forwards by `turns` whole turns.
EncoderFinding turn_by_hand(ManualDrive& manual, const WheelLayout& layout, int wheel, int turns);

}  // namespace equipoise::app
