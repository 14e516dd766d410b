// The page that loop and guard share, whose descriptor proves what it is, and the loop's watch over its
// guard.
#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/mman.h>
#include <unistd.h>

#include <fstream>
#include <stdexcept>
#include <string>

#include "equipoise/runtime/supervisor.hpp"
#include "support/file_size_limit.hpp"

namespace equipoise {
namespace {

constexpr std::int64_t kBeat_ns = 5'000'000;

/// What a descriptor is refused for; "": it is taken. The descriptor is closed.
std::string complaint(int fd) {
  try {
    const runtime::SharedHeartbeat page(fd);
  } catch (const std::runtime_error& error) {
    return error.what();
  }
  return "";
}

constexpr off_t kSize = sizeof(runtime::HeartbeatPage);
constexpr int kSeals = F_SEAL_SHRINK | F_SEAL_GROW | F_SEAL_SEAL;

/// Anonymous memory of ours, of zeros.
int memory(off_t size, int seals) {
  const int fd = memfd_create("page", MFD_CLOEXEC | MFD_ALLOW_SEALING);
  EXPECT_EQ(fchmod(fd, 0600), 0);
  EXPECT_EQ(ftruncate(fd, size), 0);
  EXPECT_EQ(fcntl(fd, F_ADD_SEALS, seals), 0);
  return fd;
}

/// How often this process has mapped memory of such a name.
int mappings(const std::string& name) {
  std::ifstream maps("/proc/self/maps");
  int count = 0;
  for (std::string line; std::getline(maps, line);)
    count += line.find("/memfd:" + name) != std::string::npos ? 1 : 0;
  return count;
}

TEST(SharedHeartbeat, TakesOnlySealedAnonymousPagesOfOurs) {
  const runtime::SharedHeartbeat own;
  EXPECT_EQ(complaint(dup(own.fd())), "");
  EXPECT_NE(complaint(open("/tmp", O_TMPFILE | O_RDWR, 0600)).find("sealed"), std::string::npos);
  EXPECT_NE(complaint(memory(kSize, kSeals)).find("something else"), std::string::npos);
  const int open_to_all = memory(kSize, kSeals);
  EXPECT_EQ(fchmod(open_to_all, 0666), 0);
  EXPECT_NE(complaint(open_to_all).find("another user"), std::string::npos);
}

TEST(SharedHeartbeat, AFileWithThePagesContentIsNoPage) {
  runtime::SharedHeartbeat own;
  const int file = open("/tmp", O_TMPFILE | O_RDWR, 0600);
  ASSERT_EQ(write(file, &own.page(), sizeof own.page()), kSize);
  EXPECT_NE(complaint(file).find("sealed"), std::string::npos);
}

TEST(SharedHeartbeat, EverySealIsNeededAndTheSizeToTheByte) {
  for (const int seal : {F_SEAL_SHRINK, F_SEAL_GROW, F_SEAL_SEAL})
    EXPECT_NE(complaint(memory(kSize, kSeals & ~seal)).find("sealed"), std::string::npos) << seal;
  for (const off_t size : {off_t{0}, kSize - 1, kSize + 1, 2 * kSize})
    EXPECT_NE(complaint(memory(size, kSeals)).find("of its size"), std::string::npos) << size;
}

TEST(SharedHeartbeat, SaysWhyADescriptorIsNone) {
  EXPECT_EQ(complaint(-1), "heartbeat page: descriptor: Bad file descriptor");
  const int closed = memory(kSize, kSeals);
  close(closed);
  EXPECT_EQ(complaint(closed), "heartbeat page: descriptor: Bad file descriptor");
}

TEST(SharedHeartbeat, MemoryThatMayNotBeWrittenIsRefusedAndClosed) {
  const int fd = memory(kSize, kSeals | F_SEAL_WRITE);
  EXPECT_EQ(complaint(fd), "heartbeat page: cannot be mapped: Operation not permitted");
  EXPECT_EQ(fcntl(fd, F_GETFD), -1);
}

TEST(SharedHeartbeat, LeavesNothingMappedWhetherItTakesThePageOrNot) {
  ASSERT_EQ(mappings("page"), 0);
  EXPECT_NE(complaint(memory(kSize, kSeals)).find("something else"), std::string::npos);
  EXPECT_EQ(mappings("page"), 0);
  const int before = mappings("equipoise-heartbeat");
  {
    const runtime::SharedHeartbeat own;
    EXPECT_EQ(complaint(dup(own.fd())), "");
    EXPECT_EQ(mappings("equipoise-heartbeat"), before + 1);
  }
  EXPECT_EQ(mappings("equipoise-heartbeat"), before);
}

TEST(SharedHeartbeat, DescriptorZeroIsClosedLikeAnyOtherWhenItIsRefused) {
  const int kept = fcntl(STDIN_FILENO, F_DUPFD_CLOEXEC, 3);
  const int refused = memory(kSize - 1, kSeals);
  ASSERT_EQ(dup2(refused, STDIN_FILENO), STDIN_FILENO);
  EXPECT_NE(complaint(STDIN_FILENO), "");
  EXPECT_EQ(fcntl(STDIN_FILENO, F_GETFD), -1);
  dup2(kept, STDIN_FILENO);
  close(kept);
  close(refused);
}

TEST(SharedHeartbeat, IsOnePageForBothSides) {
  runtime::SharedHeartbeat own;
  runtime::SharedHeartbeat theirs(dup(own.fd()));
  EXPECT_EQ(own.page().loop_ns, 0);
  EXPECT_EQ(own.page().guard_ns, 0);
  EXPECT_EQ(own.page().cut, 0U);
  EXPECT_EQ(own.page().want_enable, 0U);
  own.page().loop_ns = 7;
  theirs.page().guard_ns = 8;
  EXPECT_EQ(theirs.page().loop_ns, 7);
  EXPECT_EQ(own.page().guard_ns, 8);
  EXPECT_NE(fcntl(own.fd(), F_GETFD) & FD_CLOEXEC, 0) << "no other program inherits it";
  EXPECT_EQ(fcntl(own.fd(), F_GET_SEALS), kSeals);
}

TEST(SharedHeartbeat, ClosesItsDescriptorAlsoWhenItRefusesIt) {
  int fd = -1;
  {
    const runtime::SharedHeartbeat own;
    fd = own.fd();
  }
  EXPECT_EQ(fcntl(fd, F_GETFD), -1);
  fd = memfd_create("page", MFD_CLOEXEC | MFD_ALLOW_SEALING);
  EXPECT_NE(complaint(fd), "");
  EXPECT_EQ(fcntl(fd, F_GETFD), -1);
  runtime::SharedHeartbeat other;
  other.page().magic = runtime::HeartbeatPage::kMagic + 1;
  fd = dup(other.fd());
  EXPECT_NE(complaint(fd).find("something else"), std::string::npos);
  EXPECT_EQ(fcntl(fd, F_GETFD), -1);
}

TEST(SharedHeartbeat, MemoryThatAnotherUserMayTouchIsRefused) {
  const runtime::SharedHeartbeat own;
  for (const mode_t mode : {0604U, 0602U, 0601U, 0640U, 0620U, 0610U}) {
    ASSERT_EQ(fchmod(own.fd(), mode), 0);
    EXPECT_NE(complaint(dup(own.fd())).find("another user"), std::string::npos) << std::oct << mode;
  }
  ASSERT_EQ(fchmod(own.fd(), 0600), 0);
  if (fchown(own.fd(), 12345, 12345) != 0) GTEST_SKIP() << "the rest needs root";
  EXPECT_NE(complaint(dup(own.fd())).find("another user"), std::string::npos);
}

TEST(SharedHeartbeat, AMachineWithoutRoomIsAnErrorText) {
  std::string text;
  try {
    const FileSizeLimit none(0);
    const runtime::SharedHeartbeat page;
  } catch (const std::runtime_error& error) {
    text = error.what();
  }
  EXPECT_NE(text.find("no memory for it"), std::string::npos) << text;
}

TEST(SupervisorTest, WhereNothingIsWatchedNothingForbidsMotors) {
  runtime::Supervisor supervisor(runtime::Watched{});
  RawSample raw{};
  for (int tick = 1; tick <= 3; ++tick) {
    raw.t_ns = tick * kBeat_ns;
    EXPECT_EQ(supervisor.begin(raw.t_ns, raw), 0U);
    supervisor.end(true, 0);
  }
}

TEST(SupervisorTest, ADeadGuardForbidsMotors) {
  runtime::HeartbeatPage page{};
  runtime::Supervisor supervisor({&page, 0, nullptr, false});
  RawSample raw{};
  std::int64_t now = 1'000'000'000;
  const auto tick = [&](bool guard_lives) {
    now += kBeat_ns;
    raw.t_ns = now;
    if (guard_lives) page.guard_ns = now;
    const std::uint32_t reasons = supervisor.begin(now, raw);
    const std::int64_t beat_ns = page.loop_ns;
    supervisor.end(true, 0);
    EXPECT_GT(page.loop_ns, beat_ns) << "every tick beats, whoever lives";
    return reasons;
  };
  EXPECT_EQ(tick(false), kGuardDead);  // never seen
  EXPECT_EQ(tick(true), 0U);
  for (int i = 0; i < 100; ++i) EXPECT_EQ(tick(true), 0U);
  int silent = 0;
  while (tick(false) == 0 && silent < 100) ++silent;
  EXPECT_LE(silent, 6);
  EXPECT_EQ(tick(true), 0U);
  page.cut.fetch_add(1);  // the guard found us too late
  EXPECT_EQ(tick(true), kOverrun);
}

TEST(SupervisorTest, ACutIsToldOnceAndOldOnesNever) {
  runtime::HeartbeatPage page{};
  page.cut = 3;
  runtime::Supervisor supervisor({&page, 0, nullptr, false});
  RawSample raw{};
  std::int64_t now = 1'000'000'000;
  const auto tick = [&] {
    raw.t_ns = now += kBeat_ns;
    page.guard_ns = now;
    const std::uint32_t reasons = supervisor.begin(now, raw);
    supervisor.end(false, 0);
    return reasons;
  };
  EXPECT_EQ(tick(), 0U);
  page.cut = 4;
  EXPECT_EQ(tick(), kOverrun);
  EXPECT_EQ(tick(), 0U);
}

TEST(SupervisorTest, AFailedWriteIsForgottenWhenTheNextSucceeds) {
  std::atomic<bool> log_failed{false};
  runtime::Supervisor supervisor({nullptr, 0, &log_failed, true});
  RawSample raw{};
  std::int64_t now = 0;
  const auto tick = [&](int error) {
    raw.t_ns = now += kBeat_ns;
    const std::uint32_t reasons = supervisor.begin(now, raw);
    supervisor.end(true, error);
    return reasons;
  };
  EXPECT_EQ(tick(1), 0U);
  EXPECT_EQ(tick(0), kWriteFailed) << "whatever its sign";
  EXPECT_EQ(tick(0), 0U);
}

TEST(SupervisorTest, AFailedWriteForbidsMotors) {
  runtime::Supervisor supervisor({nullptr, kRealtimeMissing, nullptr, false});
  RawSample raw{};
  raw.t_ns = kBeat_ns;
  EXPECT_EQ(supervisor.begin(kBeat_ns, raw), kRealtimeMissing);
  supervisor.end(false, -EIO);
  raw.t_ns = 2 * kBeat_ns;
  EXPECT_EQ(supervisor.begin(2 * kBeat_ns, raw), kRealtimeMissing | kWriteFailed);
}

}  // namespace
}  // namespace equipoise
