#define EQUIPOISE_ISA avx2
#include "robots/lanes/roll_isa.hpp"
