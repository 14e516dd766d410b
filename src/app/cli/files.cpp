#include <cstdio>
#include <fstream>
#include <sstream>

#include "app/cli/commands.hpp"

namespace equipoise::app {

std::string read_text(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  std::ostringstream text;
  if (!file || !(text << file.rdbuf())) throw InputError(path + ": cannot be read");
  return text.str();
}

}  // namespace equipoise::app
