# Run after lcm-gen, with DIRECTORY: its C++ decoders take a string's length as it comes, and throw at 0 or less;
# a string's length counts its end, so such a message is refused like any other torn one.
file(GLOB headers ${DIRECTORY}/*.hpp)
foreach(header IN LISTS headers)
  file(READ ${header} code)
  string(REGEX REPLACE "if\\((__[A-Za-z0-9_]+_len__) > maxlen - pos\\)" "if(\\1 < 1 || \\1 > maxlen - pos)" mended "${code}")
  if(NOT mended STREQUAL code)
    file(WRITE ${header} "${mended}")
  endif()
endforeach()
