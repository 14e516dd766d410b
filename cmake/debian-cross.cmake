# Included by a toolchain file that has set target_triple and target_cpu: Debian's libraries of that target from
# tools/sysroot.
set(CMAKE_SYSTEM_NAME Linux)
list(APPEND CMAKE_TRY_COMPILE_PLATFORM_VARIABLES TARGET_SYSROOT)
if(NOT EXISTS "${TARGET_SYSROOT}/usr/include")
  message(FATAL_ERROR "No sysroot in '${TARGET_SYSROOT}'; run tools/sysroot first")
endif()

set(CMAKE_SYSROOT ${TARGET_SYSROOT})
set(CMAKE_LIBRARY_ARCHITECTURE ${target_triple})
set(CMAKE_C_COMPILER ${target_triple}-gcc)
set(CMAKE_CXX_COMPILER ${target_triple}-g++)
set(CMAKE_C_FLAGS_INIT "${target_cpu}")
set(CMAKE_CXX_FLAGS_INIT "${target_cpu}")

# The target's own C and C++ libraries, not the cross compiler's: they may be of a later Debian.
file(GLOB target_gcc_libraries ${TARGET_SYSROOT}/usr/lib/gcc/${target_triple}/*)
set(CMAKE_EXE_LINKER_FLAGS_INIT "-L${TARGET_SYSROOT}/usr/lib/${target_triple} -L${target_gcc_libraries}")

set(CMAKE_FIND_ROOT_PATH ${CMAKE_SYSROOT})
set(CMAKE_FIND_ROOT_PATH_MODE_PROGRAM NEVER)
set(CMAKE_FIND_ROOT_PATH_MODE_LIBRARY ONLY)
set(CMAKE_FIND_ROOT_PATH_MODE_INCLUDE ONLY)
set(CMAKE_FIND_ROOT_PATH_MODE_PACKAGE ONLY)
set(ENV{PKG_CONFIG_DIR} "")
set(ENV{PKG_CONFIG_LIBDIR} "${CMAKE_SYSROOT}/usr/lib/${target_triple}/pkgconfig:${CMAKE_SYSROOT}/usr/share/pkgconfig")
set(ENV{PKG_CONFIG_SYSROOT_DIR} ${CMAKE_SYSROOT})
