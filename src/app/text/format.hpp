// Text as printf makes it, of up to 399 characters.
#pragma once

#include <cstdarg>
#include <cstdio>
#include <string>

namespace equipoise::app {

[[gnu::format(printf, 1, 2)]] inline std::string format(const char* text, ...) {
  char out[400];
  std::va_list arguments;
  va_start(arguments, text);
  (void)std::vsnprintf(out, sizeof out, text, arguments);
  va_end(arguments);
  return out;
}

}  // namespace equipoise::app
