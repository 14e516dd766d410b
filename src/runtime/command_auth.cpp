#include "equipoise/runtime/command_auth.hpp"

#include <fcntl.h>
#include <sodium.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <stdexcept>
#include <vector>

namespace equipoise::runtime {
namespace {

static_assert(CommandKey::kBytes == crypto_auth_KEYBYTES);
static_assert(sizeof(signed_command_t::mac) == crypto_auth_BYTES);

constexpr std::size_t kHexBytes = 2 * CommandKey::kBytes;

void need_sodium() {
  if (sodium_init() < 0) throw std::runtime_error("libsodium could not be initialised");
}

std::vector<std::uint8_t> signed_bytes(signed_command_t message) {
  std::memset(message.mac, 0, sizeof message.mac);
  std::vector<std::uint8_t> bytes(static_cast<std::size_t>(message.getEncodedSize()));
  message.encode(bytes.data(), 0, static_cast<int>(bytes.size()));
  return bytes;
}

/// Closes on every way out.
struct File {
  int fd;
  ~File() {
    if (fd >= 0) close(fd);
  }
};

}  // namespace

CommandKey CommandKey::load(const std::string& path) {
  need_sodium();
  const File file{open(path.c_str(), O_RDONLY | O_CLOEXEC)};
  struct stat about {};
  if (file.fd < 0 || fstat(file.fd, &about) != 0)
    throw std::runtime_error(path + ": " + std::strerror(errno) + "; make a key with equipoise keygen");
  if (!S_ISREG(about.st_mode)) throw std::runtime_error(path + ": is no file");
  if ((about.st_mode & 077U) != 0)
    throw std::runtime_error(path + ": others may read or write this key; chmod 600 " + path);
  if (about.st_uid != geteuid() && about.st_uid != 0)
    throw std::runtime_error(path + ": belongs to another user; chown it to the one who runs this");
  std::array<char, kHexBytes + 2> text{};
  const ssize_t size = read(file.fd, text.data(), text.size());
  std::array<std::uint8_t, kBytes> bytes{};
  std::size_t decoded = 0;
  const bool length = size == static_cast<ssize_t>(kHexBytes) ||
                      (size == static_cast<ssize_t>(kHexBytes) + 1 && text[kHexBytes] == '\n');
  const bool good =
      length &&
      sodium_hex2bin(bytes.data(), bytes.size(), text.data(), kHexBytes, nullptr, &decoded, nullptr) == 0 &&
      decoded == kBytes;
  sodium_memzero(text.data(), text.size());
  if (!good)
    throw std::runtime_error(path + ": is no key (64 hexadecimal digits); equipoise keygen makes one");
  CommandKey key(bytes);
  sodium_memzero(bytes.data(), bytes.size());
  return key;
}

void CommandKey::create(const std::string& path) {
  need_sodium();
  const File file{open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0600)};
  if (file.fd < 0) throw std::runtime_error(path + ": " + std::strerror(errno));
  std::array<std::uint8_t, kBytes> bytes{};
  randombytes_buf(bytes.data(), bytes.size());
  std::array<char, kHexBytes + 1> text{};
  sodium_bin2hex(text.data(), text.size(), bytes.data(), bytes.size());
  text[kHexBytes] = '\n';
  const bool written = write(file.fd, text.data(), text.size()) == static_cast<ssize_t>(text.size());
  sodium_memzero(bytes.data(), bytes.size());
  sodium_memzero(text.data(), text.size());
  if (written) return;
  unlink(path.c_str());
  throw std::runtime_error(path + ": cannot be written");
}

CommandKey::~CommandKey() { sodium_memzero(bytes_.data(), bytes_.size()); }

void CommandKey::sign(signed_command_t* message) const {
  const std::vector<std::uint8_t> bytes = signed_bytes(*message);
  crypto_auth(message->mac, bytes.data(), bytes.size(), bytes_.data());
}

bool CommandKey::signed_by_it(const signed_command_t& message) const {
  const std::vector<std::uint8_t> bytes = signed_bytes(message);
  return crypto_auth_verify(message.mac, bytes.data(), bytes.size(), bytes_.data()) == 0;
}

CommandGate::CommandGate(const CommandKey& key) : key_(key) {
  need_sodium();
  randombytes_buf(session_.session, sizeof session_.session);
}

bool CommandGate::accept(const signed_command_t& message, Command* out) {
  const bool finite = std::isfinite(message.velocity_W_m_s[0]) && std::isfinite(message.velocity_W_m_s[1]) &&
                      std::isfinite(message.yaw_rate_rad_s);
  if (!key_.signed_by_it(message) ||
      std::memcmp(message.session, session_.session, sizeof session_.session) != 0 ||
      message.sequence <= session_.last_sequence || !finite) {
    ++session_.refused;
    return false;
  }
  session_.last_sequence = message.sequence;
  ++session_.accepted;
  out->velocity_W_m_s = Vec2(message.velocity_W_m_s[0], message.velocity_W_m_s[1]);
  out->yaw_rate_rad_s = message.yaw_rate_rad_s;
  out->arm = message.arm != 0;
  out->heading_reset = message.heading_reset != 0;
  return true;
}

}  // namespace equipoise::runtime
