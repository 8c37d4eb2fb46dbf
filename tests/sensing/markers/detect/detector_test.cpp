#include "sensing/markers/detect/detector.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <random>
#include <string>

#include "tests/support/drawn_vector.h"
#include "tests/support/paths.h"
#include "tests/support/read_jpeg.h"

namespace taclink {
namespace {

struct Ellipse {
  Vec2 center;
  double a, b, angle, gray;
};

// Anti-aliased by 8 x 8 samples a pixel, on an uneven background, slightly blurred by the sampling, with
// noise.
cv::Mat Draw(int width, int height, const std::vector<Ellipse>& ellipses, double noise, unsigned seed) {
  constexpr int kSamples = 8;
  std::mt19937 random(seed);
  std::normal_distribution<double> gauss(0, noise);
  cv::Mat picture(height, width, CV_8UC1);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const double background = 10 + 15.0 * x / width;
      double gray = background;
      for (const Ellipse& e : ellipses) {
        if (std::hypot(x - e.center.x(), y - e.center.y()) > std::max(e.a, e.b) + 2) continue;
        int inside = 0;
        for (int s = 0; s < kSamples * kSamples; ++s) {
          const Vec2 p(x - 0.5 + (s % kSamples + 0.5) / kSamples, y - 0.5 + (s / kSamples + 0.5) / kSamples);
          const Vec2 q = Eigen::Rotation2Dd(-e.angle) * (p - e.center);
          inside += std::pow(q.x() / e.a, 2) + std::pow(q.y() / e.b, 2) <= 1 ? 1 : 0;
        }
        gray += (e.gray - background) * inside / (kSamples * kSamples);
      }
      picture.at<uint8_t>(y, x) =
          static_cast<uint8_t>(std::clamp(std::lround(gray + gauss(random)), 0L, 255L));
    }
  }
  return picture;
}

const Detection* Nearest(const Detections& found, const Vec2& at, double within) {
  const Detection* best = nullptr;
  for (const Detection& d : found) {
    const double distance = (d.center_px - at).norm();
    if (distance <= within) best = &d, within = distance;
  }
  return best;
}

TEST(Detector, CentresOfEllipsesAreSubPixelAtAnySize) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> uniform(0, 1);
  double squares = 0, normalised = 0;
  int count = 0;
  for (unsigned trial = 0; trial < 6; ++trial) {
    std::vector<Ellipse> ellipses;
    for (int row = 0; row < 6; ++row) {
      for (int column = 0; column < 8; ++column) {
        const double longest = 2 + 13 * uniform(random);  // semi-axis: 4 to 30 px across
        const double shortest = std::max(2.0, longest * (0.6 + 0.4 * uniform(random)));
        const Vec2 shift = DrawnVec2([&] { return uniform(random); });
        ellipses.push_back({Vec2(40 + 75 * column, 45 + 75 * row) + shift, longest, shortest,
                            kPi * uniform(random), 90 + 120 * uniform(random)});
      }
    }
    MarkerDetector detector;
    Detections found;
    detector.Detect(Draw(640, 480, ellipses, 2, trial), found);
    EXPECT_EQ(found.size(), ellipses.size());
    EXPECT_NEAR(detector.noise(), 2, 0.4);
    for (const Ellipse& e : ellipses) {
      const Detection* d = Nearest(found, e.center, 1);
      ASSERT_NE(d, nullptr) << e.center.transpose() << " size " << e.a << " x " << e.b;
      const double error = (d->center_px - e.center).norm();
      EXPECT_LT(error, 0.15) << "size " << e.a << " x " << e.b;
      EXPECT_FALSE(d->clipped);
      EXPECT_NEAR(d->area_px2, kPi * e.a * e.b, 0.25 * kPi * e.a * e.b);
      squares += error * error;
      normalised += error * error / d->covariance_px2.trace();
      ++count;
    }
  }
  EXPECT_LT(std::sqrt(squares / count / 2), 0.05);
  // The stated sigma is neither boastful nor useless.
  EXPECT_GT(normalised / count, 0.1);
  EXPECT_LT(normalised / count, 2);
}

TEST(Detector, DimFarMarkersTwoPixelsApartAreParted) {
  std::vector<Ellipse> ellipses;
  for (int i = 0; i < 12; ++i) {
    for (int row = 0; row < 5; ++row)
      ellipses.push_back({Vec2(60.3 + 5.4 * i, 40.6 + 12 * row), 1.7, 2.6, 0, 45.0 + 3 * row});
  }
  MarkerDetector detector;
  Detections found;
  detector.Detect(Draw(200, 120, ellipses, 1.5, 1), found);
  int hits = 0;
  for (const Ellipse& e : ellipses) hits += Nearest(found, e.center, 0.6) != nullptr ? 1 : 0;
  EXPECT_GE(hits, 57);
  EXPECT_LE(found.size(), ellipses.size());
}

