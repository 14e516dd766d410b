# Cross build for the BeagleBone Black: Cortex-A8, NEON, hard float, Debian armhf libraries from tools/sysroot.
# Used by the preset `bbb`; tests then run under qemu-arm as a Cortex-A8, which refuses later instructions.
set(CMAKE_SYSTEM_PROCESSOR armv7l)
set(target_triple arm-linux-gnueabihf)
set(target_cpu "-mcpu=cortex-a8 -mfpu=neon -mfloat-abi=hard -mthumb")
include(${CMAKE_CURRENT_LIST_DIR}/debian-cross.cmake)
string(APPEND CMAKE_CXX_FLAGS_INIT " -Wno-psabi")  # a note about GCC 7's ABI, of no concern here

set(CMAKE_CROSSCOMPILING_EMULATOR qemu-arm;-cpu;cortex-a8;-L;${CMAKE_SYSROOT})
