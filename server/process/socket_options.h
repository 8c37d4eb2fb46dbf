#pragma once

namespace taclink::server {

/// What waits in the kernel to be sent is out of date when it is sent: on a slow link it would make all that
/// follows seconds old, for good. From now on a write to this TCP socket blocks where some kilobytes are not
/// sent yet, and whoever writes decides what is left out. The rate is not bounded: data that is under way
/// does not count.
void BoundUnsent(int socket);

}  // namespace taclink::server
