#pragma once

#include <cstdint>
#include <opencv2/core/mat.hpp>
#include <vector>

#include "sensing/core/markers.h"

namespace taclink {

struct DetectorOptions {
  /// A marker is at least this much brighter than what surrounds it, gray levels; raised to 3.5 times the
  /// picture's noise where that is more.
  double min_contrast = 10;
  double min_area_px2 = 5;
  double max_area_fraction = 0.02;  ///< of the picture
  /// Longest over shortest axis of a whole blob. A dome near the edge of a fisheye picture has about 2.
  double max_elongation = 3.2;
  /// Area over that of the ellipse with the same second moments: 1 for every ellipse, below it for arcs,
  /// rings and merged blobs.
  double min_fill = 0.84;  ///< small blobs are let off with less
  double max_fill = 1.2;
  /// Part of the outline along which the picture is darker than half the blob's contrast.
  double min_dark_outline = 0.65;
  /// Contrast against the mean of the blobs within about 70 px; less is dust.
  double min_relative_contrast = 0.35;
  /// The part of a centre's error that is not pixel noise: sampling, and uneven shade, which grows with size.
  double sigma_floor_px = 0.03;
  double sigma_per_size = 0.006;
};

/// Finds bright blobs on a darker surround, in any picture: knows nothing of links. Two tests pick the
/// pixels: brighter than the local background (a morphological opening wider than any marker), and not darker
/// than the mean of the 7 x 7 around, which parts the far markers, 3 px wide and 2 px apart. Connected pixels
/// are a blob; blobs that are not compact or not dark all round are left out. Allocates only when a picture
/// is larger or fuller than those before. One thread.
class MarkerDetector {
 public:
  explicit MarkerDetector(DetectorOptions options = {});

  /// `gray`: CV_8UC1, at least 16 x 16. An empty or other picture gives no detections.
  void Detect(const cv::Mat& gray, Detections& out);

  /// Standard deviation of the last picture's pixel noise, gray levels.
  double noise() const { return noise_; }

 private:
  struct Run {  // of chosen pixels in a row: [begin, end)
    int y, begin, end, label;
  };
  struct Blob {
    int first_run = 0, runs = 0;  // in sorted_
    int area = 0, x0 = 0, x1 = 0, y0 = 0, y1 = 0;
    int64_t sum = 0;  // of gray levels
    bool dropped = false;
  };
  struct Levels {  // gray levels of a blob and of the pixels around it
    double peak = 0, background = 0, outline = 0;
    double dark_outline = 0;  // part of the outline below half the contrast
    double contrast() const { return peak - background; }
  };
  struct Measured {
    Detection detection;
    double contrast = 0;
  };
  struct Cell {
    double weight = 0, contrast = 0;  // sums
  };

  void Resize(int width, int height);
  void EstimateNoise(const cv::Mat& gray);
  void FindBackground(const cv::Mat& gray);
  void FindRuns(const cv::Mat& gray);
  void ChooseRow(const cv::Mat& gray, int y);
  void AppendRuns(int y, int x_begin, int x_end);
  int NewLabel();
  int Root(int label);
  void CollectBlobs(const cv::Mat& gray);
  double BackgroundAt(double x, double y) const;
  void MeasureBlobs(const cv::Mat& gray, double split_level);
  void SplitAgain(const cv::Mat& gray);
  Levels MeasureLevels(const cv::Mat& gray, const Blob& blob);
  bool Measure(const cv::Mat& gray, const Blob& blob, const Levels& levels, Detection& detection) const;
  void DropSpecks(Detections& out);

  const DetectorOptions options_;
  int width_ = 0, height_ = 0;
  double noise_ = 1, contrast_ = 10;
  int cell_ = 8, grid_width_ = 0, grid_height_ = 0;  // background grid, cells of cell_ px
  std::vector<uint8_t> background_, grid_scratch_;
  std::vector<uint16_t> block_sums_;
  std::vector<int16_t> column_sums_, row_background_;  // of the 7 rows around; background by column
  std::vector<uint8_t> chosen_;                        // the row's pixels that passed
  std::vector<Run> runs_, sorted_;
  std::vector<int> parents_, blob_of_label_;
  std::vector<Blob> blobs_;
  std::vector<Run> again_;
  std::vector<Measured> measured_;
  std::vector<Cell> cells_;
};

}  // namespace taclink
