// What a robot supplies to the pipeline, checked at compile time.
// A robot is a struct of types and constants (Mbbr, Mip); its numbers come from config.
#pragma once

#include <type_traits>
#include <utility>

#include "equipoise/control/friction.hpp"
#include "equipoise/samples.hpp"

namespace equipoise {

template <int Wheels>
struct EstimatorHealth;  // estimate/health.hpp

template <class Robot, class Estimators, class Reference, class Feedback>
struct RobotContract {
  using Kinematics = typename Robot::Kinematics;
  using Estimate = typename Robot::Estimate;
  using Sample = typename Robot::Sample;
  using Input = Vec<Robot::kInputs>;
  using Wheels = Vec<Robot::kWheels>;

  static_assert(Robot::kWheels >= 1 && Robot::kWheels <= kMaxMotors, "a robot drives one to four motors");
  static_assert(std::is_same_v<Sample, Measurement<Robot::kWheels>>,
                "Sample is the Measurement of its wheels");
  static_assert(std::is_constructible_v<Kinematics, const typename Robot::Parameters&>,
                "Kinematics is built from Parameters");
  static_assert(std::is_same_v<decltype(std::declval<const Kinematics&>().friction_input(
                                   std::declval<FrictionCompensation>(), std::declval<Wheels>())),
                               Input>,
                "Kinematics::friction_input applies a compensation where the robot's friction acts");
  static_assert(
      std::is_same_v<decltype(std::declval<const Kinematics&>().wheels_from_axes(std::declval<Input>())),
                     Wheels>,
      "Kinematics::wheels_from_axes maps inputs to wheels");
  static_assert(
      std::is_same_v<decltype(std::declval<const Kinematics&>().axes_from_wheels(std::declval<Wheels>())),
                     Input>,
      "Kinematics::axes_from_wheels maps wheels to inputs");
  static_assert(std::is_same_v<decltype(std::declval<Estimators&>().update(
                                   std::declval<const Sample&>(), std::declval<const Input&>(), bool())),
                               const Estimate&>,
                "Estimators::update(sample, input, held) returns the controlling estimate");
  static_assert(noexcept(std::declval<Estimators&>().update(std::declval<const Sample&>(),
                                                            std::declval<const Input&>(), bool())),
                "the tick does not throw");
  static_assert(
      std::is_same_v<decltype(std::declval<const Estimators&>().health()), EstimatorHealth<Robot::kWheels>>,
      "Estimators::health() is what the active estimator thinks of the sensors");
  static_assert(std::is_same_v<decltype(std::declval<const Estimators&>().isolates()), bool>,
                "Estimators::isolates(): the active estimator finds faulty encoders itself");
  static_assert(std::is_same_v<decltype(std::declval<const Estimators&>().reads_attitude()), bool>,
                "Estimators::reads_attitude(): an estimator that runs needs the attitude source");
  static_assert(std::is_same_v<decltype(Robot::slip_rad_s(std::declval<const Sample&>(),
                                                          std::declval<const Kinematics&>(),
                                                          std::declval<const Estimate&>())),
                               double>,
                "Robot::slip_rad_s(sample, kinematics, estimate): encoders against gyro; 0 where not judged");
  static_assert(
      std::is_same_v<decltype(std::declval<Reference&>().reset(std::declval<const Estimate&>())), void>,
      "Reference::reset(estimate) starts from where the robot is");
  static_assert(std::is_same_v<decltype(Feedback::kSharesDuty), const bool>,
                "Feedback::kSharesDuty: Kinematics::allocate(input, limit) shares a short supply");
  static_assert(std::is_same_v<decltype(std::declval<Reference&>().update(std::declval<const Command&>(),
                                                                          std::declval<const Estimate&>())),
                               typename Reference::Reference>,
                "Reference::update(command, estimate) returns the state errors");
  static_assert(std::is_same_v<decltype(std::declval<Feedback&>().update(
                                   std::declval<const typename Reference::Reference&>())),
                               Input>,
                "Feedback::update(reference) returns u about the input axes");
  static_assert(std::is_same_v<decltype(view(std::declval<const Estimate&>(),
                                             std::declval<const typename Robot::Parameters&>())),
                               StateView>,
                "view(estimate, parameters) is the robot-neutral state");
};

}  // namespace equipoise
