#define EQUIPOISE_ISA avx512
#define EQUIPOISE_LANES 8
#include "robots/lanes/roll_isa.hpp"