TEST(Detector, WhatIsNoBlobIsLeftOut) {
  // A ring, a bright border along a side, noise.
  cv::Mat picture = Draw(320, 240, {{Vec2(160, 120), 30, 30, 0, 230}}, 3, 5);
  for (int y = 0; y < 240; ++y) {
    for (int x = 0; x < 320; ++x) {
      if (std::hypot(x - 160, y - 120) < 27) picture.at<uint8_t>(y, x) = 5;
      if (x + y < 60) picture.at<uint8_t>(y, x) = 240;
    }
  }
  MarkerDetector detector;
  Detections found;
  detector.Detect(picture, found);
  EXPECT_TRUE(found.empty()) << found.front().center_px.transpose();
}

// An ellipse cut by any side of the picture: the centre of the whole one, with a covariance that is long
// across the edge and holds.
TEST(Detector, ACutBlobStandsForAWholeOne) {
  double normalised = 0;
  int count = 0;
  for (const double inside : {-3.0, 0.0, 2.0, 5.0, 8.0}) {
    for (int side = 0; side < 4; ++side) {
      const Vec2 at[] = {{100, inside}, {100, 239 - inside}, {inside, 120}, {319 - inside, 120}};
      const bool upright = side < 2;
      MarkerDetector detector;
      Detections found;
      detector.Detect(
          Draw(320, 240, {{at[side], upright ? 14.0 : 10.0, upright ? 10.0 : 14.0, 0, 200}}, 2, 6), found);
      ASSERT_EQ(found.size(), 1u) << inside << " side " << side;
      const Detection& d = found.front();
      EXPECT_TRUE(d.clipped);
      const Vec2 error = d.center_px - at[side];
      EXPECT_LT(error.norm(), inside < 1 ? 6 : inside < 3 ? 3 : 1.5) << inside << " side " << side;
      const Vec2 across = upright ? Vec2(0, 1) : Vec2(1, 0), along(across.y(), across.x());
      EXPECT_GT(across.dot(d.covariance_px2 * across), 2 * along.dot(d.covariance_px2 * along));
      normalised += 0.5 * error.dot(d.covariance_px2.inverse() * error);
      ++count;
    }
  }
  EXPECT_LT(normalised / count, 1.5);
}

// Far markers in a dent: bells that run into each other, each with a summit of its own.
TEST(Detector, MergedMarkersComeApart) {
  std::vector<Ellipse> ellipses;
  for (int i = 0; i < 30; ++i) {
    const Vec2 at(40.3 + 40 * (i % 6), 40.6 + 30 * std::floor(i / 6.0));
    const double angle = 0.2 * i;
    const Vec2 step = 4.6 * Vec2(std::cos(angle), std::sin(angle));
    for (int k = -1; k <= 1; ++k) ellipses.push_back({at + k * step, 1.8, 2.2, angle, 130.0 + 10 * k});
  }
  cv::Mat picture = Draw(320, 240, ellipses, 0, 1);
  cv::Mat sharp;
  picture.convertTo(sharp, CV_32F);
  std::mt19937 random(5);
  std::normal_distribution<double> gauss(0, 2);
  for (int y = 1; y < 239; ++y) {  // a blur of about 0.9 px, then noise
    for (int x = 1; x < 319; ++x) {
      double sum = 0;
      for (int dy = -1; dy <= 1; ++dy) {
        for (int dx = -1; dx <= 1; ++dx)
          sum += static_cast<double>(sharp.at<float>(y + dy, x + dx)) * (dx == 0 ? 0.4 : 0.3) *
                 (dy == 0 ? 0.4 : 0.3);
      }
      picture.at<uint8_t>(y, x) =
          static_cast<uint8_t>(std::clamp(std::lround(sum + gauss(random)), 0L, 255L));
    }
  }
  MarkerDetector detector;
  Detections found;
  detector.Detect(picture, found);
  int hits = 0;
  double normalised = 0, squares = 0;
  for (const Ellipse& e : ellipses) {
    const Detection* d = Nearest(found, e.center, 1);
    if (d == nullptr) continue;
    ++hits;
    const Vec2 error = d->center_px - e.center;
    squares += error.squaredNorm();
    normalised += 0.5 * error.dot(d->covariance_px2.inverse() * error);
  }
  EXPECT_GE(hits, 85);
  EXPECT_LE(found.size(), ellipses.size());
  EXPECT_LT(std::sqrt(squares / hits / 2), 0.15);
  EXPECT_LT(normalised / hits, 2);
  RecordProperty("found", hits);
}

