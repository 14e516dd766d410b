// References and state errors of the MIP. In: command, estimate -> out: the errors that the feedback
// multiplies. Speed and yaw rate are slew-limited and integrated to phi_ref and psi_ref. A MIP cannot
// sidestep: the command's x is its speed along its own heading. After the motors were off, `restart` tells
// the feedback's filters to start afresh. RT-safe.
#pragma once

#include <limits>

#include "equipoise/control/governor.hpp"
#include "robots/mip/mip.hpp"

namespace equipoise {

struct MipReferenceParams {
  double max_acceleration_m_s2 = 0.5;  // of the speed command
  double max_jerk_m_s3 = std::numeric_limits<double>::infinity();
  double max_yaw_acceleration_rad_s2 = 5.0;
  double max_phi_error_rad = 6.0;  // a robot that is held back does not store up a leap
  double wheel_radius_m = 0.035;
  double feasible_acceleration_m_s2 = std::numeric_limits<double>::infinity();  // of this robot
  DutyBudget budget;
};

struct MipReference {
  double phi = 0.0;  // mean encoder angle
  double phi_dot = 0.0;
  double psi = 0.0;
  double psi_dot = 0.0;
  Vec2 position_W_m = Vec2::Zero();
  // Errors, reference minus estimate; the lean's reference is upright
  double d_theta = 0.0;
  double d_theta_dot = 0.0;
  double d_phi = 0.0;
  double d_phi_dot = 0.0;
  double d_psi = 0.0;
  double d_psi_dot = 0.0;
  bool restart = false;
};

/// Robot-neutral view of where the robot should be.
StateView view(const MipReference& ref, const MipParameters& p) noexcept;

class MipReferenceStage {
 public:
  using Params = MipReferenceParams;
  using Reference = MipReference;
  explicit MipReferenceStage(const MipReferenceParams& params) : p_(params) {}

  /// Start from where the robot is: called while the motors are off.
  void reset(const MipEstimate& x_hat) noexcept;

  MipReference update(const Command& command, const MipEstimate& x_hat) noexcept;

 private:
  MipReferenceParams p_;
  SmoothVelocity<1> drive_;
  double yaw_rate_ = 0.0;
  double phi_ref_ = 0.0;
  double psi_ref_ = 0.0;
  Vec2 position_W_m_ = Vec2::Zero();
  bool restart_ = true;
};

}  // namespace equipoise
