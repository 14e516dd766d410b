// A floor that is not even, under one ball or wheel: slope that changes with place, sills, joints of tiles.
// In: where its centre is and moves -> out: horizontal acceleration and lift that the floor gives it. Over an
// edge of height h the centre follows an arc of the wheel's radius r, from sqrt(2 r h - h^2) before it; where
// the path turns upwards at once, the velocity keeps what lies along the new tangent (plastic impact about
// the edge: Meriam, Kraige, Dynamics, angular momentum). Simulation only; deterministic, no allocation.
#pragma once

#include "equipoise/plant/noise.hpp"

namespace equipoise {

struct FloorParams {
  double wave_rad = 0.0;  // largest slope of each of two waves
  double wave_m = 2.0;    // their length
  double sill_m = 0.0;    // height of thin ridges
  double sill_every_m = 1.0;
  double joint_m = 0.0;  // difference in height of two tiles, at most
  double tile_m = 0.3;
  double heading_rad = 0.0;  // of tiles and sills in the world

  bool uneven() const noexcept { return wave_rad != 0.0 || sill_m != 0.0 || joint_m != 0.0; }
};

class Ground {
 public:
  Ground(const FloorParams& floor, double radius_m, std::uint64_t seed) noexcept;

  /// Of a centre there: its rise per metre towards world x and y.
  Vec2 slope(const Vec2& position_W_m) const noexcept;

  /// The step of `h` seconds that begins here.
  void begin_step(const Vec2& position_W_m, const Vec2& velocity_W_m_s, double h) noexcept;
  const Vec2& pull_W_m_s2() const noexcept { return pull_; }  // horizontal force over the weight's mass
  double lift_m_s2() const noexcept { return lift_; }         // of the centre, upwards

 private:
  double joint(const Vec2& place_m, int axis) const noexcept;

  FloorParams p_;
  double radius_m_;
  std::uint64_t seed_;
  double sill_reach_m_, joint_reach_m_;  // from where the centre rises
  Vec2 axis_;                            // of the tiles
  Vec2 phase_rad_;
  Vec2 slope_ = Vec2::Zero();
  double rise_m_s_ = 0.0;
  Vec2 pull_ = Vec2::Zero();
  double lift_ = 0.0;
  bool begun_ = false;
};

}  // namespace equipoise
