#define EQUIPOISE_ISA baseline
#include "robots/lanes/roll_isa.hpp"
