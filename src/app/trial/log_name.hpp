// Where a run's log goes when nobody says: logs/KIND-ROBOT-TIME.lcm, of a name that does not exist yet.
// In: sim or run's backend, robot -> out: path; makes the folder. Start-up only.
#pragma once

#include <string>

namespace equipoise::app {

std::string new_log_name(const std::string& kind, const std::string& robot);

}  // namespace equipoise::app
