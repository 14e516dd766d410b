// A simulated robot on its stand with a hand that does what is asked, for practice without hardware and for
// tests: --backend stand. In: configuration, wiring faults -> out: backend, answers. Simulation only.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "app/board/board.hpp"
#include "app/commission/calibrate_wheels.hpp"
#include "app/commission/manual_drive.hpp"
#include "app/io/plant_backend.hpp"
#include "equipoise/plant/stand_world.hpp"

namespace equipoise::app {

/// "motor-1-reversed", "motor-1-dead", "encoder-2-reversed", "motors-1-2-swapped", "encoders-1-2-swapped",
/// "moving"; InputError for anything else.
struct StandFaults {
  Miswiring wiring;
  bool moving = false;
};
StandFaults parse_faults(const std::vector<std::string>& names, int wheels);

struct StandSetup {
  WheelLayout layout;
  Vec3 tip_axis_B = Vec3::UnitY();
  MotorParameters motor;
  Calibration calibration;
  WorldParams world;
};

class SimulatedStand {
 public:
  SimulatedStand(const StandSetup& setup, const StandFaults& faults);

  rio_t io() { return backend_->io(); }
  Ask ask();
  /// The same robot behind another board file: what is wired to which pin stays.
  void rewire(const Board& from, const Board& to);

 private:
  void build();
  void put_face_up(int face);

  StandSetup setup_;
  StandFaults faults_;
  std::unique_ptr<StandWorld> world_;
  std::unique_ptr<PlantBackend> backend_;
};

}  // namespace equipoise::app
