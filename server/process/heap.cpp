#include "server/process/heap.h"

#include <malloc.h>

namespace taclink::server {
namespace {

// Smaller ones, which come and go within a frame, would cost more in pages that are cleared than they save.
constexpr int kLargeBytes = 2 << 20, kKeptBytes = 4 << 20;

}  // namespace

void ReturnLargeBlocks() {
  mallopt(M_MMAP_THRESHOLD, kLargeBytes);
  mallopt(M_TRIM_THRESHOLD, kKeptBytes);
}

}  // namespace taclink::server
