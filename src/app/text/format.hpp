// Text as printf makes it, of up to 239 characters.
#pragma once

#include <cstdio>
#include <string>

namespace equipoise::app {

template <class... Args>
std::string format(const char* text, Args... args) {
  char out[240];
  std::snprintf(out, sizeof out, text, args...);
  return out;
}

}  // namespace equipoise::app
