#include "server/process/socket_options.h"

#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/socket.h>

namespace taclink::server {

void BoundUnsent(int socket) {
  const int bytes = 1;  // nothing; 0 would be no limit
  static_cast<void>(::setsockopt(socket, IPPROTO_TCP, TCP_NOTSENT_LOWAT, &bytes, sizeof bytes));
}

}  // namespace taclink::server
