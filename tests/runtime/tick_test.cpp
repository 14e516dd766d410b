// The tick touches nothing but its own memory: no allocation, no system call.
#include <gtest/gtest.h>
#include <linux/filter.h>
#include <linux/seccomp.h>
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstddef>
#include <memory>
#include <vector>

#include "allocation_watch.hpp"
#include "closed_loop.hpp"

namespace equipoise {
namespace {

Command spinning() {
  Command command = ClosedLoop::armed();
  command.yaw_rate_rad_s = 2.0 * kPi;
  command.velocity_W_m_s = Vec2(0.1, 0.0);
  return command;
}

class Tick : public ::testing::TestWithParam<int> {
 protected:
  /// Every estimator runs beside the controlling one.
  ClosedLoopOptions options() const {
    ClosedLoopOptions o;
    o.estimator = static_cast<MbbrEstimatorId>(GetParam());
    o.compare = true;
    return o;
  }
};

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

/// Balances, spins and drives, fails, arms again.
template <class Loop>
void exercise(Loop& loop) {
  loop.balance(1.0);
  loop.run(2.0, spinning());
  loop.step(spinning(), [](RawSample& raw, Command&) { raw.gyro_counts[0] = NAN; });
  loop.run(0.05, Command{});
  loop.run(0.5, ClosedLoop::armed());
}

template <class Pipeline>
std::int64_t allocations_of(const ClosedLoopOptions& options) {
  ClosedLoopWith<Pipeline> loop(options);
  const AllocationWatch watch;
  exercise(loop);
  return watch.count();
}

TEST_P(Tick, AllocatesNothing) {
  EXPECT_EQ(allocations_of<MbbrScheduledPipeline>(options()), 0);
  EXPECT_EQ(allocations_of<MbbrThesisPipeline>(options()), 0);
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

TEST_P(Tick, MakesNoSystemCall) {
  ClosedLoop scheduled(options());
  ClosedLoopWith<MbbrThesisPipeline> thesis(options());
  const int status = status_without_system_calls([&] {
    exercise(scheduled);
    exercise(thesis);
  });
  if (status == -1) GTEST_SKIP() << "no seccomp filters here";
  EXPECT_EQ(status, 0) << "killed by a system call in the tick";
}

INSTANTIATE_TEST_SUITE_P(EveryEstimator, Tick, ::testing::Range(0, static_cast<int>(MbbrEstimators::kCount)),
                         [](const auto& test) {
                           return kMbbrEstimatorNames[static_cast<std::size_t>(test.param)];
                         });

}  // namespace
}  // namespace equipoise
