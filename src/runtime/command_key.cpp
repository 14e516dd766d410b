#include "equipoise/runtime/command_key.hpp"

#include <fcntl.h>
#include <sodium.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <sstream>
#include <stdexcept>

#include "equipoise/config.hpp"

namespace equipoise::runtime {
namespace {

static_assert(CommandKey::kBytes == crypto_generichash_KEYBYTES);
static_assert(CommandKey::kMacBytes == crypto_generichash_BYTES_MIN);

constexpr const char* kMagic = "equipoise-key-1";
constexpr std::size_t kLongestFile = 256;

void need_sodium() {
  if (sodium_init() < 0) throw std::runtime_error("libsodium could not be initialised");
}

CommandKey random_key() {
  need_sodium();
  CommandKey::Bytes bytes{};
  randombytes_buf(bytes.data(), bytes.size());
  const CommandKey key(bytes);
  sodium_memzero(bytes.data(), bytes.size());
  return key;
}

/// Closes on every way out.
struct File {
  int fd;
  ~File() {
    if (fd >= 0) close(fd);
  }
};

CommandKey from_hex(const std::string& path, const std::string& hex) {
  CommandKey::Bytes bytes{};
  std::size_t decoded = 0;
  const bool good =
      sodium_hex2bin(bytes.data(), bytes.size(), hex.data(), hex.size(), nullptr, &decoded, nullptr) == 0 &&
      hex.size() == 2 * CommandKey::kBytes && decoded == CommandKey::kBytes;
  if (!good) throw ConfigError(path + ": is no key; equipoise keygen makes one");
  const CommandKey key(bytes);
  sodium_memzero(bytes.data(), bytes.size());
  return key;
}

/// `any_owner`: of root, who renews the key of the robot's user.
std::string private_text(const std::string& path, bool any_owner = false) {
  const File file{open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK)};  // a pipe is not waited for
  struct stat about {};
  if (file.fd < 0 || fstat(file.fd, &about) != 0)
    throw ConfigError(path + ": " + std::strerror(errno) + "; make a key with equipoise keygen");
  if (!S_ISREG(about.st_mode)) throw ConfigError(path + ": is no file");
  if ((about.st_mode & 077U) != 0)
    throw ConfigError(path + ": others may read or write this key; chmod 600 " + path);
  if (about.st_uid != geteuid() && about.st_uid != 0 && !(any_owner && geteuid() == 0))
    throw ConfigError(path + ": belongs to another user; chown it to the one who runs this");
  std::string text(kLongestFile, '\0');
  const ssize_t size = read(file.fd, text.data(), text.size());
  text.resize(static_cast<std::size_t>(std::max<ssize_t>(size, 0)));
  return text;
}

/// Wipes the text.
bool write_all(int fd, std::string&& text) {
  const bool written =
      write(fd, text.data(), text.size()) == static_cast<ssize_t>(text.size()) && fsync(fd) == 0;
  sodium_memzero(text.data(), text.size());
  return written;
}

void write_private(const std::string& path, std::string&& text) {
  const File file{open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0600)};
  if (file.fd < 0) throw ConfigError(path + ": " + std::strerror(errno));
  if (write_all(file.fd, std::move(text))) return;
  unlink(path.c_str());
  throw ConfigError(path + ": cannot be written");
}

void check_name(const std::string& what, const std::string& name) {
  if (!is_command_name(name))
    throw ConfigError(what + " \"" + name +
                      "\": one to sixteen letters, digits, '-', '_' and '.' are allowed");
}

}  // namespace

bool is_command_name(const std::string& name) {
  const auto allowed = [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '-' ||
           c == '_' || c == '.';
  };
  return !name.empty() && name.size() <= CommandKeys::kLongestName &&
         std::all_of(name.begin(), name.end(), allowed);
}

CommandKey::~CommandKey() { sodium_memzero(bytes_.data(), bytes_.size()); }

CommandKey CommandKey::derived(const std::string& purpose) const {
  Bytes bytes{};
  crypto_generichash(bytes.data(), bytes.size(), reinterpret_cast<const unsigned char*>(purpose.data()),
                     purpose.size(), bytes_.data(), bytes_.size());
  const CommandKey key(bytes);
  sodium_memzero(bytes.data(), bytes.size());
  return key;
}

