// The pipelines as they are run, counted and simulated: compiled here and nowhere else.
#include "robots/mip/config.hpp"

namespace equipoise {

template class Pipeline<Mip, MipEstimators, MipReferenceStage, MipSlcFeedback>;
template class Pipeline<Mip, MipEstimators, MipReferenceStage, MipLqrFeedback>;

}  // namespace equipoise
