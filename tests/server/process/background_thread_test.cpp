#include "server/process/background_thread.h"

#include <gtest/gtest.h>

#include <future>
#include <thread>
#include <vector>

namespace taclink::server {
namespace {

TEST(BackgroundThread, DoesJobsInTheirOrderInAnotherThread) {
  std::vector<int> done;
  std::thread::id where;
  {
    BackgroundThread thread;
    for (int job = 0; job < 100; ++job) {
      thread.Post([&, job] {
        done.push_back(job);
        where = std::this_thread::get_id();
      });
    }
  }
  ASSERT_EQ(done.size(), 100u);
  for (int job = 0; job < 100; ++job) EXPECT_EQ(done[static_cast<size_t>(job)], job);
  EXPECT_NE(where, std::this_thread::get_id());
}

TEST(BackgroundThread, WaitsForWork) {
  BackgroundThread thread;
  for (int round = 0; round < 3; ++round) {
    std::promise<void> done;
    thread.Post([&] { done.set_value(); });
    done.get_future().get();
  }
}

}  // namespace
}  // namespace taclink::server
