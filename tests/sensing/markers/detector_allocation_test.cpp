#include <gtest/gtest.h>

#include <cstdlib>
#include <new>
#include <string>

#include "sensing/markers/detector.h"
#include "tests/support/read_jpeg.h"

namespace {
long allocations = 0;
}  // namespace

void* operator new(std::size_t size) {
  ++allocations;
  if (void* memory = std::malloc(size)) return memory;
  throw std::bad_alloc();
}
void operator delete(void* memory) noexcept {
  std::free(memory);
}
void operator delete(void* memory, std::size_t) noexcept {
  std::free(memory);
}

namespace taclink {
namespace {

TEST(DetectorAllocation, NoneOncePicturesOfTheKindWereSeen) {
  const std::string folder = TACLINK_TEST_DATA;
  const cv::Mat real = ReadJpegGray(folder + "/barrel_real_bottom.jpg"),
                simulated = ReadJpegGray(folder + "/barrel_simulated_top.jpg");
  MarkerDetector detector;
  Detections found;
  const long before = allocations;
  detector.Detect(real, found);
  detector.Detect(simulated, found);
  EXPECT_GT(allocations, before);  // the counter counts
  const long warm = allocations;
  for (int i = 0; i < 3; ++i) {
    detector.Detect(real, found);
    detector.Detect(simulated, found);
  }
  EXPECT_EQ(allocations, warm);
}

}  // namespace
}  // namespace taclink
