// What --set and an included fragment make of either robot's configuration: one that can be read again, or a
// ConfigError. First byte: robot and kind of edit; the rest is its text.
#include "config/edits.hpp"

#include <unistd.h>

#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>

#include "equipoise/config.hpp"
#include "robots/mbbr/config.hpp"
#include "robots/mip/config.hpp"

namespace {

namespace fs = std::filesystem;

struct Bases {
  Bases() {
    fs::create_directories(folder);
    for (const char* name : {"mbbr", "edumip"})
      root[name[0] == 'm' ? 0 : 1] =
          equipoise::config::parsed_file(std::string(EQUIPOISE_SOURCE_DIR) + "/config/" + name + ".toml", "");
  }
  ~Bases() { fs::remove_all(folder); }
  fs::path folder = fs::temp_directory_path() / ("equipoise-fuzz-" + std::to_string(getpid()));
  toml::table root[2];
};

std::size_t leaves(const toml::node& node) {
  std::size_t count = 0;
  if (const toml::table* table = node.as_table()) {
    for (const auto& entry : *table) count += leaves(entry.second);
    return count;
  }
  return 1;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const Bases bases;
  if (size == 0) return 0;
  const std::string text(reinterpret_cast<const char*>(data) + 1, size - 1);
  const std::size_t robot = data[0] & 1U;
  toml::table root = bases.root[robot];
  try {
    if ((data[0] & 2U) != 0) {
      std::ofstream(bases.folder / "fragment.toml") << text;
      root.insert_or_assign("include", toml::array{"fragment.toml"});
      equipoise::config::apply_includes(root, (bases.folder / "robot.toml").string());
    } else {
      equipoise::config::apply_set(root, text);
      if (leaves(root) < leaves(bases.root[robot])) std::abort();  // an edit takes no key away
    }
    std::ostringstream whole;
    whole << root;
    if (robot == 0) {
      (void)equipoise::parse_mbbr(whole.str(), "fuzz.toml");
    } else {
      (void)equipoise::parse_mip(whole.str(), "fuzz.toml");
    }
  } catch (const equipoise::ConfigError&) {
  }
  return 0;
}
