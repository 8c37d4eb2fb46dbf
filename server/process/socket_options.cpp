#include "server/process/socket_options.h"

#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/socket.h>

namespace taclink::server {

void BoundUnsent(int socket) {
  const int bytes = 4 << 10;  // the kernel takes up to twice as much
  static_cast<void>(::setsockopt(socket, IPPROTO_TCP, TCP_NOTSENT_LOWAT, &bytes, sizeof bytes));
}

}  // namespace taclink::server
