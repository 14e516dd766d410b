// Two encoders that stand still while the robot moves. One that lies is found by the filters
// (wheel_isolation.hpp); without two they have nothing left to compare. Wheels of a sound robot stand still
// together, too: held by stiction for a second and more, while the body tips by less than 0.05 rad, or, once
// in 30000 s of sudden commands, by 0.08 rad as one piece with its rolling ball; or in a turn whose drive
// cancels it at both, with the third turning as the yaw rate wants. In: Measurement, the wheel that is not
// used any more -> out: bits of the wheels. RT-safe.
#pragma once

#include <array>
#include <cmath>

#include "equipoise/samples.hpp"

namespace equipoise {

template <int Wheels>
class DeadEncoders {
 public:
  /// How far the body turns about z for each wheel's turn, on a ball that does not spin on the floor.
  explicit DeadEncoders(const Vec<Wheels>& yaw_from_wheels) noexcept : yaw_from_wheels_(yaw_from_wheels) {}

  void reset() noexcept {
    known_ = false;
    for (Pair& pair : pairs_) pair = Pair{};
    dead_ = 0;
  }

  /// `lost`: found out already, and stands still for all we know; -1: none.
  void update(const Measurement<Wheels>& z, int lost) noexcept {
    if (!z.encoders_ok || z.ticks > 1) {
      known_ = false;
      return;
    }
    const Vec<Wheels> moved = z.wheel_angle_rad - angle_rad_;
    angle_rad_ = z.wheel_angle_rad;
    const bool known = known_;
    known_ = true;
    std::size_t at = 0;
    for (int a = 0; a < Wheels; ++a) {
      for (int b = a + 1; b < Wheels; ++b, ++at) {
        Pair& pair = pairs_[at];
        if (!known || moved(a) != 0.0 || moved(b) != 0.0) {
          if (pair.ticks > 0) pair = Pair{};
          continue;
        }
        for (std::size_t i = 0; i < 3 && z.imu_ok; ++i) {
          if (z.gyro_axis_ok[i]) pair.turned_rad[i] += kTickS * z.gyro_B_rad_s(static_cast<int>(i));
        }
        pair.wheels_yaw_rad += yaw_from_wheels_.dot(moved);
        pair.others_rad += moved.template lpNorm<1>();
        pair.gone_rad += moved.sum();
        ++pair.ticks;
        const bool one_alone = lost == a || lost == b;  // what the lost one did is not known
        const bool tips = std::hypot(pair.turned_rad[0], pair.turned_rad[1]) > kTips_rad;
        const bool yaws = one_alone ? std::abs(pair.turned_rad[2]) > kYawsForOne_rad
                                    : std::abs(pair.turned_rad[2] - pair.wheels_yaw_rad) > kYawUnseen_rad;
        const bool others = one_alone ? std::abs(pair.gone_rad) > kGone_rad && pair.ticks > kHeld
                                      : pair.others_rad > kOthers_rad && pair.ticks > kPassing;
        if (tips || yaws || others) dead_ |= 1U << a | 1U << b;
      }
    }
  }

  std::uint32_t dead() const noexcept { return dead_; }

 private:
  // Above what 40 sound robots of the population reached, standing, turning, driving, pushed and suddenly
  // commanded.
  static constexpr double kTips_rad = 0.12;
  static constexpr double kYawUnseen_rad = 0.13;
  static constexpr double kYawsForOne_rad = 2.2;
  static constexpr double kOthers_rad = 1.0;
  static constexpr int kPassing = 40;  // ticks: drive and turn do not cancel for longer
  // Beside a dead encoder a sound wheel whose axis points where the robot goes may stand still while the
  // third rolls on: in twelve directions at 0.1 m/s for 160 ticks in 4 of 720 runs, for 200 in none of 1440.
  static constexpr double kGone_rad = 2.0;
  static constexpr int kHeld = 220;  // ticks

  struct Pair {
    std::array<double, 3> turned_rad{};  // body, since both stand still
    double wheels_yaw_rad = 0.0;         // what the other wheels say of its yaw
    double others_rad = 0.0;             // their way
    double gone_rad = 0.0;               // how far they went, one way
    int ticks = 0;
  };

  Vec<Wheels> yaw_from_wheels_;
  std::array<Pair, static_cast<std::size_t>(Wheels*(Wheels - 1) / 2)> pairs_{};
  Vec<Wheels> angle_rad_ = Vec<Wheels>::Zero();
  bool known_ = false;
  std::uint32_t dead_ = 0;
};

}  // namespace equipoise
