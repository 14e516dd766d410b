// Text as printf makes it, of up to 399 characters; names in a row.
#pragma once

#include <cstdarg>
#include <cstdio>
#include <string>
#include <vector>

namespace equipoise::app {

[[gnu::format(printf, 1, 2)]] inline std::string format(const char* text, ...) {
  char out[400];
  std::va_list arguments;
  va_start(arguments, text);
  (void)std::vsnprintf(out, sizeof out, text, arguments);
  va_end(arguments);
  return out;
}

inline std::string joined(const std::vector<std::string>& names) {
  std::string text;
  for (const std::string& name : names) text += (text.empty() ? "" : ", ") + name;
  return text;
}

}  // namespace equipoise::app
