#include "server/recording/loss_book.h"

#include <gtest/gtest.h>

namespace taclink::server {
namespace {

TEST(LossBook, ADroppedFrameIsBetweenItsNeighbours) {
  LossBook book(2);
  book.Wrote(1, 7);
  book.Dropped(1, 2);
  EXPECT_FALSE(book.Untold(0, 10));
  const auto loss = book.Untold(1, 10);
  ASSERT_TRUE(loss);
  EXPECT_EQ(loss->count(), 2u);
  EXPECT_EQ(loss->after_sequence(), 7u);
  EXPECT_EQ(loss->before_sequence(), 10u);
  EXPECT_EQ(loss->reason(), v1::LOSS_REASON_SLOW);
  EXPECT_EQ(book.lost(), 2u);
  book.Told(1, 2);
  EXPECT_FALSE(book.Untold(1, 11));
}

TEST(LossBook, AChunkThatIsLostTakesItsFramesAlong) {
  LossBook book(1);
  book.Wrote(0, 1);
  book.Wrote(0, 2);
  book.Kept();
  for (const uint64_t sequence : {3u, 4u, 5u}) book.Wrote(0, sequence);
  book.ChunkLost("disk full");
  const auto loss = book.Untold(0, 9);
  ASSERT_TRUE(loss);
  EXPECT_EQ(loss->count(), 3u);
  EXPECT_EQ(loss->after_sequence(), 2u);
  EXPECT_EQ(loss->reason(), v1::LOSS_REASON_DISK);
  EXPECT_EQ(loss->text(), "disk full");
  EXPECT_EQ(book.lost(), 3u);
}

// The message that told of a loss is lost itself.
TEST(LossBook, ALossThatWasToldInALostChunkIsToldAgain) {
  LossBook book(1);
  book.Wrote(0, 1);
  book.Kept();
  book.Dropped(0, 5);
  book.Told(0, 5);
  book.Wrote(0, 7);
  book.ChunkLost("disk gone");
  const auto loss = book.Untold(0, 8);
  ASSERT_TRUE(loss);
  EXPECT_EQ(loss->count(), 6u);
  EXPECT_EQ(loss->after_sequence(), 1u);
  EXPECT_EQ(book.lost(), 6u);
}

}  // namespace
}  // namespace taclink::server
