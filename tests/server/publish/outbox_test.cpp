#include "server/publish/outbox.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace taclink::server {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

OutMessage Message(const std::string& id, bool frame) {
  return {.subject = "s", .id = id, .bytes = std::make_shared<const std::string>(10, 'x'), .frame = frame};
}
size_t RoomFor(size_t messages) {
  return messages * Message("f1", true).size();
}

std::vector<std::string> SendAll(Outbox& outbox) {
  std::vector<std::string> ids;
  while (const OutMessage* message = outbox.Next()) ids.push_back(message->id);
  return ids;
}

TEST(OutboxTest, SendsInOrderAndKeepsUntilAcknowledged) {
  Outbox outbox(RoomFor(9));
  outbox.Push(Message("f1", true));
  outbox.Push(Message("e1", false));
  outbox.Push(Message("f2", true));
  EXPECT_THAT(SendAll(outbox), ElementsAre("f1", "e1", "f2"));
  outbox.Acknowledge("e1");
  outbox.ReturnAll();
  EXPECT_THAT(SendAll(outbox), ElementsAre("f1", "f2"));
  outbox.Acknowledge("f1");
  outbox.Acknowledge("f2");
  outbox.Acknowledge("f2");
  const OutboxCounts counts = outbox.counts();
  EXPECT_EQ(counts.acknowledged, 3U);
  EXPECT_EQ(counts.sent_again, 2U);
  EXPECT_EQ(counts.bytes, 0U);
}

TEST(OutboxTest, WhatIsReturnedGoesToItsOldPlace) {
  Outbox outbox(RoomFor(9));
  for (const char* id : {"a", "b", "c"}) outbox.Push(Message(id, false));
  SendAll(outbox);
  outbox.Push(Message("d", false));
  outbox.Return("b");
  EXPECT_THAT(SendAll(outbox), ElementsAre("b", "d"));
}

TEST(OutboxTest, FramesGiveWayTheOldestFirst) {
  Outbox outbox(RoomFor(5));
  for (const char* id : {"f1", "f2", "f3"}) outbox.Push(Message(id, true));
  for (const char* id : {"e1", "e2", "e3"}) outbox.Push(Message(id, false));
  EXPECT_EQ(outbox.counts().frames_dropped, 1U);
  EXPECT_EQ(outbox.counts().bytes, RoomFor(5));
  outbox.Push(Message("f4", true));
  EXPECT_THAT(SendAll(outbox), ElementsAre("f3", "e1", "e2", "e3", "f4"));
  EXPECT_EQ(outbox.counts().frames_dropped, 2U);
  EXPECT_EQ(outbox.counts().others_dropped, 0U);
}

TEST(OutboxTest, OthersGiveWayOnlyToThemselves) {
  Outbox outbox(RoomFor(3));
  for (const char* id : {"e1", "e2", "e3"}) outbox.Push(Message(id, false));
  outbox.Push(Message("f1", true));
  EXPECT_EQ(outbox.counts().frames_dropped, 1U);
  outbox.Push(Message("e4", false));
  EXPECT_EQ(outbox.counts().others_dropped, 1U);
  EXPECT_THAT(SendAll(outbox), ElementsAre("e2", "e3", "e4"));
}

TEST(OutboxTest, WhatIsInFlightIsNotDropped) {
  Outbox outbox(RoomFor(3));
  for (const char* id : {"f1", "f2", "f3"}) outbox.Push(Message(id, true));
  SendAll(outbox);
  outbox.Push(Message("f4", true));
  EXPECT_THAT(SendAll(outbox), IsEmpty());
  EXPECT_EQ(outbox.counts().frames_dropped, 1U);
  EXPECT_EQ(outbox.in_flight(), 3U);
}

}  // namespace
}  // namespace taclink::server
