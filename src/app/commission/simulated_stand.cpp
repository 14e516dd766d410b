#include "app/commission/simulated_stand.hpp"

#include <Eigen/Geometry>
#include <cmath>
#include <cstdio>
#include <cstring>

#include "app/text/errors.hpp"

namespace equipoise::app {
namespace {

// Of a wheel with its rotor, seen at the wheel: the MBBR's 1.2e-5 kg m2 about the ball, over (r/r_w)^2.
constexpr double kWheelInertia_kg_m2 = 1.83e-6;
constexpr double kTip_rad = 40.0 * kPi / 180.0;

bool pair_of(const std::string& text, const char* pattern, int wheels, std::size_t* a, std::size_t* b) {
  int first = 0, second = 0, end = 0;
  if (std::sscanf(text.c_str(), pattern, &first, &second, &end) != 2) return false;
  if (first < 1 || second < 1 || first > wheels || second > wheels || first == second) return false;
  *a = static_cast<std::size_t>(first - 1);
  *b = static_cast<std::size_t>(second - 1);
  return end == static_cast<int>(text.size());
}

bool one_of(const std::string& text, const char* pattern, int wheels, std::size_t* a) {
  int first = 0, end = 0;
  if (std::sscanf(text.c_str(), pattern, &first, &end) != 1 || first < 1 || first > wheels) return false;
  *a = static_cast<std::size_t>(first - 1);
  return end == static_cast<int>(text.size());
}

}  // namespace

StandFaults parse_faults(const std::vector<std::string>& names, int wheels) {
  StandFaults faults;
  Miswiring& w = faults.wiring;
  for (const std::string& name : names) {
    std::size_t a = 0, b = 0;
    if (name == "moving") {
      faults.moving = true;
    } else if (one_of(name, "motor-%d-reversed%n", wheels, &a)) {
      w.motor_sign[a] = -w.motor_sign[a];
    } else if (one_of(name, "motor-%d-dead%n", wheels, &a)) {
      w.motor_sign[a] = 0.0;
    } else if (one_of(name, "encoder-%d-reversed%n", wheels, &a)) {
      w.encoder_sign[a] = -w.encoder_sign[a];
    } else if (pair_of(name, "motors-%d-%d-swapped%n", wheels, &a, &b)) {
      std::swap(w.wheel_of_motor[a], w.wheel_of_motor[b]);
    } else if (pair_of(name, "encoders-%d-%d-swapped%n", wheels, &a, &b)) {
      std::swap(w.wheel_of_encoder[a], w.wheel_of_encoder[b]);
    } else {
      throw InputError("--practice-fault " + name +
                       ": allowed: moving, motor-1-reversed, motor-1-dead, encoder-1-reversed, "
                       "motors-1-2-swapped, encoders-1-2-swapped");
    }
  }
  return faults;
}

SimulatedStand::SimulatedStand(const StandSetup& setup, const StandFaults& faults)
    : setup_(setup), faults_(faults) {
  build();
}

void SimulatedStand::build() {
  StandParams stand;
  stand.wheels = setup_.layout.wheels;
  stand.axis_B = setup_.layout.axis_B;
  stand.body_inertia_kg_m2 = setup_.layout.body_inertia_kg_m2;
  stand.wheel_inertia_kg_m2 = kWheelInertia_kg_m2;
  stand.accel_scale_error = {0.01, -0.015, 0.02};  // data sheet: 3 %
  stand.wiring = faults_.wiring;
  world_ = std::make_unique<StandWorld>(stand, setup_.motor, setup_.calibration, setup_.world);
  backend_ = std::make_unique<PlantBackend>(*world_);
  if (faults_.moving) world_->shake_by_hand({0.0, 0.0, 30.0 * kPi / 180.0});
}

void SimulatedStand::put_face_up(int face) {
  Vec3 up_S = Vec3::Zero();
  up_S(face % 3) = face < 3 ? 1.0 : -1.0;
  const Vec3 up_B = setup_.calibration.R_BS * up_S;
  const Vec3 across = up_B.cross(Vec3::UnitZ());
  const double angle = std::atan2(across.norm(), up_B.z());
  const Vec3 axis = across.isZero() ? Vec3(Vec3::UnitX()) : Vec3(across.normalized());
  world_->put(Eigen::AngleAxisd(angle, axis).toRotationMatrix());
}

Ask SimulatedStand::ask() {
  return [this](const Request& request, std::string* answer) {
    std::fprintf(stderr, "%s\n", request.text.c_str());
    const auto index = static_cast<std::size_t>(request.index);
    switch (request.act) {
      case Request::kFaceUp:
        put_face_up(request.index);
        break;
      case Request::kUpright:
        world_->put(Mat3::Identity());
        break;
      case Request::kTip:
        world_->put(Eigen::AngleAxisd(kTip_rad, setup_.tip_axis_B).toRotationMatrix());
        break;
      case Request::kTurnWheel:
        world_->turn(request.index, 2.0 * kPi * request.turns);
        break;
      case Request::kLookAtWheel:
        *answer = std::to_string(faults_.wiring.wheel_of_motor[index] + 1) +
                  (faults_.wiring.motor_sign[index] < 0.0 ? " b" : " f");
        std::fprintf(stderr, "> %s\n", answer->c_str());
        break;
    }
    return true;
  };
}

void SimulatedStand::rewire(const Board& from, const Board& to) {
  const Miswiring before = faults_.wiring;
  for (std::size_t i = 0; i < to.wiring.motors; ++i) {
    const bbb_motor_t& now = to.wiring.motor[i];
    for (std::size_t j = 0; j < from.wiring.motors; ++j) {
      const bbb_motor_t& then = from.wiring.motor[j];
      if (std::strcmp(now.pwm, then.pwm) == 0 && now.pwm_channel == then.pwm_channel) {
        faults_.wiring.wheel_of_motor[i] = before.wheel_of_motor[j];
        faults_.wiring.motor_sign[i] =
            now.motor_reversed == then.motor_reversed ? before.motor_sign[j] : -before.motor_sign[j];
      }
      if (std::strcmp(now.encoder, then.encoder) == 0) {
        faults_.wiring.wheel_of_encoder[i] = before.wheel_of_encoder[j];
        faults_.wiring.encoder_sign[i] =
            now.encoder_reversed == then.encoder_reversed ? before.encoder_sign[j] : -before.encoder_sign[j];
      }
    }
  }
  build();
}

}  // namespace equipoise::app
