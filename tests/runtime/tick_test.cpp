// The tick touches nothing but its own memory: no allocation, no system call.
#include <gtest/gtest.h>
#include <linux/filter.h>
#include <linux/seccomp.h>
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmath>
#include <cstddef>
#include <memory>
#include <string>

#include "allocation_watch.hpp"
#include "closed_loop.hpp"

namespace equipoise {
namespace {

template <class Firmware>
Command spinning() {
  Command command = ClosedLoop::armed();
  command.yaw_rate_rad_s = 2.0 * kPi;
  command.velocity_W_m_s = 0.1 * Vec2(std::cos(Firmware::kForward_rad), std::sin(Firmware::kForward_rad));
  return command;
}

/// Keeps the compiler from leaving out an allocation that nobody looks at.
template <class Pointer>
void look_at(Pointer pointer) {
  asm volatile("" : : "g"(pointer) : "memory");
}

TEST(AllocationWatchTest, SeesWhatTheTickMustNotDo) {
  const AllocationWatch watch;
  auto one = std::make_unique<double>(1.0);
  look_at(one.get());
  EXPECT_EQ(watch.count(), 1);
  one.reset();
  EXPECT_EQ(watch.count(), 2);
  const Eigen::VectorXd dynamic = Eigen::VectorXd::Zero(100);
  look_at(dynamic.data());
  EXPECT_EQ(watch.count(), 3);
  void* block = std::malloc(10);
  look_at(block);
  std::free(block);
  EXPECT_EQ(watch.count(), 5);
}

/// Balances, spins and drives, fails, arms again. True: its motors ran.
template <class Firmware, class Loop>
bool exercise(Loop& loop) {
  const bool ran = loop.balance(0.1).motors.enable;
  loop.run(0.9, ClosedLoop::armed());
  loop.run(2.0, spinning<Firmware>());
  loop.step(spinning<Firmware>(), [](RawSample& raw, Command&) { raw.gyro_counts[0] = NAN; });
  loop.run(0.05, Command{});
  loop.run(0.5, ClosedLoop::armed());
  return ran;
}

/// Every estimator runs beside the controlling one.
ClosedLoopOptions controlled_by(const std::string& estimator) {
  ClosedLoopOptions options;
  options.estimator = estimator;
  options.compare = true;
  return options;
}

template <class Firmware, class Pipeline>
std::int64_t allocations_of(const std::string& estimator) {
  ClosedLoopWith<Pipeline, Firmware> loop(controlled_by(estimator));
  const AllocationWatch watch;
  const bool ran = exercise<Firmware>(loop);
  const std::int64_t count = watch.count();
  EXPECT_TRUE(ran);
  return count;
}

/// From here on any system call but exit_group kills the process.
bool forbid_system_calls() {
  sock_filter program[] = {
      BPF_STMT(BPF_LD | BPF_W | BPF_ABS, offsetof(seccomp_data, nr)),
      BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, static_cast<unsigned>(SYS_exit_group), 0, 1),
      BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_ALLOW),
      BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_KILL_PROCESS),
  };
  const sock_fprog filter{static_cast<unsigned short>(std::size(program)), program};
  return prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) == 0 &&
         prctl(PR_SET_SECCOMP, SECCOMP_MODE_FILTER, &filter) == 0;
}

/// How a child ends that does `work` without system calls; -1: this kernel cannot filter them.
template <class Work>
int status_without_system_calls(Work&& work) {
  constexpr int kNoFilter = 77;
  const pid_t child = fork();
  if (child == 0) {
    if (!forbid_system_calls()) syscall(SYS_exit_group, kNoFilter);
    work();
    syscall(SYS_exit_group, 0);
  }
  int status = 0;
  waitpid(child, &status, 0);
  return WIFEXITED(status) && WEXITSTATUS(status) == kNoFilter ? -1 : status;
}

TEST(SystemCallFilter, CatchesOne) {
  const int status = status_without_system_calls([] { (void)getppid(); });
  if (status == -1) GTEST_SKIP() << "no seccomp filters here";
  EXPECT_TRUE(WIFSIGNALED(status));
}

/// How a child ends that lets two pipelines of a robot run.
template <class Firmware, class First, class Second>
int status_of_runs(const std::string& estimator) {
  ClosedLoopWith<First, Firmware> first(controlled_by(estimator));
  ClosedLoopWith<Second, Firmware> second(controlled_by(estimator));
  return status_without_system_calls([&] {
    (void)exercise<Firmware>(first);
    (void)exercise<Firmware>(second);
  });
}

class MbbrTick : public ::testing::TestWithParam<std::string> {};
class MipTick : public ::testing::TestWithParam<std::string> {};

TEST_P(MbbrTick, AllocatesNothing) {
  EXPECT_EQ((allocations_of<MbbrFirmware, MbbrScheduledPipeline>(GetParam())), 0);
  EXPECT_EQ((allocations_of<MbbrFirmware, MbbrThesisPipeline>(GetParam())), 0);
}

TEST_P(MipTick, AllocatesNothing) {
  EXPECT_EQ((allocations_of<MipFirmware, MipSlcPipeline>(GetParam())), 0);
  EXPECT_EQ((allocations_of<MipFirmware, MipLqrPipeline>(GetParam())), 0);
}

TEST_P(MbbrTick, MakesNoSystemCall) {
  const int status = status_of_runs<MbbrFirmware, MbbrScheduledPipeline, MbbrThesisPipeline>(GetParam());
  if (status == -1) GTEST_SKIP() << "no seccomp filters here";
  EXPECT_EQ(status, 0) << "killed by a system call in the tick";
}

TEST_P(MipTick, MakesNoSystemCall) {
  const int status = status_of_runs<MipFirmware, MipSlcPipeline, MipLqrPipeline>(GetParam());
  if (status == -1) GTEST_SKIP() << "no seccomp filters here";
  EXPECT_EQ(status, 0) << "killed by a system call in the tick";
}

std::string named(const ::testing::TestParamInfo<std::string>& test) { return test.param; }
INSTANTIATE_TEST_SUITE_P(EveryEstimator, MbbrTick, ::testing::ValuesIn(MbbrFirmware::estimators()), named);
INSTANTIATE_TEST_SUITE_P(EveryEstimator, MipTick, ::testing::ValuesIn(MipFirmware::estimators()), named);

}  // namespace
}  // namespace equipoise
