#pragma once

#include <sys/stat.h>

namespace taclink {

/// Files that this program makes from now on are for their owner and group (0640), folders likewise (0750);
/// narrower where it was told to be. For the first lines of main: nothing else runs yet.
inline void KeepFilesFromOthers() {
  constexpr mode_t kOfOthers = S_IWGRP | S_IRWXO;
  ::umask(::umask(kOfOthers) | kOfOthers);
}

}  // namespace taclink
