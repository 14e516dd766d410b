#include "robots/mbbr/dynamics.hpp"

namespace equipoise {

MbbrBodies bodies(const MbbrParameters& p) noexcept {
  return {p.m_t, p.m_b, p.r, p.l, p.I_t1, p.I_t2, p.I_t3, p.I_b, p.I_w, {p.l_a.x(), p.l_a.y(), p.l_a.z()}};
}

template class MbbrMotionOf<double>;
template class MbbrDynamicsOf<double>;

}  // namespace equipoise
