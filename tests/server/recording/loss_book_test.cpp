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
  book.Taken();
  for (const uint64_t sequence : {3u, 4u, 5u}) book.Wrote(0, sequence);
  book.Lost(LogStage::kOpen, "disk full");
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
  book.Taken();
  book.Dropped(0, 5);
  book.Told(0, 5);
  book.Wrote(0, 7);
  book.Lost(LogStage::kOpen, "disk gone");
  const auto loss = book.Untold(0, 8);
  ASSERT_TRUE(loss);
  EXPECT_EQ(loss->count(), 6u);
  EXPECT_EQ(loss->after_sequence(), 1u);
  EXPECT_EQ(book.lost(), 6u);
}

TEST(LossBook, WhatCouldNotBeSyncedIsLostThoughTheFileTookIt) {
  LossBook book(1);
  book.Wrote(0, 1);
  book.Taken();
  book.Synced();
  book.Wrote(0, 2);
  book.Taken();
  book.Wrote(0, 3);
  book.Lost(LogStage::kTaken, "bad sector");
  EXPECT_EQ(book.written(), 1u);
  EXPECT_EQ(book.lost(), 2u);
  const auto loss = book.Untold(0, 4);
  ASSERT_TRUE(loss);
  EXPECT_EQ(loss->count(), 2u);
  EXPECT_EQ(loss->after_sequence(), 1u);
}

TEST(LossBook, ALogThatIsDeletedTakesNoOtherAlong) {
  LossBook book(2);
  book.Wrote(0, 1);
  book.Taken();
  book.Synced();
  book.NextLog();
  book.Wrote(0, 2);
  book.Wrote(1, 7);
  book.Taken();
  book.Synced();
  book.Wrote(0, 3);
  book.Lost(LogStage::kSafe, "deleted");
  book.Lost(LogStage::kSafe, "deleted");
  EXPECT_EQ(book.written(), 1u);
  EXPECT_EQ(book.lost(), 3u);
  EXPECT_EQ(book.Untold(0, 4)->count(), 2u);
  EXPECT_EQ(book.Untold(0, 4)->after_sequence(), 1u);
  EXPECT_EQ(book.Untold(1, 8)->count(), 1u);
  EXPECT_EQ(book.Untold(1, 8)->after_sequence(), 0u);
}

// Reports have the number of the frame before them, which is among the lost ones here.
TEST(LossBook, AReportThatIsTheFirstAfterThemHidesNoLostFrame) {
  LossBook book(1);
  for (uint64_t sequence = 5; sequence <= 80; ++sequence) book.Wrote(0, sequence);
  book.Taken();
  book.Lost(LogStage::kSafe, "was deleted");
  const auto loss = book.Untold(0, 80);
  ASSERT_TRUE(loss.has_value());
  EXPECT_EQ(loss->count(), 76u);
  EXPECT_EQ(loss->before_sequence(), 81u);
  EXPECT_EQ(book.Untold(0, 90)->before_sequence(), 90u);
  EXPECT_EQ(book.Untold(0, 0)->before_sequence(), 0u) << "the end";
  book.Told(0, loss->count());
  book.Dropped(0, 3);
  EXPECT_EQ(book.Untold(0, 85)->before_sequence(), 85u) << "nothing of the loss before is left";
}

}  // namespace
}  // namespace taclink::server
