# Cross build for 64-bit boards (PocketBeagle 2, Raspberry Pi 4): Debian arm64 libraries from tools/sysroot.
set(CMAKE_SYSTEM_PROCESSOR aarch64)
set(target_triple aarch64-linux-gnu)
set(target_cpu "")
include(${CMAKE_CURRENT_LIST_DIR}/debian-cross.cmake)

set(CMAKE_CROSSCOMPILING_EMULATOR qemu-aarch64;-L;${CMAKE_SYSROOT})
