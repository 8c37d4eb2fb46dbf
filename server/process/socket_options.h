#pragma once

namespace taclink::server {

/// What waits in the kernel to be sent is out of date when it is sent: on a slow link it would make all that
/// follows seconds old, for good. From now on this TCP socket takes the next write only once all before it is
/// on its way, and whoever writes decides what is left out. The rate is not bounded: what is sent and not yet
/// acknowledged does not count.
void BoundUnsent(int socket);

}  // namespace taclink::server
