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

  // One of each as the pipeline has them, of which only the types count.
  static const Kinematics& kinematics() noexcept;
  static const Input& u() noexcept;
  static const Wheels& wheels() noexcept;
  static const Sample& sample() noexcept;
  static const Estimate& x_hat() noexcept;
  static const typename Robot::Parameters& parameters() noexcept;
  static const typename Reference::Reference& errors() noexcept;
  static Estimators& estimators() noexcept;
  static Reference& reference() noexcept;
  static Feedback& feedback() noexcept;

  static_assert(Robot::kWheels >= 1 && Robot::kWheels <= kMaxMotors, "a robot drives one to four motors");
  static_assert(std::is_same_v<Sample, Measurement<Robot::kWheels>>,
                "Sample is the Measurement of its wheels");
  static_assert(std::is_constructible_v<Kinematics, const typename Robot::Parameters&>,
                "Kinematics is built from Parameters");
  static_assert(
      std::is_same_v<decltype(kinematics().friction_input(FrictionCompensation{}, wheels())), Input>,
      "Kinematics::friction_input applies a compensation where the robot's friction acts");
  static_assert(std::is_same_v<decltype(kinematics().wheels_from_axes(u())), Wheels>,
                "Kinematics::wheels_from_axes maps inputs to wheels");
  static_assert(std::is_same_v<decltype(kinematics().axes_from_wheels(wheels())), Input>,
                "Kinematics::axes_from_wheels maps wheels to inputs");
  static_assert(std::is_same_v<decltype(kinematics().wheels_of_turn(0.0)), Wheels>,
                "Kinematics::wheels_of_turn has the wheels' rates while the robot turns");
  static_assert(std::is_same_v<decltype(estimators().update(sample(), u(), bool())), const Estimate&>,
                "Estimators::update(sample, input, held) returns the controlling estimate");
  static_assert(noexcept(estimators().update(sample(), u(), bool())), "the tick does not throw");
  static_assert(
      std::is_same_v<decltype(std::as_const(estimators()).health()), EstimatorHealth<Robot::kWheels>>,
      "Estimators::health() is what the active estimator thinks of the sensors");
  static_assert(std::is_same_v<decltype(std::as_const(estimators()).isolates()), bool>,
                "Estimators::isolates(): the active estimator finds faulty encoders itself");
  static_assert(std::is_same_v<decltype(std::as_const(estimators()).reads_attitude()), bool>,
                "Estimators::reads_attitude(): an estimator that runs needs the attitude source");
  static_assert(std::is_same_v<decltype(reference().reset(x_hat())), void>,
                "Reference::reset(estimate) starts from where the robot is");
  static_assert(std::is_same_v<decltype(Feedback::kSharesDuty), const bool>,
                "Feedback::kSharesDuty: Kinematics::allocate(input, limit) shares a short supply");
  static_assert(
      std::is_same_v<decltype(reference().update(Command{}, x_hat())), typename Reference::Reference>,
      "Reference::update(command, estimate) returns the state errors");
  static_assert(std::is_same_v<decltype(feedback().update(errors())), Input>,
                "Feedback::update(reference) returns u about the input axes");
  static_assert(std::is_same_v<decltype(view(x_hat(), parameters())), StateView>,
                "view(estimate, parameters) is the robot-neutral state");
};

}  // namespace equipoise
