#pragma once

#include <mutex>

namespace taclink {

/// While there is one, OpenBLAS and OpenMP (in CHOLMOD) work in the calling thread alone: on matrices of this
/// size their threads only wait, and take the cores from other links.
class OneThread {
 public:
  OneThread();
  ~OneThread();
  OneThread(const OneThread&) = delete;
  OneThread& operator=(const OneThread&) = delete;

 private:
  int levels_;
  std::unique_lock<std::mutex> lock_;
};

}  // namespace taclink
