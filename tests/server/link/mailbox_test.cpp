#include "server/link/mailbox.h"

#include <gtest/gtest.h>

#include <thread>
#include <vector>

namespace taclink::server {
namespace {

using std::chrono::milliseconds;

TEST(Mailbox, KeepsTheNewestAndCountsTheOthers) {
  Mailbox<int> mailbox;
  for (int value : {1, 2, 3}) mailbox.Put(value);
  int taken = 0;
  ASSERT_TRUE(mailbox.Take(taken, milliseconds(0)));
  EXPECT_EQ(taken, 3);
  EXPECT_FALSE(mailbox.Take(taken, milliseconds(0)));
  EXPECT_EQ(taken, 3);
}

TEST(Mailbox, AWriterThatWaitsLosesNothing) {
  constexpr int kCount = 2000;
  Mailbox<int> mailbox;
  EXPECT_TRUE(mailbox.WaitUntilTaken(milliseconds(0))) << "nothing was put in";
  std::jthread writer([&] {
    for (int i = 1; i <= kCount; ++i) {
      while (!mailbox.WaitUntilTaken(milliseconds(100))) {
      }
      int value = i;
      mailbox.Put(value);
    }
  });
  for (int i = 1; i <= kCount; ++i) {
    int value = 0;
    while (!mailbox.Take(value, milliseconds(100))) {
    }
    ASSERT_EQ(value, i);
  }
}

TEST(Mailbox, BuffersGoRound) {
  Mailbox<std::vector<int>> mailbox;
  std::vector<int> written(100), read(100);
  std::vector<const int*> buffers;
  for (int i = 0; i < 12; ++i) {
    written.resize(100);
    buffers.push_back(written.data());
    mailbox.Put(written);
    ASSERT_TRUE(mailbox.Take(read, milliseconds(0)));
    EXPECT_EQ(read.data(), buffers.back());
  }
  for (size_t i = 3; i < buffers.size(); ++i) EXPECT_EQ(buffers[i], buffers[i - 3]);
}

TEST(Mailbox, TheNewestComesAndNoneTwiceBetweenThreads) {
  constexpr int kCount = 20000;
  Mailbox<int> mailbox;
  std::jthread writer([&] {
    for (int i = 1; i <= kCount; ++i) {
      int value = i;
      mailbox.Put(value);
    }
  });
  int last = 0;
  while (last < kCount) {
    int value = 0;
    if (!mailbox.Take(value, milliseconds(1000))) continue;
    ASSERT_GT(value, last);
    last = value;
  }
}

}  // namespace
}  // namespace taclink::server
