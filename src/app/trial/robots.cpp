// The robots of this build, from their list.
#include "app/trial/firmware_of.hpp"
#include "robots/robot_list.hpp"

namespace equipoise::app {

const std::vector<const RobotType*>& robot_types() {
  static const std::vector<const RobotType*> types = [] {
    std::vector<const RobotType*> all;
    for_each_robot([&](auto robot) { all.push_back(&ConfiguredRobotOf<decltype(robot)>::robot_type()); });
    return all;
  }();
  return types;
}

}  // namespace equipoise::app
