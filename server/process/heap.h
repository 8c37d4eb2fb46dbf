#pragma once

namespace taclink::server {

/// Blocks of megabytes go back to the system as soon as they are freed, for good. glibc by itself keeps what
/// each thread once had, and a link's threads need matrices of tens of megabytes for moments. Before threads
/// are started.
void ReturnLargeBlocks();

}  // namespace taclink::server
