#include "sensing/shell/one_thread.h"

extern "C" {
// OpenBLAS' own; its header is in no runtime package.
void openblas_set_num_threads(int threads);
int openblas_get_parallel();  // 0: the sequential build
// OpenMP's, whose header comes with GCC only.
int omp_get_max_active_levels();
void omp_set_max_active_levels(int levels);
}

namespace taclink {
namespace {

// The sequential build of OpenBLAS shares memory between the threads that call it, and then answers wrongly.
std::mutex* SequentialBlas() {
  static std::mutex sequential;
  static const bool is_sequential = [] {
    openblas_set_num_threads(1);
    return openblas_get_parallel() == 0;
  }();
  return is_sequential ? &sequential : nullptr;
}

}  // namespace

OneThread::OneThread() : levels_(omp_get_max_active_levels()) {
  omp_set_max_active_levels(0);
  if (std::mutex* sequential = SequentialBlas(); sequential != nullptr) lock_ = std::unique_lock(*sequential);
}
OneThread::~OneThread() {
  omp_set_max_active_levels(levels_);
}

}  // namespace taclink
