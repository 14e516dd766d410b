#include "app/sim/simulated_run.hpp"

namespace equipoise::app {

template SimSummary simulate<MbbrFirmware>(const MbbrConfig&, const Choice&, const SimOptions&,
                                           const TickObserver&, const std::atomic<bool>&);

}  // namespace equipoise::app
