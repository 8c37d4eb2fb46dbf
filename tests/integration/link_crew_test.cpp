#include "client/command/cli/link_crew.h"

#include <gtest/gtest.h>

#include <atomic>
#include <future>
#include <stdexcept>
#include <vector>

namespace taclink::command {
namespace {

TEST(LinkCrewTest, EachLinkGoesInItsOrder) {
  constexpr size_t kLinks = 5, kPieces = 200;
  std::vector<std::vector<size_t>> done(kLinks);  // each used by one thread at a time
  std::vector<std::atomic<int>> inside(kLinks);
  std::vector<std::future<bool>> ends;
  LinkCrew crew(kLinks, 3);
  for (size_t piece = 0; piece < kPieces; ++piece) {
    for (size_t link = 0; link < kLinks; ++link) {
      ends.push_back(crew.Post(link, [&, piece, link] {
        const bool alone = inside[link]++ == 0;
        done[link].push_back(piece);
        --inside[link];
        return alone;
      }));
    }
  }
  for (auto& end : ends) EXPECT_TRUE(end.get());
  for (const auto& pieces : done) {
    ASSERT_EQ(pieces.size(), kPieces);
    for (size_t i = 0; i < kPieces; ++i) EXPECT_EQ(pieces[i], i);
  }
}

TEST(LinkCrewTest, LinksDoNotWaitForEachOther) {
  std::promise<void> other_done;
  LinkCrew crew(2, 2);
  auto first = crew.Post(0, [&] { other_done.get_future().wait(); });
  crew.Post(1, [&] { other_done.set_value(); }).get();
  first.get();
}

TEST(LinkCrewTest, AnExceptionIsToldAndTheNextPieceIsDone) {
  LinkCrew crew(1, 1);
  auto thrown = crew.Post(0, []() -> int { throw std::runtime_error("as meant"); });
  auto next = crew.Post(0, [] { return 5; });
  EXPECT_THROW(thrown.get(), std::runtime_error);
  EXPECT_EQ(next.get(), 5);
}

}  // namespace
}  // namespace taclink::command
