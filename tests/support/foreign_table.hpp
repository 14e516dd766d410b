// A foreign table by hand with its map: 1 kHz, the gyro counts up, both wheels turn at 1 rad/s, 6 V on the
// first wheel from 20 ms on. Tests only.
#pragma once

#include <string>
#include <vector>

#include "app/import/import.hpp"

namespace equipoise::app {

struct Foreign {
  ImportedRobot robot = imported_robot(std::string(EQUIPOISE_SOURCE_DIR) + "/config/edumip.toml");
  ImportMap map;
  Table table;

  Foreign() {
    robot.calibration.R_BS.setIdentity();
    table.names = {"t", "g", "zero", "up", "w", "v"};
    table.columns.resize(6);
    for (int k = 0; k < 100; ++k) {
      const double row[6] = {1e-3 * k, 0.01 * k, 0.0, 9.8, 1e-3 * k, k >= 20 ? 6.0 : 0.0};
      for (std::size_t i = 0; i < 6; ++i) table.columns[i].push_back(row[i]);
    }
    map.time = {"t", 1.0};
    map.gyro.axes = {{"g", 1.0}, {"zero", 1.0}, {"zero", 1.0}};
    map.accel.axes = {{"zero", 1.0}, {"zero", 1.0}, {"up", 1.0}};
    map.wheels.axes = {{"w", 1.0}, {"w", 1.0}};
    map.wheels.kind = "angle";
    map.drive.axes = {{"v", 1.0}, {"zero", 1.0}};
    map.drive.kind = "volts";
    map.battery_V = 7.4;
  }
  std::vector<runtime::TickRecord> ticks() const {
    return imported_ticks(imported_rows(table, map, robot), map, robot);
  }
};

}  // namespace equipoise::app
