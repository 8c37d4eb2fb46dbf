#include "server/process/thread_setup.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <pthread.h>
#include <sched.h>

#include <string>
#include <thread>

#include "tests/support/log_capture.h"

namespace taclink::server {
namespace {

using ::testing::HasSubstr;

struct Seen {
  int policy = -1;
  int priority = -1;
  cpu_set_t cpus;
};

Seen Try(const RealtimeOptions& options) {
  Seen seen;
  std::thread([&] {
    SetUpThread(options);
    sched_param param{};
    pthread_getschedparam(pthread_self(), &seen.policy, &param);
    seen.priority = param.sched_priority;
    pthread_getaffinity_np(pthread_self(), sizeof(seen.cpus), &seen.cpus);
  }).join();
  return seen;
}

TEST(ThreadSetup, AThreadRunsWhereItIsTold) {
  cpu_set_t mine;
  pthread_getaffinity_np(pthread_self(), sizeof(mine), &mine);
  int cpu = 0;
  while (!CPU_ISSET(static_cast<size_t>(cpu), &mine)) ++cpu;
  const Seen seen = Try({.cpus = {cpu}});
  EXPECT_EQ(CPU_COUNT(&seen.cpus), 1);
  EXPECT_TRUE(CPU_ISSET(static_cast<size_t>(cpu), &seen.cpus));
}

TEST(ThreadSetup, CpusThatAreNotThereAreRefusedKindly) {
  const LogCapture log;
  const Seen seen = Try({.cpus = {CPU_SETSIZE - 1}});
  EXPECT_GE(CPU_COUNT(&seen.cpus), 1);
  EXPECT_THAT(log.text(), HasSubstr(std::to_string(CPU_SETSIZE - 1)));
}

// With the right the priority is there; without it a warning says what to grant.
TEST(ThreadSetup, PriorityIsGivenOrTheMissingRightNamed) {
  const LogCapture log;
  const Seen seen = Try({.priority = 1});
  if (seen.policy == SCHED_FIFO) {
    EXPECT_EQ(seen.priority, 1);
    EXPECT_THAT(log.text(), ::testing::IsEmpty());
  } else {
    EXPECT_THAT(log.text(), HasSubstr("CAP_SYS_NICE"));
    EXPECT_THAT(log.text(), HasSubstr("LimitRTPRIO=1"));
  }
}

}  // namespace
}  // namespace taclink::server
