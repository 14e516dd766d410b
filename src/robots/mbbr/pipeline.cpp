// The pipelines as they are run, counted and simulated: compiled here and nowhere else.
#include "robots/mbbr/config.hpp"

namespace equipoise {

template class Pipeline<Mbbr, MbbrEstimators, MbbrReferenceStage, MbbrThesisFeedback>;
template class Pipeline<Mbbr, MbbrEstimators, MbbrReferenceStage, MbbrScheduledFeedback>;

}  // namespace equipoise
