#define EQUIPOISE_ISA avx2
#define EQUIPOISE_LANES 4
#include "robots/lanes/roll_isa.hpp"
