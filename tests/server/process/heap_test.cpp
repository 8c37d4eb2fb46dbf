#include "server/process/heap.h"

#include <gtest/gtest.h>
#include <malloc.h>

#include <cstdlib>
#include <memory>

#include "tests/support/memory.h"

namespace taclink::server {
namespace {

struct Free {
  void operator()(void* block) const { std::free(block); }
};
using Block = std::unique_ptr<void, Free>;

Block Take(size_t bytes) {
  return Block(std::malloc(bytes));
}

// glibc by itself takes blocks of a size that was freed before from what it has kept.
TEST(Heap, LargeBlocksAreTheSystemsOwn) {
  if (testing::kSanitized) GTEST_SKIP() << "a sanitizer has its own heap";
  ReturnLargeBlocks();
  Take(size_t{24} << 20).reset();
  const size_t before = mallinfo2().hblkhd;
  Block block = Take(size_t{8} << 20);
  EXPECT_GE(mallinfo2().hblkhd, before + (size_t{8} << 20));
  block.reset();
  EXPECT_EQ(mallinfo2().hblkhd, before);
}

}  // namespace
}  // namespace taclink::server
