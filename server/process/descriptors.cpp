#include "server/process/descriptors.h"

#include <sys/resource.h>

namespace taclink::server {

void RaiseDescriptorLimit() {
  rlimit files{};
  if (::getrlimit(RLIMIT_NOFILE, &files) != 0) return;
  files.rlim_cur = files.rlim_max;
  static_cast<void>(::setrlimit(RLIMIT_NOFILE, &files));  // what there is remains
}

}  // namespace taclink::server
