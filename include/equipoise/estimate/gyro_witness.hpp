// What a gyro is held against: the robot's parameters, and what its filter knows of the tick. Body axes;
// rates in rad/s. RT-safe.
#pragma once

#include <array>

#include "equipoise/samples.hpp"

namespace equipoise {

template <int Wheels>
struct GyroWatchParams {
  Mat<3, Wheels> from_wheels =
      Mat<3, Wheels>::Zero();                 // change of body rate per change of wheel rate, by torque
  Vec3 sigma_rad_s = Vec3::Ones();            // of what is left of a change over three ticks
  Vec3 slow_sigma_rad_s = Vec3::Zero();       // the same over six ticks; zero: encoders are blamed unexamined
  Vec3 max_step_rad_s = Vec3::Constant(2.0);  // of a rate against what was expected; at least 1
  Mat<3, Wheels> by_torque = Mat<3, Wheels>::Zero();  // what u does to the body's rates in a tick
  Vec3 per_jump = Vec3::Zero();  // 1 over the least jump of the bias that is examined; zero: of no interest
  double of_an_encoder = 1.0;    // a lie leaves less than so much of what is left with another encoder
  std::array<bool, 3> balances{true, true, true};  // axes without which the robot falls
  // Axes whose rate is known without a torque: by what the filter knows, and about z by the wheels' rates.
  std::array<bool, 3> by_rate{false, false, false};
  Vec<Wheels> yaw_from_wheels = Vec<Wheels>::Zero();
  Vec3 rate_sigma_rad_s = Vec3::Constant(0.25);  // encoder counts, play
  double max_held_slip_rad_s = 0.0;              // of the spin while all wheels stand still; zero: any
};

/// What the filter knows of the tick.
template <int Wheels>
struct GyroWitness {
  double accel_nis = 0.0;  // normalised innovation of the accelerometer's rows, summed
  // What the wheels' rates change without a torque, because the robot turns and its ball rolls straight on.
  Vec<Wheels> carried_rad_s2 = Vec<Wheels>::Zero();
  int blamed_wheel = -1;           // is not used any more; -1: none
  bool wheel_stands = false;       // it, since long: that is no fault of the gyro
  double held_slip_rad_s = 0.0;    // spin of wheels that all stand still, less what the gyro says
  Vec3 rate_rad_s = Vec3::Zero();  // of the axes `by_rate`, added to what the wheels say
};

}  // namespace equipoise
