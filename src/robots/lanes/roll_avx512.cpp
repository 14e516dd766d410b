#define EQUIPOISE_ISA avx512
#include "robots/lanes/roll_isa.hpp"
