#define EQUIPOISE_ISA baseline
#define EQUIPOISE_LANES 2
#include "robots/lanes/roll_isa.hpp"
