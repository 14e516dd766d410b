# equipoise_lcm_types: C++ headers of lcm/*.lcm (an interface library) and, beside them, the Python package
# `equipoise_lcm` in <build>/lcm/python, for tools and tests. Debian's liblcm-dev ships no CMake helper.
find_program(LCM_GEN lcm-gen REQUIRED)
file(GLOB lcm_files CONFIGURE_DEPENDS ${CMAKE_CURRENT_SOURCE_DIR}/lcm/*.lcm)
set(lcm_out ${CMAKE_BINARY_DIR}/lcm)
set(lcm_stamp ${lcm_out}/generated.stamp)
list(TRANSFORM lcm_files REPLACE "^.*/(.*)\\.lcm$" "${lcm_out}/cpp/equipoise/\\1.hpp" OUTPUT_VARIABLE lcm_headers)
add_custom_command(
  OUTPUT ${lcm_stamp}
  BYPRODUCTS ${lcm_headers}
  COMMAND ${LCM_GEN} --cpp --cpp-hpath ${lcm_out}/cpp ${lcm_files}
  COMMAND ${LCM_GEN} --python --ppath ${lcm_out}/python ${lcm_files}
  COMMAND ${CMAKE_COMMAND} -E touch ${lcm_stamp}
  DEPENDS ${lcm_files}
  COMMENT "Generating LCM types")
add_custom_target(equipoise_lcm_generate DEPENDS ${lcm_stamp})
add_library(equipoise_lcm_types INTERFACE)
target_include_directories(equipoise_lcm_types SYSTEM INTERFACE ${lcm_out}/cpp)
target_link_libraries(equipoise_lcm_types INTERFACE PkgConfig::LCM)
# lcm-gen's code reads and writes doubles through int64_t*.
target_compile_options(equipoise_lcm_types INTERFACE $<$<COMPILE_LANGUAGE:CXX>:-fno-strict-aliasing>)
add_dependencies(equipoise_lcm_types equipoise_lcm_generate)
