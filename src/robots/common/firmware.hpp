// What a robot's firmware.hpp says in the same words for every robot. In: the robot's types -> out: base of
// its list entry. Start-up only.
#pragma once

#include "robots/common/choice.hpp"

namespace equipoise {

template <class Robot_, class Config_, class World_>
struct FirmwareBase {
  using Robot = Robot_;
  using Config = Config_;
  using Loaded = equipoise::Loaded<Config>;
  using World = World_;

  static double rolling_radius_m(const Config& c) { return c.robot.r; }

  /// `config` as it runs; `level` of fidelity.
  static World world(const Config& config, std::size_t level, std::uint64_t seed) {
    auto params = config.world[level];
    params.common.seed = seed;
    return World(config.robot, config.motor, config.calibration, params);
  }
};

}  // namespace equipoise
