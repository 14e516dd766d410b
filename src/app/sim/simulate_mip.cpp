#include "app/sim/simulated_run.hpp"

namespace equipoise::app {

template SimSummary simulate<MipFirmware>(const MipConfig&, const Choice&, const SimOptions&,
                                          const TickObserver&, const std::atomic<bool>&);

}  // namespace equipoise::app