void CommandKey::mac(const std::vector<std::uint8_t>& data, std::uint8_t* out) const {
  crypto_generichash(out, kMacBytes, data.data(), data.size(), bytes_.data(), bytes_.size());
}

bool CommandKey::proves(const std::vector<std::uint8_t>& data, const std::uint8_t* claimed) const {
  std::array<std::uint8_t, kMacBytes> right{};
  mac(data, right.data());
  return sodium_memcmp(right.data(), claimed, kMacBytes) == 0;
}

std::string CommandKey::hex() const {
  std::string text(2 * kBytes + 1, '\0');
  sodium_bin2hex(text.data(), text.size(), bytes_.data(), bytes_.size());
  text.pop_back();
  return text;
}

CommandKeys CommandKeys::of_robot(const std::string& robot, const CommandKey& secret) {
  need_sodium();
  check_name("robot", robot);
  return {robot, "", secret, secret.derived("announcements")};
}

CommandKeys CommandKeys::of_holder(const std::string& holder) const {
  check_name("holder", holder);
  return {robot_, holder, commands(holder), announcements_};
}

CommandKey CommandKeys::announcements() const { return announcements_; }

CommandKey CommandKeys::commands(const std::string& holder) const {
  if (holder_.empty()) return secret_.derived("commands of " + holder);
  if (holder_ != holder)
    throw ConfigError("this key is " + holder_ + "'s; one for " + holder + " is made from the robot's own");
  return secret_;
}

CommandKeys CommandKeys::load(const std::string& path) {
  need_sodium();
  return read(path, private_text(path));
}

CommandKeys CommandKeys::read(const std::string& path, const std::string& text) {
  std::istringstream in(text);
  std::string magic;
  std::string kind;
  std::string robot;
  std::string holder;
  std::string secret;
  std::string announcements;
  in >> magic >> kind >> robot;
  if (kind == "holder") in >> holder;
  in >> secret;
  if (kind == "holder") in >> announcements;
  const bool named = is_command_name(robot) && (kind != "holder" || is_command_name(holder));
  std::string more;
  if (magic != kMagic || (kind != "robot" && kind != "holder") || !named || in >> more)
    throw ConfigError(path + ": is no key; equipoise keygen makes one");
  if (kind == "robot") return of_robot(robot, from_hex(path, secret));
  return {robot, holder, from_hex(path, secret), from_hex(path, announcements)};
}

std::string CommandKeys::text() const {
  const std::string begin = std::string(kMagic) + (holder_.empty() ? " robot " : " holder ") + robot_ + " ";
  if (holder_.empty()) return begin + secret_.hex() + "\n";
  return begin + holder_ + " " + secret_.hex() + " " + announcements_.hex() + "\n";
}

void CommandKeys::save(const std::string& path) const { write_private(path, text()); }

void CommandKeys::create(const std::string& path, const std::string& robot) {
  of_robot(robot, random_key()).save(path);
}

/// The file itself, not a link to it; its owner keeps it.
void CommandKeys::rotate(const std::string& link) {
  need_sodium();
  const CommandKeys old = read(link, private_text(link, true));
  if (!old.holder_.empty())
    throw ConfigError(link + ": is " + old.holder_ + "'s; the robot's own key is rotated");
  const std::string path = std::filesystem::canonical(link).string();
  struct stat about {};
  std::string fresh = path + ".XXXXXX";
  const File file{mkostemp(fresh.data(), O_CLOEXEC)};  // for its owner only
  if (file.fd < 0) throw ConfigError(fresh + ": " + std::strerror(errno));
  const bool done = stat(path.c_str(), &about) == 0 &&
                    write_all(file.fd, of_robot(old.robot_, random_key()).text()) &&
                    (geteuid() != 0 || fchown(file.fd, about.st_uid, about.st_gid) == 0) &&
                    std::rename(fresh.c_str(), path.c_str()) == 0;
  if (done) return;
  const int error = errno;
  unlink(fresh.c_str());
  throw ConfigError(path + ": " + std::strerror(error));
}

}  // namespace equipoise::runtime
