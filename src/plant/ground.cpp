#include "equipoise/plant/ground.hpp"

#include <cmath>

namespace equipoise {
namespace {

/// From where an edge of this height lifts the centre of a wheel.
double reach(double radius_m, double height_m) noexcept {
  return std::sqrt(std::max(0.0, 2.0 * radius_m * height_m - height_m * height_m));
}
/// Of a centre at this distance past the edge that carries it.
double arc_slope(double radius_m, double past_m) noexcept {
  return -past_m / std::sqrt(radius_m * radius_m - past_m * past_m);
}
/// To the nearest line of a grid with this spacing; the start lies half-way between two.
double past_line(double at_m, double spacing_m, double* line) noexcept {
  const double u = at_m / spacing_m + 0.5;
  *line = std::round(u);
  return (u - *line) * spacing_m;
}

}  // namespace

Ground::Ground(const FloorParams& floor, double radius_m, std::uint64_t seed) noexcept
    : p_(floor),
      radius_m_(radius_m),
      seed_(seed),
      sill_reach_m_(reach(radius_m, floor.sill_m)),
      joint_reach_m_(reach(radius_m, floor.joint_m)),
      axis_(std::cos(floor.heading_rad), std::sin(floor.heading_rad)),
      phase_rad_(2.0 * kPi * hashed_unit(seed, 1, 0), 2.0 * kPi * hashed_unit(seed, 2, 0)) {}

/// Slope across the joints that are normal to this axis of the tiles.
double Ground::joint(const Vec2& place_m, int axis) const noexcept {
  double line = 0.0;
  const double past = past_line(place_m(axis), p_.tile_m, &line);
  if (std::abs(past) >= joint_reach_m_) return 0.0;
  const double along = std::floor(place_m(1 - axis) / p_.tile_m + 0.5);
  const auto height = [&](double tile) {
    const auto a = static_cast<std::int64_t>(axis == 0 ? tile : along);
    const auto b = static_cast<std::int64_t>(axis == 0 ? along : tile);
    return p_.joint_m * hashed_unit(seed_, a, b);
  };
  const double step = height(line) - height(line - 1.0);  // from below the line to above it
  const bool on_lower_side = step * past < 0.0;
  return on_lower_side && std::abs(past) < reach(radius_m_, std::abs(step)) ? arc_slope(radius_m_, past)
                                                                            : 0.0;
}

Vec2 Ground::slope(const Vec2& position) const noexcept {
  Vec2 slope = Vec2::Zero();
  if (p_.wave_rad != 0.0)
    slope = p_.wave_rad * (2.0 * kPi / p_.wave_m * position + phase_rad_).array().sin().matrix();
  if (p_.sill_m == 0.0 && p_.joint_m == 0.0) return slope;
  const Vec2 side(-axis_.y(), axis_.x());
  const Vec2 place(axis_.dot(position), side.dot(position));
  if (p_.sill_m != 0.0) {
    double line = 0.0;
    const double past = past_line(place.x(), p_.sill_every_m, &line);
    if (std::abs(past) < sill_reach_m_) slope += arc_slope(radius_m_, past) * axis_;
  }
  if (p_.joint_m != 0.0) slope += joint(place, 0) * axis_ + joint(place, 1) * side;
  return slope;
}

void Ground::begin_step(const Vec2& position, const Vec2& velocity, double h) noexcept {
  const Vec2 now = slope(position);
  const Vec2 turned = begun_ ? Vec2(now - slope_) : Vec2::Zero();
  const double rise = now.dot(velocity);
  pull_ = -kGravity_m_s2 * now;
  lift_ = begun_ ? (rise - rise_m_s_) / h : 0.0;
  const double turn = turned.norm();
  if (turn > 2.0 * velocity.norm() * h / radius_m_) {  // more than an arc turns by: an edge
    const Vec2 normal = turned / turn;
    pull_ -= std::max(0.0, velocity.dot(normal)) * std::max(0.0, now.dot(normal)) * turn / h * normal;
  }
  slope_ = now;
  rise_m_s_ = rise;
  begun_ = true;
}

}  // namespace equipoise
