#include <gtest/gtest.h>

#include <string>

#include "sensing/markers/detect/detector.h"
#include "tests/support/count_allocations.h"
#include "tests/support/paths.h"
#include "tests/support/read_jpeg.h"

namespace taclink {
namespace {

TEST(DetectorAllocation, NoneOncePicturesOfTheKindWereSeen) {
  const std::string folder = testing::TestData("");
  const cv::Mat real = ReadJpegGray(folder + "barrel_real_bottom.jpg"),
                simulated = ReadJpegGray(folder + "barrel_simulated_top.jpg");
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
