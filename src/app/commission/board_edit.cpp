#include "app/commission/board_edit.hpp"

#include <algorithm>
#include <sstream>

namespace equipoise::app {
namespace {

using Lines = std::vector<std::string>;

Lines split(const std::string& text) {
  Lines lines;
  std::istringstream stream(text);
  for (std::string line; std::getline(stream, line);) lines.push_back(line);
  return lines;
}

std::string join(const Lines& lines) {
  std::string text;
  for (const std::string& line : lines) text += line + "\n";
  return text;
}

bool starts_with(const std::string& line, const std::string& start) {
  return line.compare(0, start.size(), start) == 0;
}

bool has_key(const std::string& line, const std::string& key) {
  return starts_with(line, key) && line.find_first_not_of(" \t", key.size()) == line.find('=');
}

std::string& line_of(Lines& block, const std::string& key) {
  for (std::string& line : block) {
    if (has_key(line, key)) return line;
  }
  throw JobError("the board file has no line \"" + key + " = ...\" of its own in [[motor]]");
}

/// Turns true into false and back, the comment behind it kept.
void flip(std::string& line) {
  const std::size_t comment = line.find('#');
  const std::size_t yes = line.find("true");
  if (yes < comment) {
    line.replace(yes, 4, "false");
  } else {
    line.replace(line.find("false"), 5, "true");
  }
}

struct MotorBlocks {
  Lines before, after;
  std::vector<Lines> blocks;
};

MotorBlocks take_apart(const std::string& text) {
  MotorBlocks parts;
  bool inside = false;
  for (const std::string& line : split(text)) {
    if (starts_with(line, "[[motor]]")) {
      parts.blocks.emplace_back();
      inside = true;
    } else if (starts_with(line, "[")) {
      inside = false;
    }
    if (inside) {
      parts.blocks.back().push_back(line);
    } else {
      (parts.blocks.empty() ? parts.before : parts.after).push_back(line);
    }
  }
  return parts;
}

}  // namespace

std::string rewired(const std::string& text, const std::vector<WheelFinding>& findings) {
  const MotorBlocks parts = take_apart(text);
  if (parts.blocks.size() != findings.size())
    throw JobError("the board file's motors are not where expected");
  std::vector<Lines> wheels(parts.blocks.size());
  for (const WheelFinding& f : findings) {
    Lines block = parts.blocks[static_cast<std::size_t>(f.motor)];
    Lines encoder_block = parts.blocks[static_cast<std::size_t>(f.encoder)];
    line_of(block, "encoder") = line_of(encoder_block, "encoder");
    line_of(block, "encoder_reversed") = line_of(encoder_block, "encoder_reversed");
    if (*f.turns_backwards) flip(line_of(block, "motor_reversed"));
    if (f.counts_down != *f.turns_backwards) flip(line_of(block, "encoder_reversed"));
    wheels[static_cast<std::size_t>(*f.wheel)] = block;
  }
  std::string out = join(parts.before);
  for (const Lines& block : wheels) out += join(block);
  return out + join(parts.after);
}

std::string with_calibration(const std::string& text, const std::string& file) {
  Lines lines = split(text);
  const std::string line = "calibration = \"" + file + "\"";
  const auto board = std::find(lines.begin(), lines.end(), "[board]");
  if (board == lines.end()) throw JobError("the board file has no line \"[board]\" of its own");
  for (auto it = board + 1; it != lines.end() && !starts_with(*it, "["); ++it) {
    if (!has_key(*it, "calibration")) continue;
    *it = line;
    return join(lines);
  }
  lines.insert(board + 1, line);
  return join(lines);
}

}  // namespace equipoise::app
