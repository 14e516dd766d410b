// `equipoise dbc`: the messages of can_wire.hpp as other tools' CAN database, from the constants that the
// wire itself uses.
#include <cstdio>
#include <sstream>

#include "app/cli/commands.hpp"
#include "app/run/can_wire.hpp"

namespace equipoise::app {
namespace {

constexpr const char* kFormat =
    "Eight bytes of a stream, fewer at its end. The bytes of one identifier, in order, are frames: EA 11, "
    "length, message, "
    "CRC-16/CCITT of length and message.";

void messages(std::ostringstream& out, const char* name, std::uint32_t first, const char* sender,
              const char* receiver) {
  for (std::uint32_t i = 0; i < CanWire::kTalkers; ++i) {
    out << "BO_ " << first + i << ' ' << name << '_' << i << ": " << CAN_MAX_DLEN << ' ' << sender << "\n";
    for (int byte = 0; byte < CAN_MAX_DLEN; ++byte)
      out << " SG_ byte_" << byte << " : " << 8 * byte << "|8@1+ (1,0) [0|255] \"\" " << receiver << "\n";
    out << "\n";
  }
}

std::string dbc() {
  std::ostringstream out;
  out << "VERSION \"\"\n\nNS_ :\n\nBS_:\n\nBU_: ROBOT OWNER\n\n";
  messages(out, "TO_ROBOT", CanWire::kToRobot, "OWNER", "ROBOT");
  messages(out, "FROM_ROBOT", CanWire::kFromRobot, "ROBOT", "OWNER");
  out << "CM_ \"equipoise: signed commands and the robot's session on CAN. Each talker has an identifier to "
         "itself.\";\n";
  for (std::uint32_t i = 0; i < CanWire::kTalkers; ++i) {
    out << "CM_ BO_ " << CanWire::kToRobot + i << " \"LCM signed_command_t. " << kFormat << "\";\n"
        << "CM_ BO_ " << CanWire::kFromRobot + i << " \"LCM command_session_t. " << kFormat << "\";\n";
  }
  return out.str();
}

}  // namespace

void add_dbc(Subcommand app) {
  const Subcommand command =
      app.subcommand("dbc", "Prints the robot's CAN messages as a database (DBC) for other tools")
          .example("equipoise dbc > equipoise.dbc");
  command.action([] {
    std::printf("%s", dbc().c_str());
    return 0;
  });
}

}  // namespace equipoise::app