// The same marks under four times less and four times more light.
TEST(Detector, ExposureDoesNotMatter) {
  std::vector<Ellipse> ellipses;
  for (int i = 0; i < 40; ++i) {
    const double size = 1.8 + 0.2 * i;
    ellipses.push_back(
        {Vec2(40 + 75 * (i % 8) + 0.1 * i, 45 + 75 * std::floor(i / 8.0)), size, 1.3 * size, 0.1 * i, 120});
  }
  const cv::Mat once = Draw(640, 480, ellipses, 0, 2);
  for (const double exposure : {0.25, 0.5, 1.0, 2.0, 4.0}) {
    std::mt19937 random(5);
    std::normal_distribution<double> gauss(0, 2);
    cv::Mat picture(once.rows, once.cols, CV_8UC1);
    for (int y = 0; y < once.rows; ++y) {
      for (int x = 0; x < once.cols; ++x) {
        const double level = std::min(255.0, exposure * once.at<uint8_t>(y, x)) + gauss(random);
        picture.at<uint8_t>(y, x) = static_cast<uint8_t>(std::clamp(std::lround(level), 0L, 255L));
      }
    }
    MarkerDetector detector;
    Detections found;
    detector.Detect(picture, found);
    EXPECT_EQ(found.size(), ellipses.size()) << "exposure " << exposure;
    for (const Ellipse& e : ellipses) {
      EXPECT_NE(Nearest(found, e.center, 0.5), nullptr) << "exposure " << exposure << " size " << e.a;
    }
  }
}

TEST(Detector, OddPicturesGiveNothing) {
  MarkerDetector detector;
  Detections found(3);
  detector.Detect(cv::Mat(), found);
  EXPECT_TRUE(found.empty());
  detector.Detect(cv::Mat(100, 100, CV_8UC3, cv::Scalar(1, 2, 3)), found);
  EXPECT_TRUE(found.empty());
  for (const int gray : {0, 128, 255}) {
    detector.Detect(cv::Mat(101, 103, CV_8UC1, cv::Scalar(gray)), found);
    EXPECT_TRUE(found.empty());
  }
}

std::vector<Vec2> ReadPoints(const std::string& name) {
  std::ifstream file(testing::TestData(name));
  std::vector<Vec2> points;
  for (std::string line; std::getline(file, line);) {
    double x = 0, y = 0;
    if (std::sscanf(line.c_str(), "%lf,%lf", &x, &y) == 2) points.emplace_back(x, y);
  }
  return points;
}

TEST(Detector, RealPictureAgainstMarkersFoundByEye) {
  const auto truth = ReadPoints("barrel_real_bottom_markers.csv");
  ASSERT_EQ(truth.size(), 256u);
  MarkerDetector detector;
  Detections found;
  detector.Detect(ReadJpegGray(testing::TestData("barrel_real_bottom.jpg")), found);
  int hits = 0;
  for (const Vec2& marker : truth) hits += Nearest(found, marker, 2.5) != nullptr ? 1 : 0;
  int wrong = 0;
  for (const Detection& d : found) {
    const bool real = std::any_of(truth.begin(), truth.end(), [&](const Vec2& t) {
      return (t - d.center_px).norm() < std::max(2.5, d.width_px / 3);
    });
    wrong += real ? 0 : 1;
    EXPECT_GT((d.center_px - Vec2(324.5, 244.5)).norm(), 30) << "in the LED ring";
  }
  EXPECT_GE(hits, 250);
  EXPECT_LE(wrong, 4);
  RecordProperty("found", hits);
  RecordProperty("wrong", wrong);
}

TEST(Detector, SimulatedPictures) {
  for (const char* name : {"barrel_simulated_top.jpg", "barrel_simulated_bottom.jpg"}) {
    MarkerDetector detector;
    Detections found;
    detector.Detect(ReadJpegGray(testing::TestData(name)), found);
    // 256 discs, and a jagged rim of which some bits look like dim ones.
    const auto bright =
        std::count_if(found.begin(), found.end(), [](const Detection& d) { return d.area_px2 > 7; });
    EXPECT_GE(bright, 250) << name;
    EXPECT_LE(found.size(), 264u) << name;
  }
}

}  // namespace
}  // namespace taclink
