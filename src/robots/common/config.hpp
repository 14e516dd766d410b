// What every robot is configured with beside its own dimensions, estimators and controllers. Filled by
// config::read_machine and config::read_surroundings.
#pragma once

#include <array>

#include "equipoise/actuate/bridge.hpp"
#include "equipoise/actuate/safety.hpp"
#include "equipoise/config.hpp"
#include "equipoise/control/chain.hpp"
#include "equipoise/control/friction.hpp"
#include "equipoise/plant/world.hpp"
#include "equipoise/sense/attitude_filter.hpp"
#include "equipoise/sense/calibrate.hpp"

namespace equipoise {

struct CommonConfig {
  MotorParameters motor;
  Calibration calibration;
  FrictionCompensation friction;
  SafetyParams safety;
  AttitudeFilterParams attitude;
  Chain chain;
  std::array<BridgeType, kFidelities> world_bridge{};  // by Fidelity: what the simulated robot is built with
};

}  // namespace equipoise
