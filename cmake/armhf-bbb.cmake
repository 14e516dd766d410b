# Cross build for the BeagleBone Black: Cortex-A8, NEON, hard float, Debian armhf libraries from tools/sysroot.
# Used by the preset `bbb`; tests then run under qemu-arm as a Cortex-A8, which refuses later instructions.
set(CMAKE_SYSTEM_NAME Linux)
set(CMAKE_SYSTEM_PROCESSOR armv7l)
list(APPEND CMAKE_TRY_COMPILE_PLATFORM_VARIABLES BBB_SYSROOT)
if(NOT EXISTS "${BBB_SYSROOT}/usr/include")
  message(FATAL_ERROR "No sysroot in '${BBB_SYSROOT}'; run tools/sysroot first")
endif()

set(bbb_triple arm-linux-gnueabihf)
set(CMAKE_SYSROOT ${BBB_SYSROOT})
set(CMAKE_LIBRARY_ARCHITECTURE ${bbb_triple})
set(CMAKE_C_COMPILER ${bbb_triple}-gcc)
set(CMAKE_CXX_COMPILER ${bbb_triple}-g++)
set(bbb_cpu "-mcpu=cortex-a8 -mfpu=neon -mfloat-abi=hard -mthumb")
set(CMAKE_C_FLAGS_INIT "${bbb_cpu}")
set(CMAKE_CXX_FLAGS_INIT "${bbb_cpu} -Wno-psabi")  # a note about GCC 7's ABI, of no concern here

# The target's own C and C++ libraries, not the cross compiler's: they may be of a later Debian.
file(GLOB bbb_gcc_libraries ${BBB_SYSROOT}/usr/lib/gcc/${bbb_triple}/*)
set(CMAKE_EXE_LINKER_FLAGS_INIT "-L${BBB_SYSROOT}/usr/lib/${bbb_triple} -L${bbb_gcc_libraries}")

set(CMAKE_FIND_ROOT_PATH ${CMAKE_SYSROOT})
set(CMAKE_FIND_ROOT_PATH_MODE_PROGRAM NEVER)
set(CMAKE_FIND_ROOT_PATH_MODE_LIBRARY ONLY)
set(CMAKE_FIND_ROOT_PATH_MODE_INCLUDE ONLY)
set(CMAKE_FIND_ROOT_PATH_MODE_PACKAGE ONLY)
set(ENV{PKG_CONFIG_DIR} "")
set(ENV{PKG_CONFIG_LIBDIR} "${CMAKE_SYSROOT}/usr/lib/${bbb_triple}/pkgconfig:${CMAKE_SYSROOT}/usr/share/pkgconfig")
set(ENV{PKG_CONFIG_SYSROOT_DIR} ${CMAKE_SYSROOT})

set(CMAKE_CROSSCOMPILING_EMULATOR qemu-arm;-cpu;cortex-a8;-L;${CMAKE_SYSROOT})
